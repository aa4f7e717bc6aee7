"""Taylor series of solutions, and whole steps by them, in compiled code."""

import ctypes
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from eomgen.base.loading import load_source
from eomgen.base.templating import render
from eomgen.codegen.backends import c
from eomgen.codegen.interface import Interface
from eomgen.codegen.series import recurrences_of, series_functions
from eomgen.engine.taylor import HIGHEST, Terms, convolved, expanded, order_of
from eomgen.native import contact_runs, strides
from eomgen.native.mechanism import Mechanism, unconstrained
from eomgen.native.mechanism import context as of_mechanism
from eomgen.program.program import Program, live_steps
from eomgen.program.tape import ARITHMETIC, FUNCTIONS, Stage
from eomgen.program.taylor import Recurrences
from eomgen.program.taylor_text import SeriesText, series_text
from eomgen.run.compiled import Array, Series, Stretch, Stride
from eomgen.run.integrators.taylor import between
from eomgen.run.module import given_values
from eomgen.scalars.floats import FloatScalars

MAIN = "taylor.c"
ENGINE = ("series_step", "expanded", "reach", "change_after", "order_of")
"""What steps call of the engine, beside what those of all methods do."""
_POINTER, _WHOLE, _REAL = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double


def sources(program: Program, interface: Interface) -> Mapping[str, str]:
    """The C source of the series and the steps."""
    # Imported here because runs whose library is in the store do without the printer.
    from eomgen.engine.printed import c_source
    from eomgen.subset.languages import VECTORS, C

    text = series_text(recurrences_of(program, interface), [s.name for s in interface.states])
    by_four = replace(C, listed="*(V *)&{first} = (V){{ {entries} }};")
    of_contacts = contact_runs.sizes(interface)
    roots = [*((name, {}) for name in ENGINE), *strides.ROOTS]
    roots += contact_runs.ROOTS if of_contacts["contacts"] else []
    context = {
        "states": len(interface.states),
        "series": text,
        "orders": HIGHEST + 1,
        "engine": C.prelude + c_source(roots),
        **of_mechanism(),
        **contact_runs.values(**of_contacts),
        "equal": False,
        "adaptive": True,
        "convolved": c_source([("convolved", {})], VECTORS),
        "of_series": series_functions(text, by_four),
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


class InPython:
    """The recurrences of a program in Python."""

    sums_of_products = staticmethod(convolved)

    def __init__(self, text: Any, fixed: list[float]) -> None:
        self._first, self._next = text.first_coefficients, text.next_coefficients
        self._fixed = fixed

    def started(self, t: float, y: Any, first: Any, rates: Any) -> None:
        self._first(t, y, self._fixed, first, rates)

    def extended(self, k: int, first: Any, *others: Any) -> None:
        self._next(k, self._fixed, first, *others)


def room_of(text: SeriesText, kind: Any = float) -> Terms:
    """Room for the series of a text, in numbers of a kind."""
    shapes = (text.first,), (text.products,), *[(HIGHEST + 1, text.products)] * 2
    first, sums, left, right = (np.zeros(shape, kind) for shape in shapes)
    return Terms(first, sums, left, right)


def plain_series(program: Program, interface: Interface, module: Any, p: Any, u: Any) -> Series:
    """The series of a module at given parameters and inputs, computed by Python."""
    system = recurrences_of(program, interface)
    text = series_text(system, [state.name for state in interface.states])
    values = list(fixed_values(system, module, p, u).values())
    of = InPython(load_source(text.source, "series"), values)
    room = room_of(text)

    def series(t: float, y: Array, order: int) -> Array:
        rows = np.empty((order + 1, len(y)))
        expanded(of, t, y, order, room, rows)
        return rows

    return series


class CompiledTaylor:
    """The compiled series and steps of a module at given parameters and inputs."""

    def __init__(
        self, program: Program, interface: Interface, module: Any, library: ctypes.CDLL, given: Any
    ) -> None:
        values = fixed_values(recurrences_of(program, interface), module, *given)
        self._fixed, self._states = np.array([*values.values(), 0.0]), len(interface.states)
        self._at = self._fixed.ctypes.data
        self._series, self._steps = library.series, library.adaptive
        self._series.argtypes = [_POINTER, _REAL, _POINTER, _WHOLE, _POINTER]
        self._mechanism = unconstrained(interface.quaternions, self._fixed)

    def series(self, t: float, y: Array, order: int) -> Array:
        """The Taylor coefficients (order + 1, ny) from the state y at t on."""
        rows, start = np.empty((order + 1, self._states)), np.ascontiguousarray(y)
        self._series(self._at, t, start.ctypes.data, order, rows.ctypes.data)
        return rows

    def steps(self, stretch: Stretch, of: Mechanism | None = None) -> Stride:
        """Steps, checked by the functions of a mechanism if they must be."""
        own = of.having(stages=self._at) if of else self._mechanism
        wide = order_of(stretch.rtol) + 1
        method = strides.Method(self._steps, ("h_abs", "lost"), (), wide, between, follows=True)
        return strides.steps(method, own, stretch)
