"""The command `list`. It is in its own module because it needs none of the slow imports."""

import argparse

from eomgen.scene.built_in import titles


def list_scenes(given: argparse.Namespace) -> int:
    """Print names and titles of the built-in scenes."""
    named = titles()
    width = max(map(len, named))
    for name, title in named.items():
        print(f"{name:<{width}}  {title}")
    return 0
