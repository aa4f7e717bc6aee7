"""Whether a module is right: other algorithms, extended precision, laws of mechanics."""
