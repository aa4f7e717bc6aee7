"""Steps of equal length in compiled code, with the bits of the same steps made in Python."""

import ctypes
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from eomgen.codegen.backends import c
from eomgen.codegen.interface import Interface
from eomgen.native.checked import Function
from eomgen.native.constrained import address, constraints, made_margins
from eomgen.run.compiled import Array, Constrained, EqualSteps, EqualStride
from eomgen.run.integrators.composed import PARTS
from eomgen.run.integrators.leapfrog import rates_of
from eomgen.run.integrators.runge_kutta_4 import TABLEAU
from eomgen.run.integrators.tableau import terms
from eomgen.run.problem import Problem
from eomgen.templating import render

LEAPFROGS = {"leapfrog": 1, **{name: len(parts) for name, parts in PARTS.items()}}
METHODS = {"euler": 1, "semi_implicit_euler": 2, "runge_kutta_4": len(TABLEAU.b), **LEAPFROGS}
"""The derivatives in a step, by the name of the method."""
SCALAR = {"number": "double", "zero": "0.0"}
"""How templates of methods write numbers, for one state."""
_POINTER, _WHOLE, _REAL = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double
_MADE_ALL = 0


class Stride(ctypes.Structure):
    """See `templates/c/equal_stride.c.jinja`."""

    _fields_ = (
        *((name, _POINTER) for name in ("k", "u", "allowed")),
        *((name, _REAL) for name in ("t_start", "t_end", "dt")),
        ("before", _WHOLE),
        ("most", _WHOLE),
        ("more", _POINTER),
        ("held", _POINTER),
        *((name, _POINTER) for name in ("rate", "place", "slope", "ends", "states", "losses")),
        ("margins", _POINTER),
        ("iterations", _POINTER),
    )


def source(interface: Interface) -> str:
    """The C source of the methods, which follows that of `templates/c/runs.c.jinja`."""
    context = {
        **methods(interface),
        **SCALAR,
        "derivative": f"{interface.name}_derivative",
        "unit": "unit(",
    }
    return render(c.TEMPLATES, "equal_steps.c.jinja", context)


def methods(interface: Interface) -> dict[str, Any]:
    """The values of `templates/c/explicit_methods.c.jinja`, but for its numbers and derivative."""
    rows = zip(TABLEAU.a[1:], TABLEAU.c[1:], strict=True)
    states = list(enumerate(interface.states))
    return {
        "methods": list(METHODS),
        "compositions": compositions(),
        "positions": [i for i, state in states if state.position],
        "others": [i for i, state in states if not state.position],
        "stages": [(i, repr(float(node)), _sum(row)) for i, (row, node) in enumerate(rows, 1)],
        "count": len(TABLEAU.b),
        "end_sum": _sum(TABLEAU.b),
    }


def compositions() -> list[tuple[str, list[str]]]:
    """The parts of each method that is composed of leapfrog steps."""
    return [(name, [repr(part) for part in parts]) for name, parts in PARTS.items()]


def _sum(row: Sequence[float]) -> str:
    return " + ".join(f"{float(factor)!r} * k[{j}][j]" for j, factor in terms(row))


def steps(
    library: ctypes.CDLL,
    name: str,
    constants: Any,
    inputs: Array,
    functions: Mapping[str, Function],
    problem: Problem,
) -> EqualSteps:
    """The steps of a method, at the constants of parameters and at inputs; `functions` keep
    constraints.
    """
    more = np.ascontiguousarray(rates_of(problem)) if name in LEAPFROGS else None
    held = ctypes.cast(constants, _POINTER), inputs, more, functions
    return partial(made, library[f"steps_{name}"], METHODS[name], *held)


def made(
    call: Any,
    calls: int,
    constants: Any,
    inputs: Array | None,
    more: Any,
    functions: Mapping[str, Function],
    t: float,
    y: Array,
    lost: Array,
    *,
    t_start: float,
    t_end: float,
    dt: float,
    made: int,
    most: int,
    limits: tuple[Array, Array],
    constrained: Constrained | None = None,
    iterates: bool = False,
) -> EqualStride:
    """Make steps, with the arguments of `run.compiled.EqualSteps`.

    call   the method's function
    calls  derivatives in a step, or in an iteration if it `iterates`
    more   what only this method needs, an array or a structure
    functions  that keep constraints, by name
    """
    call.restype = ctypes.c_int
    call.argtypes = [_REAL, *[_POINTER] * 4]
    ny, count = len(y), ctypes.c_int64()
    rate, allowed = np.array(limits[0]), np.ascontiguousarray(limits[1])
    start = [np.ascontiguousarray(array) for array in (y, lost)]
    place, slope = np.empty((2, ny))
    ends, (states, losses) = np.empty(most), np.empty((2, most, ny))
    iterations = np.empty(most, np.int64) if iterates else None
    margins = made_margins(constrained, most)
    keeps = constraints(functions, constrained, inputs, ny)
    arrays = (rate, place, slope, ends, states, losses)
    stride = Stride(
        constants,
        None if inputs is None else inputs.ctypes.data,
        allowed.ctypes.data,
        t_start,
        t_end,
        dt,
        made,
        most,
        more.ctypes.data if isinstance(more, np.ndarray) else more and ctypes.addressof(more),
        address(keeps),
        *(array.ctypes.data for array in (*arrays, margins[1:])),
        None if iterations is None else iterations.ctypes.data,
    )
    why = call(
        t,
        start[0].ctypes.data,
        start[1].ctypes.data,
        ctypes.byref(stride),
        ctypes.byref(count),
    )
    n = count.value
    return EqualStride(
        ends[:n],
        states[:n],
        losses[:n],
        calls,
        rate,
        place,
        slope,
        usual=why == _MADE_ALL,
        iterations=None if iterations is None else iterations[:n],
        margins=margins[: n + 1] if constrained else None,
    )
