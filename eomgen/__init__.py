"""Generates equations of motion: from a scene to a NumPy module of straight-line arithmetic."""
