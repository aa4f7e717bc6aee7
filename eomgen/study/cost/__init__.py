"""The cost of each effect and of each way to compute the accelerations."""
