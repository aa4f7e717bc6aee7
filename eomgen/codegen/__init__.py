"""From model to program and from program to files: routes, outputs, backends."""
