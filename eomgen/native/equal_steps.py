"""Steps of equal length in compiled code, with the bits of the same steps made in Python."""

import ctypes
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from eomgen.codegen.backends import c
from eomgen.codegen.interface import Interface
from eomgen.run.compiled import Array, EqualSteps, EqualStride
from eomgen.run.integrators.runge_kutta_4 import TABLEAU
from eomgen.run.integrators.tableau import terms
from eomgen.templating import render

METHODS = {"euler": 1, "semi_implicit_euler": 2, "runge_kutta_4": len(TABLEAU.b)}
"""The derivatives in a step, by the name of the method."""
_POINTER, _WHOLE, _REAL = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double
_MADE_ALL = 0


class _Stride(ctypes.Structure):
    _fields_ = (
        *((name, _POINTER) for name in ("k", "u", "allowed")),
        *((name, _REAL) for name in ("t_start", "t_end", "dt")),
        ("before", _WHOLE),
        ("most", _WHOLE),
        *((name, _POINTER) for name in ("rate", "place", "slope", "ends", "states", "losses")),
    )


def source(interface: Interface) -> str:
    """The C source of the methods, which follows that of `templates/c/runs.c.jinja`."""
    rows = zip(TABLEAU.a[1:], TABLEAU.c[1:], strict=True)
    context = {
        "prefix": interface.name,
        "methods": list(METHODS),
        "positions": [i for i, state in enumerate(interface.states) if state.position],
        "stages": [(i, repr(float(node)), _sum(row)) for i, (row, node) in enumerate(rows, 1)],
        "count": len(TABLEAU.b),
        "end_sum": _sum(TABLEAU.b),
    }
    return render(c.TEMPLATES, "equal_steps.c.jinja", context)


def _sum(row: Sequence[float]) -> str:
    return " + ".join(f"{float(factor)!r} * k[{j}][j]" for j, factor in terms(row))


def steps(library: ctypes.CDLL, name: str, constants: Any, inputs: Array) -> EqualSteps:
    """The steps of a method, at the constants of parameters and at inputs."""
    call = library[f"steps_{name}"]
    call.restype = ctypes.c_int
    call.argtypes = [_REAL, *[_POINTER] * 4]
    return partial(_made, call, METHODS[name], constants, inputs)


def _made(
    call: Any,
    calls: int,
    constants: Any,
    inputs: Array,
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
) -> EqualStride:
    """Make steps, with the arguments of `run.compiled.EqualSteps`."""
    ny, count = len(y), ctypes.c_int64()
    rate, allowed = np.array(limits[0]), np.ascontiguousarray(limits[1])
    start = [np.ascontiguousarray(array) for array in (y, lost)]
    place, slope = np.empty((2, ny))
    ends, (states, losses) = np.empty(most), np.empty((2, most, ny))
    arrays = (rate, place, slope, ends, states, losses)
    stride = _Stride(
        ctypes.cast(constants, _POINTER),
        inputs.ctypes.data,
        allowed.ctypes.data,
        t_start,
        t_end,
        dt,
        made,
        most,
        *(array.ctypes.data for array in arrays),
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
        ends[:n], states[:n], losses[:n], calls, rate, place, slope, usual=why == _MADE_ALL
    )
