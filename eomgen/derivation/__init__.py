"""What people read: the equations by SymPy, step by step."""
