"""The scalars that equations are computed over: floats, arrays, duals, extended precision."""
