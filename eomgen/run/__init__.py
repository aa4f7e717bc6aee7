"""Integration of generated modules: methods, events, contacts, trajectories."""
