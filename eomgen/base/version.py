"""The version of the package, which stands here only."""

__version__ = "0.2.0"
