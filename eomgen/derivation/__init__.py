"""The equations of motion by SymPy, step by step, for people to read."""
