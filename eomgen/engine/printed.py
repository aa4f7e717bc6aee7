"""The engine in other languages."""

import re
import sys
from collections.abc import Callable
from functools import cache

from numpy import int64

from eomgen.engine import (
    adaptive,
    adaptive_runs,
    adaptive_steps,
    branches,
    complementarity,
    contact_runs,
    contact_steps,
    contact_times,
    contacts,
    crossings,
    differences,
    elimination,
    equal_steps,
    explicit,
    implicit,
    least_squares,
    linearly_implicit,
    projection,
    quaternions,
    rattle,
    roots,
    rosenbrock,
    sampling,
    separable,
    sums,
    symmetric,
    system,
    taylor,
)
from eomgen.engine.embedded import DOP853
from eomgen.engine.methods import EQUAL, Root, Roots
from eomgen.engine.structures import parts_of
from eomgen.subset.languages import JAVASCRIPT, C, Language
from eomgen.subset.printing import printed
from eomgen.subset.text import Text, own_name
from eomgen.subset.unrolled import unrolled_functions

CONTACTS: Roots = [(name, {}) for name in "begin deepest press strike release settle taken".split()]
"""What is called for rigid contacts."""
CONTACT_STEPS: Roots = [("through", {})]
"""A step of given length through the events in it."""
ON_PAGES: tuple[Root, ...] = (
    *EQUAL.values(),
    *(("projected_change", known) for name, known in EQUAL.values() if name == "implicit_change"),
    *[(name, {}) for name in "rattle rosenbrock_step rodas_within step_on".split()],
    *[(name, {}) for name in "expanded reach series_step change_after order_of".split()],
    *[(name, {}) for name in "constant_rates coupled varying moved_force differences".split()],
    *[(name, {}) for name in "add_compensated normalised moved_onto convolved".split()],
    *[(name, {"method": DOP853}) for name in ("explicit_step", "interpolate")],
    *[(name, {}) for name in "first_length within passed_over end_at".split()],
    *[(name, {}) for name in "begin deepest press met ended release".split()],
    *[(name, {}) for name in ("sample", "next_tick")],
)
"""What a page that goes on live calls."""
RECORDS: tuple[type, ...] = (
    *(
        adaptive.Bounds,
        adaptive.Progress,
        adaptive_steps.Records,
        adaptive_steps.Start,
        contacts.Touching,
        contacts.Place,
    ),
    *(branches.Switches, crossings.Watch, elimination.Factors, explicit.Split, explicit.Step),
    *(implicit.Stages, rattle.Linked, rosenbrock.Rodas, symmetric.Projected, taylor.Terms),
)
"""What it gives them."""
SIZES = ("STATES", "POSITIONS", "OTHERS", "CONTACTS", "PRESSED", "FIRST", "PRODUCTS", "ORDERS")
"""Sizes that are known for a mechanism."""
CODES = {
    "OPENED": contact_runs.OPENED,
    "NOT_FOUND": contact_runs.NOT_FOUND,
    "NOT_KEPT": contact_runs.NOT_KEPT,
    "MOST_EVENTS": contact_runs.MOST_EVENTS,
    "PROJECTED": projection.PROJECTED,
    "MADE": adaptive.MADE,
    "AGAIN": adaptive.AGAIN,
    "MOST_PARTS": crossings.MOST_PARTS,
    "SLOPES_USED": DOP853.last + 1,
}
"""The constants that it needs."""


@cache
def text() -> Text:
    """The text of the whole engine."""
    adapted = (adaptive, adaptive_runs, adaptive_steps)
    own = (linearly_implicit, sampling)
    steps = (equal_steps, explicit, implicit, rosenbrock, taylor)
    solved = (elimination, least_squares, complementarity, roots)
    held = (projection, rattle, separable, symmetric)
    checks = (branches, contacts, contact_times, contact_runs, contact_steps, crossings)
    return Text.of(
        *adapted, *steps, *own, *solved, *checks, *held, differences, quaternions, sums, system
    )


def c_source(functions: Roots, language: Language = C) -> str:
    """C, or another language like it, of functions and of all that they call. What includes it
    defines STATES, `System` and its functions, such as
    `void derivative(const System *, double t, const double *y, double *rates)`.
    """
    return printed(text(), functions, language)


@cache
def steps_of_pages() -> str:
    """JavaScript: `makeSteps` returns what pages call, by name, and makers of `records`, and is
    given those of the `SIZES` that are needed.
    """
    names = ", ".join(dict.fromkeys(own_name(*root) for root in ON_PAGES))
    codes = "".join(f", {name}: {value!r}" for name, value in CODES.items())
    records = f"const records = {{ {', '.join(map(record_of_pages, RECORDS))} }};\n"
    source = JAVASCRIPT.prelude + printed(text(), ON_PAGES, JAVASCRIPT)
    head = f"const makeSteps = ({{ {', '.join(SIZES)} }}) =>"
    return f"{head} {{\n{source}{records}return {{ {names}{codes}, records }};\n}};\n"


def record_of_pages(kind: type) -> str:
    """JavaScript of a function that makes a record of numbers and arrays that are `given`. Others
    are 0, or have room for the size that they state.
    """
    known = {
        name: str(x) for name, x in vars(sys.modules[kind.__module__]).items() if type(x) is int
    }
    known |= {name: name for name in SIZES}

    def size(text: str) -> str:
        return re.sub(r"[A-Za-z_]\w*", lambda found: known.get(found[0], f"given.{found[0]}"), text)

    parts = parts_of(kind)
    roomy = {
        name: f"new {'Int32' if of is int64 else 'Float64'}Array({' * '.join(map(size, sizes))})"
        for name, (of, sizes) in parts.arrays.items()
    }
    for name, (of, unknowns) in parts.records.items():
        roomy[name] = f"records.{of.__name__}({{ n: {size(unknowns)} }})"
    plain = "".join(f"{name}: 0, " for name in parts.numbers)
    given = ", ".join(f"{name}: given.{name} ?? {made}" for name, made in roomy.items())
    return f"{kind.__name__}: (given) => ({{ {plain}...given, {given} }})"


@cache
def steps_of_few(states: int) -> Callable[..., bool]:
    """`adaptive.made` of DOP853 for few states, as Python's own numbers."""
    source = Text.of(adaptive, sums, system)
    printed: Callable[..., bool] = unrolled_functions(
        source, [("made", {"method": DOP853})], states
    ).made_DOP853
    return printed
