"""What the public functions return, as values; nothing here computes or draws."""
