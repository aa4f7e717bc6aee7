"""Derivations to be read: effects, recursions, impacts and state forms, shown over symbols."""
