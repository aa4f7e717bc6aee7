"""Functions in place of those of the mathematical library, whose last digits differ by language,
for tests of equal bits: in the engine's subset of Python, so that they are printed as JavaScript.
"""

import re
import sys

from eomgen.subset.languages import JAVASCRIPT
from eomgen.subset.printing import printed
from eomgen.subset.text import Text
from eomgen.subset.words import sqrt

TURN = 6.283185307179586
WHOLE = 6755399441055744.0
"""Added and subtracted again, it rounds to whole numbers."""


def sin(x: float) -> float:
    """By the series, after whole turns are subtracted."""
    angle = x - ((x / TURN + WHOLE) - WHOLE) * TURN
    square = angle * angle
    total = 1.0
    for i in range(13, 0, -1):
        total = 1.0 - total * square / (2.0 * i * (2.0 * i + 1.0))
    return total * angle


def cos(x: float) -> float:
    """A sine."""
    return sin(x + TURN / 4.0)


def tan(x: float) -> float:
    """A quotient."""
    return sin(x) / cos(x)


def atan(x: float) -> float:
    """By the series of an eighth of the angle."""
    part = x
    for _i in range(3):
        part = part / (1.0 + sqrt(1.0 + part * part))
    square = part * part
    total = 0.0
    for i in range(12, -1, -1):
        total = 1.0 / (2.0 * i + 1.0) - total * square
    return 8.0 * total * part


def atan2(y: float, x: float) -> float:
    """By half of the angle."""
    return 2.0 * atan(y / (sqrt(x * x + y * y) + x))


def asin(x: float) -> float:
    """By the tangent."""
    return atan2(x, sqrt(1.0 - x * x))


def acos(x: float) -> float:
    """By the tangent."""
    return atan2(sqrt(1.0 - x * x), x)


def exp(x: float) -> float:
    """By the series of a small part, squared."""
    part = x / 1024.0
    total = 1.0
    for i in range(12, 0, -1):
        total = 1.0 + total * part / i
    for _i in range(10):
        total = total * total
    return total


def log(x: float) -> float:
    """By the series of a root."""
    root = x
    for _i in range(10):
        root = sqrt(root)
    part = (root - 1.0) / (root + 1.0)
    square = part * part
    total = 0.0
    for i in range(8, -1, -1):
        total = 1.0 / (2.0 * i + 1.0) + total * square
    return 2048.0 * total * part


def tanh(x: float) -> float:
    """By the exponential."""
    return 1.0 - 2.0 / (exp(2.0 * x) + 1.0)


NAMES = ("sin", "cos", "tan", "atan", "atan2", "asin", "acos", "exp", "log", "tanh")


def in_javascript() -> str:
    """Statements that replace the functions of JavaScript."""
    source = printed(Text.of(sys.modules[__name__]), [(name, {}) for name in NAMES], JAVASCRIPT)
    return source + "\n".join(f"Math.{name} = {name};" for name in NAMES) + "\n"


def with_others(source: str) -> str:
    """A generated module with these functions."""

    def split(found: re.Match[str]) -> str:
        names = found[1].split(", ")
        own = [n for n in names if n in NAMES]
        kept = [n for n in names if n not in own]
        return "\n".join(
            f"from {module} import {', '.join(of)}"
            for module, of in (("math", kept), (__name__, own))
            if of
        )

    return re.sub(r"(?m)^from math import (.*)$", split, source)
