"""Taylor series of solutions, and whole steps by them, in compiled code."""

import ctypes
from collections.abc import Mapping
from typing import Any

import numpy as np

from eomgen.codegen.backends import c
from eomgen.codegen.interface import Interface
from eomgen.errors import RunError
from eomgen.native.memory import address
from eomgen.native.taylor_source import Writer
from eomgen.program.program import Program, live_steps
from eomgen.program.series import coefficients
from eomgen.program.tape import ARITHMETIC, FUNCTIONS, Stage
from eomgen.program.taylor import NoSeriesError, Recurrences, recurrences
from eomgen.run.compiled import Array, Constrained, Series, Stride, Watched
from eomgen.run.integrators.taylor import HIGHEST, order_of
from eomgen.run.module import given_values
from eomgen.run.problem import USUAL_LENGTH
from eomgen.scalars.floats import FloatScalars
from eomgen.templating import render

MAIN = "taylor.c"
_POINTER, _WHOLE, _REAL = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double
_AT_END, _UNUSUAL = 1, 2
"""What C returns at the end of a run, and before a step that Python must make."""


def system_of(program: Program, interface: Interface) -> Recurrences:
    """The recurrences of a program. Raises `RunError` if its solutions have no Taylor series."""
    try:
        return recurrences(program, [state.name for state in interface.states])
    except NoSeriesError as function:
        raise RunError(
            f"integrator: Taylor series need smooth forces, but those of '{interface.name}' use "
            f"{function}; take --integrator DOP853"
        ) from None


def sources(program: Program, interface: Interface) -> Mapping[str, str]:
    """The C source of the series and the steps."""
    low, high = USUAL_LENGTH
    context = {
        **Writer(system_of(program, interface), [s.name for s in interface.states]).context,
        "highest": HIGHEST,
        "quaternions": interface.quaternions,
        "shortest": repr(low),
        "longest": repr(high),
    }
    return {MAIN: render(c.TEMPLATES, "taylor.c.jinja", context)}


def fixed_values(system: Recurrences, module: Any, p: Any, u: Any) -> dict[int, float]:
    """The values of the fixed steps of a system, from the constants of its module."""
    program = system.program
    constants = (module._DEFAULT if p is None else module._parameters(p))["derivative"]
    steps = program.steps

    def is_given(i: int) -> bool:
        return steps[i].operation != "constant" and steps[i].stage <= Stage.PARAMETERS

    live = live_steps(program, program.outputs["derivative"].nodes, is_given)
    values = dict(zip(filter(is_given, live), constants, strict=True))
    inputs = {**dict.fromkeys(module.INPUTS, 0.0), **given_values(module, None, u)[1]}
    for i in live_steps(program, system.fixed, values.__contains__):
        if i in values:
            continue
        operation, operands, _, value = steps[i]
        parts = [values[o] for o in operands]
        if operation == "constant":
            values[i] = float(value or 0.0)
        elif operation == "input":
            values[i] = float(inputs[str(value)])
        elif operation in FUNCTIONS:
            values[i] = FloatScalars().call(operation, *parts)
        else:
            values[i] = -parts[0] if operation == "neg" else ARITHMETIC[operation](*parts)
    return {i: values[i] for i in system.fixed}


def plain_series(program: Program, interface: Interface, module: Any, p: Any, u: Any) -> Series:
    """The series of a module at given parameters and inputs, computed by Python: slow."""
    system = system_of(program, interface)
    fixed, scalars = fixed_values(system, module, p, u), FloatScalars()
    names = [state.name for state in interface.states]

    def series(t: float, y: Array, order: int) -> Array:
        states = dict(zip(names, y.tolist(), strict=True))
        return np.array(coefficients(system, fixed, t, states, order, scalars))

    return series


class _Settings(ctypes.Structure):
    _fields_ = (
        *((name, _POINTER) for name in ("k", "atol")),
        *((name, _REAL) for name in ("rtol", "longest", "t_end")),
        ("order", _WHOLE),
    )


class _Records(ctypes.Structure):
    _fields_ = (
        *((name, _POINTER) for name in ("ends", "lengths", "states", "losses")),
        *((name, _POINTER) for name in ("derivatives", "sampled", "times", "rows")),
        ("count", _WHOLE),
    )


class CompiledTaylor:
    """The compiled series and steps of a module at given parameters and inputs."""

    def __init__(
        self, program: Program, interface: Interface, module: Any, library: ctypes.CDLL, given: Any
    ) -> None:
        values = fixed_values(system_of(program, interface), module, *given)
        self._fixed, self._states = np.array([*values.values(), 0.0]), len(interface.states)
        self._library, self._at = library, self._fixed.ctypes.data
        library.taylor_series.argtypes = [_POINTER, _REAL, *[_POINTER] * 2]
        library.taylor_steps.argtypes = [_POINTER, _WHOLE, _REAL, *[_POINTER] * 4]

    def series(self, t: float, y: Array, order: int) -> Array:
        """The Taylor coefficients (order + 1, ny) from the state y at t on."""
        rows, start = np.empty((order + 1, self._states)), np.ascontiguousarray(y)
        settings = _Settings(self._at, None, 0.0, 0.0, 0.0, order)
        self._library.taylor_series(ctypes.byref(settings), t, start.ctypes.data, rows.ctypes.data)
        return rows

    def steps(
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
        """Steps, with the arguments of `run.compiled.Steps`. None are made if they must be checked
        or keep constraints, or if states within them are wanted.
        """
        most = 0 if dense or watched or constrained or sizes is not None else most
        ny = self._states
        # Numbers and counts are parts of one array each: so there are fewer to make.
        numbers, counts = np.empty((2 + 2 * ny) * most), np.empty(2 * most, np.int64)
        at, of_counts, n = address(numbers), address(counts), 8 * most
        rows, made = np.empty((len(times), ny)), ctypes.c_int64()
        records = _Records(
            *(at, at + n, at + 2 * n, at + (2 + ny) * n, of_counts, of_counts + n),
            *(address(times), address(rows), len(times)),
        )
        settings = _Settings(self._at, address(atol), rtol, longest, t_end, order_of(rtol))
        start = [np.ascontiguousarray(array) for array in (y, memory["lost"])]
        why = self._library.taylor_steps(
            *(ctypes.byref(settings), most, t, *map(address, start)),
            *(ctypes.byref(records), ctypes.byref(made)),
        )
        ends, lengths = numbers[:most], numbers[most : 2 * most]
        states, losses = numbers[2 * most :].reshape(2, most, ny)
        derivatives, sampled = counts[:most], counts[most:]
        n = made.value
        passed = int(sampled[n - 1]) if n else 0
        return Stride(
            ends[:n],
            states[:n],
            {"h_abs": lengths[:n], "lost": losses[:n]},
            derivatives[:n],
            sampled[:n],
            rows[:passed].copy(),  # the array for all rows to come is not kept with them
            np.full(n, -np.inf),
            np.empty((n, 0)),
            np.zeros(n, np.int64),
            np.zeros(n, np.int64),
            usual=why != _UNUSUAL,
            ended=why == _AT_END,
        )
