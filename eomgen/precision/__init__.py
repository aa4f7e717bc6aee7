"""Runs in more digits than a double has."""
