"""Compiled kernels for several states at once, one in each lane of vector registers.

The width is that of the widest registers that this processor has. It changes no bit of a result.
"""

import ctypes
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eomgen.codegen.backends import c_lanes
from eomgen.codegen.interface import Interface
from eomgen.engine.structures import address
from eomgen.native.compiler import find_compiler
from eomgen.native.library import compiled_library
from eomgen.native.module import USUAL, USUAL_CONSTANT
from eomgen.program.program import Program
from eomgen.run.integrators.fixed_step import Grid
from eomgen.run.integrators.stability import HARM, TRIED
from eomgen.run.problem import USUAL_LENGTH, FloatArray

FLAGS: dict[int, tuple[str, ...]] = {
    8: ("-O3", "-mavx512f", "-mfma"),
    4: ("-O3", "-mavx2", "-mfma"),
    2: ("-O3",),
}
"""Flags of the compiler for vectors of this many doubles."""
PROBE = """
int width(void) {
#if defined __x86_64__ || defined __i386__
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("fma")) return 8;
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return 4;
#endif
    return 2;
}
"""
_POINTER, _LONG, _REAL, _WHOLE = ctypes.c_void_p, ctypes.c_long, ctypes.c_double, ctypes.c_int64


def sources(
    program: Program, interface: Interface, outputs: tuple[str, ...] = ()
) -> Mapping[str, str]:
    """The C sources of the derivative, of initial states and of these outputs, name to text."""
    kept = ("derivative", "initial_state", *outputs)
    program = replace(program, outputs={n: v for n, v in program.outputs.items() if n in kept})
    functions = tuple(f for f in interface.functions if f.name in kept)
    return c_lanes.files(program, replace(interface, functions=functions), USUAL_LENGTH)


@cache
def width() -> int:
    """The number of doubles in a vector register of this processor: 2, 4 or 8.

    Raises `RunError` if there is no compiler.
    """
    probe = compiled_library("width of vectors", lambda: {"probe.c": PROBE}, "probe.c")
    return int(probe.width())


class Columns(ctypes.Structure):
    """Numbers that are one for all members, or one for each (`many`)."""

    _fields_ = (("values", _POINTER), ("many", _LONG))


class _Times(ctypes.Structure):
    _fields_ = (
        *((name, _REAL) for name in ("t_start", "t_end", "dt", "last", "harm")),
        *((name, _WHOLE) for name in ("steps", "every", "tried")),
        *((name, _POINTER) for name in ("done", "stop")),
        ("sizes", Columns),
    )


class Lanes:
    """The library of some sources, for vectors of `lanes` doubles; `about` determines them.

    Arrays have a column for each of n states. Constants and inputs have as many columns, or one for
    all. Raises `RunError` if there is no compiler, or if it fails.
    """

    main = c_lanes.MAIN
    """The source that includes the others."""

    def __init__(
        self,
        texts: Mapping[str, str] | Callable[[], Mapping[str, str]],
        lanes: int | None = None,
        about: str = "",
    ) -> None:
        lanes = lanes or width()
        sources = texts if callable(texts) else lambda: texts
        about = f"lanes {lanes} {about or sorted(sources().items())!r}"
        fused = ("-mfma",) if lanes == 2 < width() else ()  # as those that are wider
        flags = (f"-DWIDTH={lanes}", *FLAGS[lanes], *fused, *find_compiler().ordering)
        self.library = compiled_library(about, sources, self.main, *flags)
        sizes = (_LONG * 5).in_dll(self.library, "sizes")
        self.states, self.inputs, self.parameters, self.constants, self.lanes = sizes
        text = ctypes.string_at(ctypes.addressof(ctypes.c_char.in_dll(self.library, "outputs")))
        lines = (line.split() for line in text.decode().splitlines())
        self.outputs = {name: tuple(map(int, shape)) for name, *shape in lines}

    def prepare(self, p: FloatArray) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
        """The constants (nk, n) and the initial states (ny, n) of parameters (n, np), and which of
        them kernels can compute with: those that are not refused, and of usual size.
        """
        p = np.ascontiguousarray(p, dtype=float)
        n = len(p)
        k, y = np.zeros((self.constants, n)), np.zeros((self.states, n))
        codes = np.zeros(n, dtype=np.intc)
        call = self.library.prepare
        call.argtypes, call.restype = [_LONG, *[_POINTER] * 4], None
        call(n, *(array.ctypes.data for array in (p, k, y, codes)))
        return k, y, (codes == 0) & _usual(p, k)

    def function(self, name: str) -> Any:
        """The compiled function of an output, see `templates/c/lanes.c.jinja`."""
        call = self.library[f"columns_{name}"]
        call.argtypes = [_LONG, _REAL, *[Columns] * 3, _POINTER]
        return call

    def output(
        self, name: str, t: float, y: FloatArray, k: FloatArray, u: FloatArray
    ) -> tuple[FloatArray, NDArray[np.bool_]]:
        """An output at time t and states (ny, n): (…, n), and which columns are valid."""
        y = np.ascontiguousarray(y, dtype=float)
        n, shape = y.shape[1], self.outputs[name]
        out = np.empty((math.prod(shape), n))
        self.function(name)(n, t, *columns_of(y, k, u), address(out))
        return out.reshape(*shape, n), ~np.isnan(out[0])

    def rk4(
        self,
        y: FloatArray,
        k: FloatArray,
        u: FloatArray,
        grid: Grid,
        *,
        sizes: FloatArray,
        unstable: bool = False,
        addresses: tuple[int, int] | None = None,
    ) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Runs from states (ny, n) along a grid by the classical Runge-Kutta method: its rows
        (r, ny, n), without that at the start, and which runs are valid: finite and, unless
        `unstable`, with steps that are short enough for stability, or such that growing modes do no
        harm; `sizes` are those of the states, (ny, n) or (ny, 1).

        Of two 64-bit integers at `addresses`, members that have ended are counted in the first, and
        all runs end early once the second is not 0.
        """
        y = np.ascontiguousarray(y, dtype=float)
        n, steps, dt = y.shape[1], grid.steps, grid.dt
        is_whole = grid.end(steps)[1] is not None
        last = dt if is_whole else grid.t_end - grid.end(steps - 1)[0]
        rows = np.empty((math.ceil(steps / grid.every), self.states, n))
        sound = np.zeros(n, dtype=np.int8)
        idle = np.zeros(2, dtype=np.int64)
        shared = addresses or (idle.ctypes.data, idle.ctypes.data + 8)
        numbers = grid.t_start, grid.t_end, dt, last, HARM, steps, grid.every
        tried = 0 if unstable else TRIED
        times = _Times(*numbers, tried, *shared, *columns_of(sizes))
        call = self.library.rk4
        call.argtypes, call.restype = [_POINTER, _LONG, *[Columns] * 3, *[_POINTER] * 2], None
        call(
            ctypes.byref(times),
            n,
            *columns_of(y, k, u),
            rows.ctypes.data,
            sound.ctypes.data,
        )
        return rows, sound != 0


def columns_of(*arrays: FloatArray) -> list[Columns]:
    """Arrays of one column, or of one for each state, as arguments of the library's functions; they
    must outlive the call.
    """
    assert all(array.flags.c_contiguous and array.dtype == np.float64 for array in arrays)
    return [Columns(address(array), array.shape[1] > 1) for array in arrays]


def _usual(p: FloatArray, k: FloatArray) -> NDArray[np.bool_]:
    """Which sets have parameters (n, np) and constants (nk, n) such that kernels do not underflow
    by accident; see `native.module.are_usual`.
    """
    sizes, fixed = np.abs(p), np.abs(k)
    usual = (sizes == 0) | ((sizes > 1 / USUAL) & (sizes < USUAL))
    known = (fixed == 0) | ((fixed > 1e-240) & (fixed < 1e-160))
    known |= (fixed > 1 / USUAL_CONSTANT) & (fixed < USUAL_CONSTANT)
    return np.asarray(usual.all(axis=1) & known.all(axis=0))
