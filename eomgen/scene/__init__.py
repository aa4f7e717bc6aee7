"""Scenes: tables, joints, effects; read and checked, each fault with its place and remedy."""
