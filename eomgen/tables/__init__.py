"""The tables of outputs, of routes from M, V, G, F to accelerations, and of integrators."""
