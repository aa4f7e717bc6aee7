"""Values that show themselves in a notebook, although what draws them comes after them.

A scene and a model know nothing of pictures. The packages that draw them enter a function here, and
`read` and `check` are there only after they have.
"""

from collections.abc import Callable
from typing import Any

DISPLAYS: dict[str, Callable[[Any], str]] = {}
"""The functions that show a value as HTML, by the name of its class."""


class Displayed:
    """Shows itself in a notebook."""

    def _repr_html_(self) -> str | None:
        show = DISPLAYS.get(type(self).__name__)
        return None if show is None else show(self)
