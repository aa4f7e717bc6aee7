"""What compiled steps are checked with: switching functions, and the gaps of rigid contacts.

`templates/c/checks.c.jinja` repeats `eomgen.run.crossings` and `eomgen.run.events`. The functions
lie in libraries of their own.
"""

import ctypes
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from eomgen.engine import roots
from eomgen.native.memory import address, placed
from eomgen.native.module import outputs_of, usual_constants
from eomgen.run import branches, crossings, enclosing
from eomgen.run.compiled import Array, Watched
from eomgen.run.events import GAP_CHECKS

_POINTER, _WHOLE, _REAL = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double
_INTERVALS = len(enclosing.INNER) + 1
_FACTORS, _INNER = (np.ascontiguousarray(x) for x in (enclosing.FACTORS, enclosing.INNER))
_MOST_PARTS = crossings.MOST_EVALUATIONS // 4 + 2
"""Parts of a step that wait at one time, at most: each first one takes four evaluations, or three
of one alone, and each more six."""


class Function(NamedTuple):
    """A compiled function: its address, its constants, and the number of its results."""

    address: int
    constants: Any
    size: int


class FunctionStructure(ctypes.Structure):
    """`function` of `templates/c/projection.c.jinja`."""

    _fields_ = (("value", _POINTER), ("k", _POINTER), ("count", _WHOLE))


class Watch(ctypes.Structure):
    """`watch` of `templates/c/checks.c.jinja`."""

    _fields_ = (
        *((name, FunctionStructure) for name in ("switching", "gaps", "rates")),
        *((name, _POINTER) for name in ("factors", "inner", "sizes", "angles")),
        *((name, _WHOLE) for name in ("angled", "timed")),
        *((name, _REAL) for name in ("clear", "earlier", "switched")),
        ("values", _POINTER * 3),
        *((name, _POINTER) for name in ("room", "asked", "kinds")),
        *((name, _WHOLE) for name in ("switches", "gap_checks")),
    )


def context() -> dict[str, Any]:
    """The values of the template."""
    return {
        "intervals": _INTERVALS,
        "irregular": [repr(share) for share in crossings.IRREGULAR],
        "far": repr(crossings.FAR),
        "shortest_part": repr(crossings.SHORTEST_PART),
        "inside": repr(branches.INSIDE),
        "most_evaluations": crossings.MOST_EVALUATIONS,
        "most_parts": _MOST_PARTS,
        "largest_angle": repr(crossings.LARGEST_ANGLE),
        "together": repr(crossings.TOGETHER),
        "located": repr(crossings.LOCATED),
        "root_rtol": repr(roots.RTOL),
        "found": roots.FOUND,
        "wanted": roots.WANTED,
        "gap_checks": [repr(share) for share in GAP_CHECKS],
    }


def functions(module: Any, libraries: Mapping[str, ctypes.CDLL], p: Any) -> dict[str, Function]:
    """The functions of these libraries, by name, at parameters `p`; without those whose kernels
    cannot compute with them.
    """
    found = {}
    for name, library in libraries.items():
        constants = usual_constants(module, name, p)
        if constants is not None:
            address = ctypes.cast(library[f"checked_{name}"], _POINTER).value
            assert address is not None
            found[name] = Function(
                address, ctypes.cast(constants, _POINTER), math.prod(outputs_of(library)[name])
            )
    return found


def watch(
    found: Mapping[str, Function], watched: Watched | None, sizes: Array | None
) -> tuple[Watch, list[Any]]:
    """What `templates/c/checks.c.jinja` is given, and the arrays that it points to."""
    made = Watch(clear=math.inf, switched=-math.inf)
    kept: list[Any] = []
    if watched is None and sizes is None:
        return made, kept
    made.factors, made.inner = address(_FACTORS), address(_INNER)
    switching = contacts = 0
    if watched:
        made.clear, made.switched, made.timed = watched.clear, watched.switched, watched.timed
    if watched and watched.ends:
        (made.earlier, before), (_, start) = watched.ends
        values, angles = np.array((before, start, start)), np.array(watched.angles, np.int64)
        switching, made.angled = len(start), len(angles)
        made.switching = FunctionStructure(*found["switching_functions"])
        made.angles, at = address(angles), address(values)
        for i in range(3):
            made.values[i] = at + 8 * switching * i
        kept += [values, angles]
    if sizes is not None:
        contacts, made.sizes = len(sizes), address(sizes)
        made.gaps, made.rates = (FunctionStructure(*found[name]) for name in ("gaps", "gap_rates"))
    parts = _MOST_PARTS + 1
    shapes = [((1 + parts * (_INTERVALS + 1)) * switching + 3 * contacts,), (parts * switching,)]
    # Memory of numbers of 8 bytes, whatever C takes them for.
    (room, asked, kinds), (made.room, made.asked, made.kinds) = placed([*shapes, (switching,)])
    return made, [*kept, sizes, room, asked, kinds]
