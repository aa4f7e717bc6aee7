"""Languages that programs are written in, one module each."""
