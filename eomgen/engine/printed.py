"""The engine in other languages."""

from collections.abc import Callable, Iterable, Mapping
from functools import cache
from typing import Any

from eomgen.engine import (
    adaptive,
    branches,
    complementarity,
    contact_runs,
    contact_times,
    contacts,
    crossings,
    differences,
    elimination,
    equal_steps,
    explicit,
    implicit,
    least_squares,
    projection,
    quaternions,
    rattle,
    roots,
    rosenbrock,
    separable,
    sums,
    symmetric,
    system,
    taylor,
)
from eomgen.engine.embedded import DOP853
from eomgen.subset.expander import Text
from eomgen.subset.languages import JAVASCRIPT, C, Language
from eomgen.subset.printing import printed
from eomgen.subset.unrolled import unrolled_functions

Root = tuple[str, Mapping[str, Any]]
"""A function of the engine, with the values of its `Known` parameters."""
Roots = Iterable[Root]
CONTACTS: Roots = [(name, {}) for name in "begin deepest press strike release settle taken".split()]
"""What is called for rigid contacts."""
EQUAL: Mapping[str, Root] = {
    "euler": ("runge_kutta", {"method": explicit.EULER}),
    "semi_implicit_euler": ("semi_implicit_euler", {}),
    "leapfrog": ("leapfrog", {}),
    "leapfrog_4": ("composed", {"of": explicit.LEAPFROG_4}),
    "leapfrog_6": ("composed", {"of": explicit.LEAPFROG_6}),
    "rk4": ("runge_kutta", {"method": explicit.RUNGE_KUTTA_4}),
    "implicit_midpoint": ("implicit_change", {"method": implicit.IMPLICIT_MIDPOINT}),
    "gauss_4": ("implicit_change", {"method": implicit.GAUSS_4}),
    "gauss_6": ("implicit_change", {"method": implicit.GAUSS_6}),
}
"""What makes a step of given length, by the names of methods."""
METHODS: Mapping[str, Root] = {
    **EQUAL,
    "DOP853": ("made", {"method": DOP853}),
    "Rodas5P": ("rodas_step", {}),
}
"""What makes a step, by the names of all methods of the engine."""
ON_PAGES: tuple[Root, ...] = (
    *EQUAL.values(),
    ("constant_rates", {}),
    ("add_compensated", {}),
    ("normalised", {}),
    ("first_length", {}),
    ("made_many", {"method": DOP853}),
    ("within", {}),
    ("passed_over", {}),
    ("end_at", {}),
    ("moved_onto", {}),
    *CONTACTS,
)
"""What a page that goes on live calls."""
CODES = {
    "TOLERANCE": contacts.TOLERANCE,
    "ENDLESS": contacts.ENDLESS,
    "NO_FORCES": contacts.NO_FORCES,
    "WHOLE": contact_runs.WHOLE,
    "CLOSED": contact_runs.CLOSED,
    "OPENED": contact_runs.OPENED,
    "NOT_FOUND": contact_runs.NOT_FOUND,
    "NOT_KEPT": contact_runs.NOT_KEPT,
    "ENDLESSLY": contact_runs.ENDLESSLY,
    "PROJECTED": projection.PROJECTED,
    "UNUSUAL": adaptive.UNUSUAL,
    "MOST_PARTS": crossings.MOST_PARTS,
}
"""The constants that it needs."""


@cache
def text() -> Text:
    """The text of the whole engine."""
    steps = (adaptive, differences, equal_steps, explicit, implicit, rosenbrock, quaternions, sums)
    solved = (elimination, least_squares, complementarity, roots)
    held = (projection, rattle, separable, symmetric)
    checks = (branches, contacts, contact_times, contact_runs, crossings)
    return Text.of(*steps, *solved, *checks, *held, taylor, system)


def c_source(functions: Roots, language: Language = C) -> str:
    """C, or another language like it, of functions and of all that they call. What includes it
    defines STATES, `System` and its functions, such as
    `void derivative(const System *, double t, const double *y, double *rates)`.
    """
    return printed(text(), functions, language)


@cache
def steps_of_pages() -> str:
    """JavaScript: `makeSteps(STATES, POSITIONS, OTHERS, CONTACTS, PRESSED)` returns what pages
    call, by name. Of these numbers those are given that are needed.
    """
    names = ", ".join(d.name for d in text().expanded(ON_PAGES))
    codes = "".join(f", {name}: {value!r}" for name, value in CODES.items())
    source = JAVASCRIPT.prelude + printed(text(), ON_PAGES, JAVASCRIPT)
    head = "const makeSteps = (STATES, POSITIONS, OTHERS, CONTACTS, PRESSED) =>"
    return f"{head} {{\n{source}return {{ {names}{codes} }};\n}};\n"


@cache
def steps_of_few(states: int) -> Callable[..., bool]:
    """`adaptive.made` of DOP853 for few states, as Python's own numbers."""
    source = Text.of(adaptive, system)
    printed: Callable[..., bool] = unrolled_functions(
        source, [("made", {"method": DOP853})], states
    ).made_DOP853
    return printed
