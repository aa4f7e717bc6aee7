"""Dots of time derivatives in names of symbols.

They stand behind the name's first part and a mark: letters alone could be the end of a name, as the
d of `bend`.
"""

MARK = "`"
"""No name of a scene contains it; SymPy sorts terms by names, and it sorts before letters."""
DOTS = ("", f"{MARK}dot", f"{MARK}ddot")
"""Of a name, a first and a second derivative."""


def dotted(name: str, count: int = 1) -> str:
    """A name with `count` dots behind its first part, which printers write above it."""
    base, underscore, rest = name.partition("_")
    return f"{base}{DOTS[count]}{underscore}{rest}"
