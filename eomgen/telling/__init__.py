"""Derivations to be read: effects, recursions, impacts and state forms, told over symbols."""
