"""The engine in other languages."""

from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any

from eomgen.engine import (
    complementarity,
    contact_times,
    contacts,
    least_squares,
    linear,
    roots,
    system,
)
from eomgen.subset.braces import JAVASCRIPT, C, printed
from eomgen.subset.expander import Text

Roots = Iterable[tuple[str, Mapping[str, Any]]]
"""Functions of the engine, each with the values of its `Known` parameters."""
CONTACTS = ("begin", "deepest", "press", "strike", "release", "settle", "closing", "opening")
"""What is called for rigid contacts."""
ON_PAGES: tuple[tuple[str, Mapping[str, Any]], ...] = tuple((name, {}) for name in CONTACTS)
"""What a page that goes on live calls."""
CODES = ("TOLERANCE", "ENDLESS", "NO_FORCES", "UNHELD")
"""The constants that it needs."""


@cache
def text() -> Text:
    """The text of the whole engine."""
    return Text.of(linear, least_squares, complementarity, roots, contacts, contact_times, system)


def c_source(functions: Roots) -> str:
    """C of functions and of all that they call. What includes it defines STATES, `System` and its
    functions, such as `void derivative(const System *, double t, const double *y, double *rates)`.
    """
    return printed(text(), functions, C)


@cache
def steps_of_pages() -> str:
    """JavaScript: `makeSteps(STATES, CONTACTS, PRESSED)` returns the functions that pages call."""
    names = ", ".join(d.name for d in text().expanded(ON_PAGES))
    codes = "".join(f", {name}: {text().constants[name]!r}" for name in CODES)
    source = JAVASCRIPT.prelude + printed(text(), ON_PAGES, JAVASCRIPT)
    made = f"{{\n{source}return {{ {names}{codes} }};\n}};\n"
    return f"const makeSteps = (STATES, CONTACTS, PRESSED) => {made}"
