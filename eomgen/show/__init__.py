"""Figures, the page, the derivation as a document."""
