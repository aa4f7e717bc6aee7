"""What equations are computed over: floats, arrays, duals, numbers of many digits."""
