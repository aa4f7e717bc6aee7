"""Whether a module is right: other routes, many digits, laws of mechanics."""
