"""The command `list`, alone in its module: it needs nothing of what other commands load."""

import argparse

from eomgen.scene.built_in import titles


def list_scenes(given: argparse.Namespace) -> int:
    """Print names and titles of the built-in scenes."""
    named = titles()
    width = max(map(len, named))
    for name, title in named.items():
        print(f"{name:<{width}}  {title}")
    return 0
