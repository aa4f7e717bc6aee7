"""The subset of Python in which `eomgen.engine` is written, and its printing in other languages."""
