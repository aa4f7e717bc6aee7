"""The handout's derivation, for trees of pins and free bodies in the plane."""
