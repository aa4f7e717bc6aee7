"""Equilibria, linearisation, modes."""
