"""Figures, the HTML page, the derivation as a document."""
