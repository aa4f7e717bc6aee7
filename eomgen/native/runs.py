"""Whole steps of a method in compiled code, with the bits of the same steps made in Python."""

import ctypes
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from eomgen.codegen.backends import c
from eomgen.codegen.interface import Interface
from eomgen.engine.adaptive import UNUSUAL, Bounds, Progress, Records
from eomgen.engine.embedded import DOP853
from eomgen.engine.printed import Roots, c_source
from eomgen.native import checked, equal_steps
from eomgen.native.constrained import address, constraints, made_margins
from eomgen.native.constrained import context as of_constraints
from eomgen.native.functions import restricted
from eomgen.native.module import Kernels, usual_constants
from eomgen.program.program import Program
from eomgen.run.compiled import Array, Constrained, EqualSteps, Steps, Stride, Watched
from eomgen.run.integrators.dormand_prince_8 import interpolated
from eomgen.run.problem import Problem
from eomgen.run.projection import PROJECTS
from eomgen.subset.braces import C
from eomgen.subset.structures import filled
from eomgen.templating import render

MAIN = "runs.c"
ENGINE: Roots = (("begun", {}), ("gone_on", {}))
"""What of the engine's text steps are checked with."""
METHODS = ("dop853", *equal_steps.METHODS)
"""The methods whose steps this library makes."""
_POINTER, _WHOLE, _REAL = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double


def sources(program: Program, interface: Interface) -> Mapping[str, str]:
    """The C sources of the derivative and of the methods that step with it."""
    program, interface = restricted(program, interface, ("derivative",))
    context = {
        "prefix": interface.name,
        "main": c.MAIN,
        "states": len(interface.states),
        "quaternions": interface.quaternions,
        "engine": C.prelude + c_source([*ENGINE, *equal_steps.STEPS]),
        "steps": c_source([("made_many", {"method": DOP853})]),
        **checked.context(),
        **of_constraints(),
        **equal_steps.context(interface),
    }
    main = render(c.TEMPLATES, "runs.c.jinja", context)
    return {**c.library(program, interface), MAIN: main}


class _Checks(ctypes.Structure):
    """`Checks` of `templates/c/checks.c.jinja`."""

    _fields_ = (
        *((name, _POINTER) for name in ("system", "run", "watch", "held")),
        ("now", _REAL),
        *((name, _POINTER) for name in ("margins", "switched", "values")),
        *((name, _POINTER) for name in ("switches", "gap_checks")),
    )


class CompiledSteps:
    """The compiled steps of a module at given parameters and inputs.

    The constants are those that the module computes, also where it is a perturbed one. `beside` are
    the libraries of the functions that steps are checked with, by name.
    """

    def __init__(
        self,
        module: Any,
        library: ctypes.CDLL,
        p: Any,
        u: Any,
        beside: Mapping[str, ctypes.CDLL] | None = None,
    ) -> None:
        kernels = Kernels(module, library)
        self._checks = checked.functions(module, beside or {}, p)
        self._constants = usual_constants(module, "derivative", p)
        self._inputs = kernels.given(u)
        self._states = kernels.states
        self._library, self._call = library, library.dop853
        self._call.restype, self._call.argtypes = _WHOLE, [_POINTER] * 8

    def named(self, name: str, needed: Sequence[str] = ()) -> Steps | None:
        """The steps of a method that are checked with some functions; None if there are none for
        it, for these functions, parameters or inputs.
        """
        if self._constants is None or self._inputs is None or name != "dop853":
            return None
        if not set(needed) <= self._checks.keys():
            return None
        held = ctypes.cast(self._constants, _POINTER), self._inputs.ctypes.data
        return partial(self._dop853, held)

    def equal(self, name: str, problem: Problem) -> EqualSteps | None:
        """The same for methods with equal steps."""
        if self._constants is None or self._inputs is None or name not in equal_steps.METHODS:
            return None
        if problem.projection and not set(PROJECTS) <= self._checks.keys():
            return None
        held = self._constants, self._inputs, self._checks
        return equal_steps.steps(self._library, name, *held, problem)

    def _dop853(
        self,
        held: tuple[Any, int],
        t: float,
        y: Array,
        memory: Mapping[str, float | Array],
        *,
        t_end: float,
        rtol: float,
        atol: Array,
        longest: float,
        times: Array,
        most: int,
        watched: Watched | None = None,
        sizes: Array | None = None,
        dense: bool = False,
        constrained: Constrained | None = None,
    ) -> Stride:
        """Steps of DOP853, with the arguments of `run.compiled.Steps`."""
        ny = self._states
        ends, lengths = np.empty((2, most))
        derivatives, sampled, switches, gap_checks = np.empty((4, most), np.int64)
        states, slopes, losses = np.empty((3, most, ny))
        terms, rows = np.empty((most if dense else 0, 7, ny)), np.empty((len(times), ny))
        arrays = (ends, lengths, derivatives, sampled, states, slopes, losses, terms, times, rows)
        kept = Records(*arrays, len(times), most)
        watch, pointed = checked.watch(self._checks, watched, sizes)
        switched, values = np.empty(most), np.empty((most, watch.switching.count))
        margins = made_margins(constrained, most)
        keeps = constraints(self._checks, constrained, self._inputs, ny)
        at = filled(Progress(t, length=float(memory["h_abs"])))
        system, run = equal_steps.System(*held), filled(Bounds(atol, rtol, longest, t_end, dense))
        checks = _Checks(
            *(ctypes.addressof(each) for each in (system, run, watch)),
            address(keeps),
            *(0.0, margins[1:].ctypes.data, switched.ctypes.data, values.ctypes.data),
            *(switches.ctypes.data, gap_checks.ctypes.data),
        )
        start = [np.ascontiguousarray(array) for array in (y, memory["f"], memory["lost"])]
        records = filled(kept)
        why = self._call(
            *(ctypes.addressof(each) for each in (system, checks, run, at)),
            *(array.ctypes.data for array in start),
            ctypes.addressof(records),
        )
        del pointed, keeps, records
        n: int = at.made
        passed = int(sampled[n - 1]) if n else 0
        return Stride(
            ends[:n],
            states[:n],
            {"h_abs": lengths[:n], "f": slopes[:n], "lost": losses[:n]},
            derivatives[:n],
            sampled[:n],
            rows[:passed].copy(),  # the array for all rows to come is not kept with them
            switched[:n],
            values[:n],
            switches[:n],
            gap_checks[:n],
            usual=why != UNUSUAL,
            within=partial(_within, t, y, kept) if dense else None,
            margins=margins[: n + 1] if constrained else None,
        )


def _within(t: float, y: Array, kept: Records, i: int, time: float) -> Array:
    """The state at a time in step number i of those that begin at t with the state y."""
    start, first = (float(kept.ends[i - 1]), kept.states[i - 1]) if i else (t, y)
    return interpolated(start, float(kept.ends[i]) - start, first, kept.terms[i], time)
