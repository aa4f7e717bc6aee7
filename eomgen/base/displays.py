"""Values that show themselves: as a few lines, and in a notebook as HTML, although what draws them
comes after them.

A scene and a model know nothing of pictures. The packages that draw them enter a function here, and
`read` and `check` are there only after they have.
"""

import math
import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

DISPLAYS: dict[str, Callable[[Any], str]] = {}
"""The functions that show a value as HTML, by the name of its class."""
WIDTH, LINES, MOST = 90, 3, 2000
"""Letters of a line, lines of a part that is words, and letters of a whole text."""
ENTRIES = 36
"""Arrays of more numbers are shown by their shape alone."""


class Displayed:
    """Shows itself in a notebook; and as text by its name and its parts `shown`, a line each."""

    shown: ClassVar[tuple[str, ...]] = ()

    def _repr_html_(self) -> str | None:
        show = DISPLAYS.get(type(self).__name__)
        return None if show is None else show(self)

    def __repr__(self) -> str:
        """At most `MOST` letters. Parts that are empty, None or not a number are left out."""
        lines, width = [_named(self)], max(map(len, self.shown), default=0)
        for name in self.shown:
            for i, line in enumerate(_lines(getattr(self, name))):
                lines.append(f"    {'' if i else name:<{width}}  {line}".rstrip())
        return _cut("\n".join(lines), MOST)

    __str__ = __repr__


def _lines(part: object) -> list[str]:
    """A part as text: numbers and names as they are, others by how many or what they are."""
    if isinstance(part, Displayed) and not hasattr(part, "name"):
        return _lines(getattr(part, part.shown[0]))
    if hasattr(part, "shape") and hasattr(part, "tolist"):
        return _numbers(part)
    if isinstance(part, bool):
        text = "yes" if part else "no"
    elif isinstance(part, float):
        text = "" if math.isnan(part) else f"{part:.6g}"
    elif isinstance(part, str | int):
        text = str(part)
    elif isinstance(part, Mapping):
        text = ", ".join(_entry(name, value) for name, value in part.items())
    elif isinstance(part, Sequence):
        text = _items(part)
    else:
        text = "" if part is None else _named(part)
    return textwrap.wrap(text, WIDTH, max_lines=LINES, placeholder=" …")


def _items(part: Sequence[object]) -> str:
    """Their names, after their number if they are more than a few; without names the number."""
    names = [getattr(x, "name", getattr(x, "label", x)) for x in part]
    if not all(isinstance(name, str | int | float) for name in names):
        return f"{len(part)} of {type(part[0]).__name__}"
    return f"{len(names)}: " * (len(names) > 3) + ", ".join(map(str, names))


def _entry(name: str, value: object) -> str:
    """A name, and its value if that is a number."""
    is_number = isinstance(value, int | float)
    return f"{name} {value:.6g}" if is_number else name


def _numbers(array: Any) -> list[str]:
    """Few numbers by themselves, a line for each row; many by their shape."""
    if not 0 < array.size <= ENTRIES or array.ndim > 2 or array.dtype.kind not in "fiu":
        return [f"{array.dtype} {array.shape}"]
    rows = array.reshape(-1, array.shape[-1]) if array.ndim else array.reshape(1, 1)
    texts = [[f"{x + 0:.6g}" for x in row] for row in rows.tolist()]
    widths = [max(map(len, column)) for column in zip(*texts, strict=True)]
    return ["  ".join(x.rjust(w) for x, w in zip(row, widths, strict=True)) for row in texts]


def _named(value: object) -> str:
    """The class of a value, and its name if it has one."""
    name = getattr(value, "name", "")
    kind = type(value).__name__
    return f"{kind} {name}" if isinstance(name, str) and name else kind


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most - 2]} …"
