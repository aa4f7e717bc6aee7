"""Scenes: their tables, joints and effects. Each error states its location and a remedy."""
