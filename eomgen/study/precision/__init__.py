"""Derivatives and runs in extended precision, with more digits than doubles."""
