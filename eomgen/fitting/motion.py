"""Motions with their sensitivities, at the times of measurements: in compiled code or in Python."""

import ctypes
import math
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from eomgen.base.errors import RunError
from eomgen.base.templating import render
from eomgen.codegen.backends import c, python
from eomgen.codegen.interface import Interface
from eomgen.engine.adaptive import Bounds, Progress
from eomgen.engine.embedded import DOP853
from eomgen.engine.sampled import sampled
from eomgen.engine.structures import filled
from eomgen.fitting.sensitive import MEASURED, Entries, sensitive
from eomgen.model.model import Model
from eomgen.native.accelerator import AN_OPERATION, STARTING, pays
from eomgen.native.library import compiled_library, kept_library
from eomgen.native.module import Kernels
from eomgen.run.module import load_module
from eomgen.run.problem import FloatArray
from eomgen.store import bytecode_of, interfaced_program_of, kept_text, key_of, package_digest

MAIN = "sampled.c"
MOST, MORE = 100_000, 300
"""The most derivatives of a run, and how many more for each row: a run at values far from those
sought may take endless steps."""
ATOL = 1e-2
"""Absolute tolerance, relative to rtol and the size of a state."""
_POINTER = ctypes.c_void_p


@dataclass(frozen=True, eq=False)
class Samples:
    """When a motion is looked at, and its inputs.

    t       (n,), ascending, s; the motion begins at the first
    inputs  (n, nu) at these times, between which they are linear; (1, nu) if they are constant
    """

    t: FloatArray
    inputs: FloatArray


@dataclass(frozen=True, eq=False)
class Rows:
    """A motion at n times, nan from where it cannot go on.

    states    (n, ny), and their derivatives by each of k fitted values, (n, k, ny)
    measured  (n, m), the measured quantities that are no states, and (n, k, m)
    """

    states: FloatArray
    slopes: FloatArray
    measured: FloatArray
    measured_slopes: FloatArray


class _System(ctypes.Structure):
    """`System` of `templates/c/sampled.c.jinja`."""

    _fields_ = (("k", _POINTER), ("inputs", _POINTER))


class Motion:
    """The motions of a model with their sensitivities to what `names` are; see `sensitive`.

    They are computed in Python or in compiled code, with the same bits; with "auto" as runs are:
    in compiled code if its library is in the store, or once Python has taken as long as compiling
    will. `compiled` says whether they are. Raises `RunError` with "c" if there is no compiler.
    """

    def __init__(
        self,
        model: Model,
        names: Sequence[str],
        measured: Entries,
        varying: Sequence[str],
        *,
        rtol: float,
        backend: str,
    ) -> None:
        def made() -> tuple[Any, Interface]:
            return sensitive(*interfaced_program_of(model), names, measured, varying)

        about = f"sensitivities {key_of(model)} {tuple(names)} {measured} {tuple(varying)}"
        text = kept_text(about, lambda: python.module(*made()))
        self._module: Any = load_module(text, model.name, bytecode_of(text))
        self._fitted, self._of, self._rtol = len(names), len(measured), rtol
        self._ny = len(self._module.STATES) // (1 + len(names))
        self._varies = bool(varying)
        self._places = np.array(sum(self._module.QUATERNIONS, ()), np.int64)
        self._about, self._sources = f"{about} {package_digest()}", lambda: _sources(*made())
        self._kernels: Kernels | None = None
        operations = sum(kinds["total"] for kinds in self._module.COST.values())
        self._price, self._spent = STARTING + AN_OPERATION * operations, 0.0
        if backend == "c":
            self._use(compiled_library(self._about, self._sources, MAIN))
        elif backend == "numpy":
            self._price = math.inf
        else:
            with suppress(RunError):  # no compiler
                self._use(kept_library(self._about))

    @property
    def compiled(self) -> bool:
        """Whether motions are computed in compiled code."""
        return self._kernels is not None

    def _use(self, library: ctypes.CDLL | None) -> None:
        self._kernels = Kernels(self._module, library) if library else None

    def _compile_if_it_pays(self, more: float) -> None:
        """Compile once Python has taken so long, with so much more, s."""
        self._spent += more
        if self._kernels is None and pays(self._spent, self._price):
            self._price = math.inf
            with suppress(RunError):  # no compiler
                self._use(compiled_library(self._about, self._sources, MAIN))

    def start(self, p: FloatArray, given: Mapping[int, float]) -> FloatArray:
        """The initial state with its sensitivities, (ny (1 + k),); `given` states, by their index,
        have these values, which depend on nothing that is fitted.

        Raises `ValueError` or `ArithmeticError` for parameters that the scene does not allow.
        """
        whole = self._module.initial_state(p)
        for index, value in given.items():
            whole[index :: self._ny] = 0.0
            whole[index] = value
        return np.array(whole)

    def rows(self, p: FloatArray, start: FloatArray, sizes: FloatArray, samples: Samples) -> Rows:
        """The motion from `start` at parameters p (np,); `sizes` (ny (1 + k),) are those of the
        states and sensitivities.
        """
        n, ny, many = len(samples.t), self._ny, self._fitted
        begun = time.perf_counter()
        found = np.full((n, len(start)), np.nan)
        seen = np.full((n, (1 + many) * self._of), np.nan)
        try:
            inputs = self._inputs(samples)
            self._fill(p, start, self._rtol * ATOL * sizes, samples.t, inputs, found, seen)
        except (ValueError, ArithmeticError):
            found[:] = np.nan
        self._compile_if_it_pays(time.perf_counter() - begun)
        whole = found.reshape(n, 1 + many, ny)
        own = seen.reshape(n, 1 + many, self._of)
        return Rows(whole[:, 0], whole[:, 1:], own[:, 0], own[:, 1:])

    def _inputs(self, samples: Samples) -> FloatArray:
        """The inputs of the program between times, (n - 1, nu) or more, or (1, nu)."""
        t, u = samples.t, samples.inputs
        if not self._varies:
            return np.ascontiguousarray(u[:1])
        if len(u) == 1:
            u = np.repeat(u, len(t), axis=0)
        rates = np.diff(u, axis=0) / np.diff(t)[:, None]
        varying = [i for i, name in enumerate(self._module.INPUTS) if i < u.shape[1]]
        at = {name: i for i, name in enumerate(self._module.INPUTS)}
        found = np.empty((len(rates), len(at)))
        found[:, : u.shape[1]] = u[:-1]
        for i, name in enumerate(self._module.INPUTS):
            if i in varying and (place := at.get(f"rate__{name}")) is not None:
                found[:, i] -= rates[:, i] * t[:-1]
                found[:, place] = rates[:, i]
        return found

    def _fill(
        self,
        p: FloatArray,
        start: FloatArray,
        atol: FloatArray,
        t: FloatArray,
        inputs: FloatArray,
        found: FloatArray,
        seen: FloatArray,
    ) -> None:
        """Fill the rows of states and of what is measured, as far as steps go."""
        place = _Place(self._module, self._kernels, p)
        ny, y = len(start), start.copy()
        lost, slopes = np.zeros(ny), np.zeros((len(DOP853.nodes), ny))
        found[0], slopes[0] = start, place.derivative(t[0], y, inputs[0])
        run = Bounds(atol, self._rtol, math.inf)
        at = Progress(float(t[0]), length=float(t[1] - t[0]))
        advance = place.stretch(run, at, self._places, y, lost, slopes)
        most = MOST + MORE * len(t)
        ends = range(1, len(t)) if len(inputs) > 1 or self._varies else [len(t) - 1]
        first = 1
        for number, end in enumerate(ends):
            count = end + 1 - first
            if advance(inputs[number], t[first : end + 1], found[first : end + 1], most) < count:
                break
            first = end + 1
        if self._of:
            for i in range(first):
                seen[i] = place.measured(
                    t[i], found[i], inputs[min(max(i - 1, 0), len(inputs) - 1)]
                )


class _Place:
    """Where a motion is computed at given parameters: by kernels, or by the module where these
    cannot.
    """

    def __init__(self, module: Any, kernels: Kernels | None, p: FloatArray) -> None:
        self._p = p
        self._constants = kernels.held(p) if kernels else None
        self._library = kernels.library if kernels and self._constants is not None else None
        self._derivative = module.derivative
        self._measured = getattr(module, MEASURED, None)
        if self._library is not None and kernels is not None and self._measured:
            shape = np.shape(self._measured(0.0, module.initial_state(p), p))
            self._measured = kernels.output(MEASURED, shape)

    def derivative(self, t: float, y: FloatArray, u: FloatArray) -> FloatArray:
        """The derivative. Raises `ValueError` or `ArithmeticError` if there is none."""
        return np.asarray(self._derivative(float(t), y, self._p, u))

    def measured(self, t: float, y: FloatArray, u: FloatArray) -> FloatArray:
        """What is measured, with its slopes."""
        assert self._measured is not None
        return np.asarray(self._measured(float(t), y, self._p, u))

    def stretch(
        self,
        run: Bounds,
        at: Progress,
        places: Any,
        y: FloatArray,
        lost: FloatArray,
        slopes: FloatArray,
    ) -> Any:
        """A function (inputs, times, rows, most) that goes on to the last of the times; it returns
        the number of rows that it has filled.
        """
        library, constants = self._library, self._constants
        if library is None or constants is None:
            system = _InPython(self)

            def in_python(u: FloatArray, times: FloatArray, rows: FloatArray, most: int) -> int:
                system.inputs, run.until = u, float(times[-1])
                count = len(times)
                given = (most, len(places) // 4, places, y, lost, slopes, count, times, rows)
                with np.errstate(all="ignore"):
                    return sampled(DOP853, system, run, at, *given)

            return in_python
        of = _System(ctypes.addressof(constants))
        bounds, progress = filled(run), filled(at)
        sizes = np.array([0, len(places) // 4, 0], np.int64)
        call = library.sample
        call.restype, call.argtypes = ctypes.c_int64, [_POINTER] * 10
        records, arrays = (of, bounds, progress), (sizes, places, y, lost, slopes)

        def compiled(u: FloatArray, times: FloatArray, rows: FloatArray, most: int) -> int:
            of.inputs, bounds.until = u.ctypes.data, times[-1]
            sizes[0], sizes[2] = most, len(times)
            fixed = map(ctypes.addressof, records)
            made: int = call(*fixed, *(x.ctypes.data for x in (*arrays, times, rows)))
            return made

        return compiled


class _InPython:
    """What steps in Python are given."""

    def __init__(self, place: _Place) -> None:
        self._place, self.inputs = place, np.zeros(0)

    def derivative(self, t: float, y: FloatArray) -> FloatArray:
        """The rates of the states; nan where there are none."""
        try:
            return self._place.derivative(t, y, self.inputs)
        except (ValueError, ArithmeticError):
            return np.full(len(y), np.nan)


def _sources(program: Any, interface: Interface) -> Mapping[str, str]:
    """The C sources of the kernels, and of the steps."""
    # Imported here because fits whose library is in the store do without the printer.
    from eomgen.engine.printed import c_source
    from eomgen.subset.languages import C

    context = {
        "prefix": interface.name,
        "main": c.MAIN,
        "states": len(interface.states),
        "engine": C.prelude + c_source([("sampled", {"method": DOP853})]),
    }
    main = render(c.TEMPLATES, "sampled.c.jinja", context)
    return {**c.library(program, interface), MAIN: main}
