"""Constraints: their rows, and the formulations that solve for accelerations under them."""
