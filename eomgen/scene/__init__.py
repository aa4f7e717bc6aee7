"""Scenes: tables, joints and effects, read and checked. An error says its location and remedy."""
