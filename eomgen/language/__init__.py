"""Formulas and quantities of scenes: read, never executed."""
