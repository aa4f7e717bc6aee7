"""Formulas and quantities of scenes. They are parsed, never executed."""
