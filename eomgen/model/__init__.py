"""From scene to model: names bound, geometry normalised, bodies in a tree."""
