"""Orthogonal elimination on Gauss's principle, along a tree."""
