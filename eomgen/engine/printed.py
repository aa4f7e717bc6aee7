"""The engine in other languages."""

from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any

from eomgen.engine import elimination, implicit, linear, projection, roots, rosenbrock, system
from eomgen.subset.braces import JAVASCRIPT, C, printed
from eomgen.subset.expander import Text

Roots = Iterable[tuple[str, Mapping[str, Any]]]
"""Functions of the engine, each with the values of its `Known` parameters."""
ON_PAGES: tuple[tuple[str, Mapping[str, Any]], ...] = (("begun", {}), ("gone_on", {}))
"""What a page that goes on live calls."""


@cache
def text() -> Text:
    """The text of the whole engine."""
    return Text.of(elimination, implicit, linear, projection, roots, rosenbrock, system)


def c_source(functions: Roots) -> str:
    """C of functions and of all that they call. What includes it defines STATES, `System` and its
    functions, such as `void derivative(const System *, double t, const double *y, double *rates)`.
    """
    return printed(text(), functions, C)


@cache
def steps_of_pages() -> str:
    """JavaScript: `makeSteps(STATES)` returns the functions that pages call, by name."""
    names = ", ".join(d.name for d in text().expanded(ON_PAGES))
    source = JAVASCRIPT.prelude + printed(text(), ON_PAGES, JAVASCRIPT)
    return f"const makeSteps = (STATES) => {{\n{source}return {{ {names} }};\n}};\n"
