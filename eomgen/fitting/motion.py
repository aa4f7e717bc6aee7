"""Motions with their sensitivities, at the times of measurements: in compiled code or in Python."""

import ctypes
import math
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from eomgen.base.errors import RunError
from eomgen.codegen.backends import python
from eomgen.codegen.interface import Interface
from eomgen.engine.adaptive import MADE, UNUSUAL, Bounds, Progress
from eomgen.engine.adaptive_steps import Records, Start, adaptive_steps
from eomgen.engine.quaternions import normalised
from eomgen.engine.structures import with_room
from eomgen.fitting.sensitive import MEASURED, Entries, sensitive
from eomgen.model.model import Model
from eomgen.native import runs, strides
from eomgen.native.accelerator import AN_OPERATION, STARTING, pays
from eomgen.native.library import compiled_library, kept_library
from eomgen.native.mechanism import Mechanism
from eomgen.native.module import Kernels
from eomgen.run.compiled import Stretch
from eomgen.run.integrators.dormand_prince_8 import DormandPrince8
from eomgen.run.module import load_module
from eomgen.run.problem import FloatArray
from eomgen.store import bytecode_of, interfaced_program_of, kept_text, key_of, package_digest

TOGETHER = 64
"""So many steps are recorded before their records are used again."""
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
        beside = (MEASURED,) if self._of else ()
        self._about = f"{about} {package_digest()}"
        self._sources = lambda: runs.sources(*made(), beside, equal=False)
        self._kernels: Kernels | None = None
        operations = sum(kinds["total"] for kinds in self._module.COST.values())
        self._price, self._spent = STARTING + AN_OPERATION * operations, 0.0
        if backend == "c":
            self._use(compiled_library(self._about, self._sources, runs.MAIN))
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
                self._use(compiled_library(self._about, self._sources, runs.MAIN))

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
        lost = np.zeros(len(start))
        begun = Start(start.copy(), place.derivative(t[0], start, inputs[0]), lost)
        run, at = Bounds(atol, self._rtol, math.inf), Progress(float(t[0]), length=t[1] - t[0])
        steps = place.steps(run, at, begun, self._places, t[1:])
        most = MOST + MORE * len(t)
        ends = t[1:] if len(inputs) > 1 or self._varies else t[-1:]
        all(steps.go_on(float(end), u, most) for end, u in zip(ends, inputs, strict=False))
        first = 1 + steps.records.passed
        found[0], found[1:first] = start, steps.kept.rows[: first - 1]
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

    def steps(
        self, run: Bounds, at: Progress, start: Start, places: Any, times: FloatArray
    ) -> "_Steps":
        """What makes steps from a start, with rows at the times."""
        if self._library is None or self._constants is None:
            return _InPython(self, run, at, start, places, times)
        mechanism = Mechanism(many=len(places) // 4, quaternions=places.ctypes.data)
        mechanism.derivative.k = ctypes.addressof(self._constants)
        mechanism.kept = places, self._constants
        solver = SimpleNamespace(
            t=at.t, y=start.state, f=start.slope, lost=start.lost, h_abs=at.length
        )
        stretch = Stretch(
            *(solver, run.until, True, run.rtol, run.atol, run.longest, TOGETHER, False, False),
            *(times, None, None, False, None),
        )
        method = runs.method(self._library.adaptive)
        return _InC(method, mechanism, stretch)


class _Steps:
    """Steps from a start over stretches of time, by `run`, `at` and `records` of the engine; `kept`
    has the arrays of these.
    """

    run: Any
    at: Any
    records: Any
    start: Start
    kept: Records

    def go_on(self, until: float, inputs: FloatArray, most: int) -> bool:
        """Go on to a time with these inputs; false if there is no step, or after `most`
        derivatives.
        """
        self.run.until, why = until, MADE
        while self.at.t < until and why == MADE and self.at.derivatives < most:
            self.records.made = 0
            why, start, kept = self.made(inputs), self.start, self.kept
            if last := self.records.made:
                start.state[:], start.lost[:] = kept.states[last - 1], kept.losses[last - 1]
                start.slope[:] = kept.slopes[last - 1]
        return not self.at.t < until

    def made(self, inputs: FloatArray) -> int:
        """Make steps; returns why they end."""
        raise NotImplementedError


class _InC(_Steps):
    def __init__(self, method: strides.Method, of: Mechanism, stretch: Stretch) -> None:
        self._call, self._given = method.call, strides.prepared(method, of, stretch)
        given = self._given
        self.run, self.at, self.records = given.run, given.at, given.records
        self.start, self.kept = given.begun, given.kept
        self._call.restype, self._call.argtypes = ctypes.c_int64, [_POINTER] * 4

    def made(self, inputs: FloatArray) -> int:
        self._given.system.inputs = inputs.ctypes.data
        return int(self._call(*self._given.addresses))


class _InPython(_Steps):
    """Also what steps in Python are checked with: see `engine.adaptive_steps.Checks`."""

    def __init__(
        self,
        place: _Place,
        run: Bounds,
        at: Progress,
        start: Start,
        places: Any,
        times: FloatArray,
    ) -> None:
        self._place, self._places, self._inputs = place, places, np.zeros(0)
        self.run, self.at, self.start = replace(run, reaches=True), at, start
        sizes = {"STATES": len(start.state), "count": len(times), "most": TOGETHER}
        self.kept = self.records = with_room(Records, wide=0, times=times, **sizes)
        given = self._derivative, at.t, start.state, math.inf
        self._maker = DormandPrince8(*given, rtol=run.rtol, atol=run.atol)

    def made(self, inputs: FloatArray) -> int:
        self._inputs, self._maker.f = inputs, self.start.slope.copy()
        self._maker.begin()
        with np.errstate(all="ignore"):
            return adaptive_steps(self._maker, self, self.run, self.at, self.start, self.kept)

    def _derivative(self, t: float, y: FloatArray) -> FloatArray:
        """The rates of the states; nan where there are none."""
        try:
            return self._place.derivative(t, y, self._inputs)
        except (ValueError, ArithmeticError):
            return np.full(len(y), np.nan)

    def begins(self) -> None:
        """A step begins."""

    def is_usual(self) -> bool:
        """What is not is found by its states."""
        return True

    def placed(self, t: float, y: FloatArray) -> bool:
        """Normalise the quaternions of a state."""
        return normalised(len(self._places) // 4, self._places, y)

    def seen(self, at: Progress, y: FloatArray, raw: FloatArray, last: FloatArray) -> int:
        """Nothing ends a step, but it must have a slope at its end."""
        slopes = self._maker.slopes
        return MADE if slopes is not None and np.isfinite(slopes).all() else UNUSUAL

    def keeps(self, i: int, at: Progress, last: FloatArray) -> bool:
        """Each is."""
        return True
