"""What compiled steps are given of the constraints of a mechanism.

The functions lie in libraries of their own.
"""

import ctypes
from collections.abc import Mapping
from typing import Any

import numpy as np

from eomgen.engine.projection import PROJECTED
from eomgen.native.checked import Function, FunctionStructure
from eomgen.run import margins, projection
from eomgen.run.compiled import Array, Constrained

_POINTER, _WHOLE, _REAL = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double
_FIELDS = ("residuals", "position", "velocity", "margins")


class Constraints(ctypes.Structure):
    """`constraints` of `templates/c/projection.c.jinja`."""

    _fields_ = (
        *((name, FunctionStructure) for name in _FIELDS),
        *((name, _POINTER) for name in ("inputs", "sizes", "quaternions")),
        *((name, _WHOLE) for name in ("count", "states")),
        *((name, _REAL) for name in ("start", "earlier", "t", "here")),
        *((name, _POINTER) for name in ("before", "after", "in_step", "room")),
    )
    kept: Any


def context() -> dict[str, Any]:
    """The values of the template."""
    # Imported here because runs whose library is in the store do without the printer.
    from eomgen.engine.printed import c_source

    return {
        "projection": c_source([("moved_onto", {})]),
        "on_constraints": PROJECTED,
        "near": repr(margins.NEAR),
        "singular": repr(margins.SINGULAR),
    }


def constraints(
    found: Mapping[str, Function],
    constrained: Constrained | None,
    inputs: Array | None,
    states: int,
) -> Constraints | None:
    """What C is given; None if there are no constraints."""
    if constrained is None or inputs is None:
        return None
    functions = [found[name] for name in projection.PROJECTS]
    rows = functions[0].size
    quaternions = np.array(constrained.quaternions, np.int64)
    sizes = np.ascontiguousarray(constrained.sizes)
    in_step, room = np.zeros(2 * rows), np.empty(3 * rows + states)
    made = Constraints(
        *(FunctionStructure(*each) for each in functions),
        *(array.ctypes.data for array in (inputs, sizes, quaternions)),
        len(constrained.quaternions),
        states,
        *(x for pair in constrained.margins for x in pair),
        *(array.ctypes.data for array in (constrained.before, constrained.after, in_step, room)),
    )
    made.kept = [inputs, sizes, quaternions, constrained.before, constrained.after, in_step, room]
    return made


def made_margins(constrained: Constrained | None, most: int) -> Array:
    """Space for the least margins at the start of `most` steps, which is known, and at their ends;
    (0,) without constraints.
    """
    if constrained is None:
        return np.empty(0)
    return np.full(most + 1, constrained.margins[1][1])


def address(made: Constraints | None) -> int | None:
    """Where it lies, or None."""
    return None if made is None else ctypes.addressof(made)
