"""Modules loaded and integrated: methods, events, contacts, trajectories."""
