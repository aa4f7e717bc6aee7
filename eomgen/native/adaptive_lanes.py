"""Runs of many members at once by DOP853, one in each lane of vector registers.

Steps are those of `engine.adaptive`, to rounding: sums are fused, and sine and
cosine are those of `native.lanes`.
"""

import ctypes
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from eomgen.base.templating import render
from eomgen.codegen.backends import c, c_lanes
from eomgen.codegen.interface import Interface
from eomgen.engine.adaptive import Bounds
from eomgen.engine.embedded import DOP853
from eomgen.native import lanes
from eomgen.native.lanes import Columns, Lanes, columns_of
from eomgen.program.program import Program
from eomgen.run.problem import FloatArray
from eomgen.subset.words import Row

MAIN = "adaptive_lanes.c"
PACES = ((10_000.0, 20.0), (100_000.0, 99.0))
"""A member is given up after this many steps if the rest takes more than this many times as long:
it is then run by itself, where it is checked for stiffness."""
MOST_STEPS = 1e7
_POINTER, _LONG, _REAL = ctypes.c_void_p, ctypes.c_long, ctypes.c_double
_VALID = 1


def sources(
    program: Program, interface: Interface, outputs: tuple[str, ...] = ()
) -> Mapping[str, str]:
    """The C sources of `native.lanes`, and of runs by DOP853."""
    many, last = len(DOP853.nodes), DOP853.last
    stages = [(i, _terms(row)) for i, row in enumerate(DOP853.stages)]
    ends = (DOP853.end, DOP853.long_error, DOP853.short_error)
    context = {
        "main": c_lanes.MAIN,
        "slopes": many,
        "nodes": list(map(repr, DOP853.nodes)),
        "stages": stages[1:last],
        "ends": zip(("end_sum", "long_error", "short_error"), map(_terms, ends), strict=True),
        "dense_stages": stages[last + 1 :],
        "dense": list(map(_terms, DOP853.dense)),
        "safety": repr(DOP853.safety),
        "smallest": repr(DOP853.smallest),
        "greatest": repr(DOP853.greatest),
        "short_weight": repr(DOP853.short_weight),
        "paces": PACES,
        "most_steps": MOST_STEPS,
    }
    own = render(c.TEMPLATES, "adaptive_lanes.c.jinja", context)
    return {**lanes.sources(program, interface, outputs), MAIN: own}


def _terms(row: Row) -> list[tuple[int, str]]:
    """The slopes in a sum, and their factors."""
    return [(j, repr(a)) for j, a in row if a]


class _Common(ctypes.Structure):
    _fields_ = (
        *((name, _REAL) for name in ("rtol", "longest", "t_end")),
        *((name, _POINTER) for name in ("times", "done", "stop")),
    )


class AdaptiveLanes(Lanes):
    """The library of `sources`, for vectors of `lanes` doubles: see `Lanes`."""

    main = MAIN

    def dop853(
        self,
        y: FloatArray,
        k: FloatArray,
        u: FloatArray,
        bounds: Bounds,
        times: FloatArray,
        addresses: tuple[int, int] | None = None,
    ) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Runs from states (ny, n) at time 0 to the last of `times` (m,), s, ascending.

        The absolute tolerances are (ny, n) or (ny, 1). Of two 64-bit integers at `addresses`,
        members that have ended are counted in the first, and all runs end early once the second is
        not 0.

        Returns rows (m, ny, n) at these times, and which runs are valid: finite, without a flag,
        and with steps that are neither too short nor too many.
        """
        y, times = np.ascontiguousarray(y, dtype=float), np.ascontiguousarray(times, dtype=float)
        n = y.shape[1]
        rows, found = np.empty((len(times), self.states, n)), np.zeros(n, dtype=np.int8)
        idle = np.zeros(2, dtype=np.int64)
        shared = addresses or (idle.ctypes.data, idle.ctypes.data + 8)
        common = _Common(bounds.rtol, bounds.longest, float(times[-1]), times.ctypes.data, *shared)
        call = self.library.dop853
        call.argtypes, call.restype = [_POINTER, _LONG, *[Columns] * 4, *[_POINTER] * 2], None
        arguments = columns_of(y, k, u, bounds.atol)
        call(ctypes.byref(common), n, *arguments, rows.ctypes.data, found.ctypes.data)
        return rows, found == _VALID
