"""Recording of models as programs by a route, and writing of programs by a backend."""
