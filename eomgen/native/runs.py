"""Whole steps of a method in compiled code, with the bits of the same steps made in Python."""

import ctypes
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from eomgen.codegen.backends import c
from eomgen.codegen.interface import Interface
from eomgen.native import checked, equal_steps
from eomgen.native.constrained import address as where
from eomgen.native.constrained import constraints, made_margins
from eomgen.native.constrained import context as of_constraints
from eomgen.native.dop853 import constants, written_out
from eomgen.native.functions import restricted
from eomgen.native.memory import address, placed
from eomgen.native.module import Kernels, usual_constants
from eomgen.program.program import Program
from eomgen.run.compiled import Array, Constrained, EqualSteps, Steps, Stride, Watched
from eomgen.run.integrators import dormand_prince_8 as dop853
from eomgen.run.problem import Problem
from eomgen.run.projection import PROJECTS
from eomgen.templating import render

MAIN = "runs.c"
METHODS = ("dop853", *equal_steps.METHODS)
"""The methods whose steps this library makes."""
_POINTER, _WHOLE, _REAL = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double
_UNUSUAL = 2
"""What C returns before a step that Python must make."""


def sources(program: Program, interface: Interface) -> Mapping[str, str]:
    """The C sources of the derivative and of the methods that step with it."""
    program, interface = restricted(program, interface, ("derivative",))
    context = {
        "prefix": interface.name,
        "main": c.MAIN,
        "states": len(interface.states),
        "quaternions": interface.quaternions,
        **constants(written_out),
        **checked.context(),
        **of_constraints(),
    }
    main = render(c.TEMPLATES, "runs.c.jinja", context) + equal_steps.source(interface)
    return {**c.library(program, interface), MAIN: main}


class _Settings(ctypes.Structure):
    _fields_ = (
        *((name, _POINTER) for name in ("k", "u", "atol")),
        *((name, _REAL) for name in ("rtol", "longest", "t_end")),
        ("dense", _WHOLE),
        ("held", _POINTER),
    )


class _Records(ctypes.Structure):
    _fields_ = (
        *((name, _POINTER) for name in ("ends", "lengths", "states", "slopes", "losses")),
        *((name, _POINTER) for name in ("switched", "values", "terms", "margins")),
        *((name, _POINTER) for name in ("derivatives", "sampled")),
        *((name, _POINTER) for name in ("switches", "gap_checks", "times", "rows")),
        ("count", _WHOLE),
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
        self._held = 0, 0
        if self._constants is not None and self._inputs is not None:
            self._held = ctypes.addressof(self._constants), self._inputs.ctypes.data
        self._library, self._call = library, library.dop853
        self._call.restype = ctypes.c_int
        self._call.argtypes = [_POINTER, _POINTER, _WHOLE, _REAL, _REAL, *[_POINTER] * 5]

    def named(self, name: str, needed: Sequence[str] = ()) -> Steps | None:
        """The steps of a method that are checked with some functions; None if there are none for
        it, for these functions, parameters or inputs.
        """
        if self._constants is None or self._inputs is None or name != "dop853":
            return None
        if not set(needed) <= self._checks.keys():
            return None
        return self._dop853

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
        each, whole = (most,), (most, ny)
        watch, pointed = checked.watch(self._checks, watched, sizes)
        (ends, lengths, states, slopes, losses, switched, values, terms), at = placed(
            [each, each, *[whole] * 3, each, (most, watch.switching.count), (dense * most, 7, ny)]
        )
        (derivatives, sampled, switches, gap_checks), counted = placed([each] * 4, np.int64)
        rows, made = np.empty((len(times), ny)), ctypes.c_int64()
        margins = made_margins(constrained, most)
        keeps = constraints(self._checks, constrained, self._inputs, ny)
        arrays = [margins[1:], times, rows]
        to_margins, *beside = map(address, arrays)
        records = _Records(*at, to_margins, *counted, *beside, len(times))
        start = [np.ascontiguousarray(array) for array in (y, memory["f"], memory["lost"])]
        atol_at, *begun = map(address, (atol, *start))
        settings = _Settings(*self._held, atol_at, rtol, longest, t_end, dense, where(keeps))
        why = self._call(
            ctypes.byref(settings),
            ctypes.byref(watch),
            most,
            t,
            float(memory["h_abs"]),
            *begun,
            ctypes.byref(records),
            ctypes.byref(made),
        )
        del pointed, keeps
        n = made.value
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
            usual=why != _UNUSUAL,
            within=partial(_within, t, y, ends, states, terms) if dense else None,
            margins=margins[: n + 1] if constrained else None,
        )


def _within(
    t: float, y: Array, ends: Array, states: Array, terms: Array, i: int, time: float
) -> Array:
    """The state at a time in step number i of those that begin at t with the state y."""
    start, first = (float(ends[i - 1]), states[i - 1]) if i else (t, y)
    return dop853.interpolated(start, float(ends[i]) - start, first, terms[i], time)
