"""Vectors of robot files."""

Vector = tuple[float, float, float]
ORIGIN: Vector = (0.0, 0.0, 0.0)
