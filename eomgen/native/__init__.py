"""Generated C, compiled on this machine and loaded."""
