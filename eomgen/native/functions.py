"""Single functions of a module in compiled code, for runs whose steps are made in Python.

They return the bits of the module's own functions, so that a run may change over to them at any
call. What they do not compute, such as a value that overflows, the module does.
"""

import ctypes
import math
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from eomgen.codegen.backends import c_directions
from eomgen.codegen.interface import Interface
from eomgen.native.beside import impact_numbers
from eomgen.native.module import Kernels, outputs_of, usual_constants
from eomgen.program.program import Program
from eomgen.run.problem import FloatArray, Problem

PROJECTION = {
    "residuals": "constraint_residuals",
    "rates": "constraint_rates",
    "jacobian": "constraint_jacobian",
    "position": "project_position",
    "velocity": "project_velocity",
    "margins": "constraint_margins",
    "inertia": "mass_matrix",
    "kinetic_slopes": "kinetic_slopes",
}
"""The functions of a module by the fields of its `Projection`."""
Value = Callable[..., FloatArray]
"""A function of time, state and further arguments, such as the derivative."""
Look = Callable[[float], ctypes.CDLL | None]
"""Returns the library of a function if it is there, or is compiled now because calls in Python have
taken long enough; it is told how much longer they have, s."""

INTERVAL = 5e-3
"""Time in Python, s, after which a library is asked for again."""

_POINTER, _REAL = ctypes.c_void_p, ctypes.c_double


def restricted(
    program: Program, interface: Interface, names: Iterable[str]
) -> tuple[Program, Interface]:
    """A program and its interface with some of the outputs only."""
    outputs = {name: program.outputs[name] for name in names}
    functions = tuple(f for f in interface.functions if f.name in outputs)
    return replace(program, outputs=outputs), replace(interface, functions=functions)


def sources(program: Program, interface: Interface, name: str) -> Mapping[str, str]:
    """The C sources of the library of one function."""
    return c_directions.library(*restricted(program, interface, (name,)))


def compiled_function(
    module: Any, library: ctypes.CDLL, name: str, p: Any, u: Any, *, origin: Any = None
) -> Callable[..., FloatArray | None] | None:
    """A function (t, y, extra) at given parameters and inputs, which returns None for what the
    module must compute. None if that is all.

    origin  the module that had the constants of its parameters, if this one has perturbed ones

    The library must have no other function.
    """
    kernels = Kernels(module, library)
    constants, inputs = constants_of(kernels, name, p, origin), kernels.given(u)
    if constants is None or inputs is None:
        return None
    shape = outputs_of(library)[name]
    call, given, buffer = library[f"checked_{name}"], inputs.tobytes(), _REAL * math.prod(shape)
    call.argtypes = [_REAL, *[_POINTER] * 5]

    def value(t: float, y: FloatArray, extra: FloatArray | None = None) -> FloatArray | None:
        out = buffer()
        beside = None if extra is None else extra.tobytes()
        if not call(t, y.tobytes(), constants, given, beside, out):
            return None
        return np.frombuffer(memoryview(out)).reshape(shape)

    return value


def constants_of(kernels: Kernels, name: str, p: Any, origin: Any = None) -> Any:
    """The constants of the only function of a library, a C array; None if it cannot be used.

    origin  the module that had the constants of its parameters, if that of the kernels has
            perturbed ones
    """
    constants = usual_constants(kernels.module, name, p)
    if constants is None or len(constants) == max(1, kernels.constants):
        return constants
    # The module computes it in two parts, as Jacobians along directions.
    held = kernels.held(p)
    if not origin or held is None:
        return held
    true = usual_constants(origin, name, p)
    moved = {} if true is None else dict(zip(true, constants, strict=True))
    if not moved.keys() >= set(held):
        return None
    return type(held)(*(moved[value] for value in held))


@dataclass(frozen=True)
class Compilable:
    """What compiles single functions of a module, at given parameters and inputs.

    origin   the module that had the constants of its parameters, if this one has perturbed ones
    look     for the name of a function: see `Look`
    started  called when a compiled function is used for the first time
    """

    module: Any
    values: tuple[Any, Any]
    origin: Any
    look: Callable[[str], Look]
    started: Callable[[], None]

    def problem(self, problem: Problem) -> Problem:
        """The same problem; its functions are compiled once that pays."""
        contacts, switching = problem.contacts, problem.switching
        if contacts is not None:
            contacts = replace(
                contacts,
                gaps=self.function("gaps", contacts.gaps),
                rates=self.function("gap_rates", contacts.rates),
                held=self.function("held", contacts.held, np.asarray),
                impact=self.function(
                    "impact", contacts.impact, partial(impact_numbers, len(contacts.names))
                ),
            )
        if switching is not None and switching.of_state is not None:
            of_state = self.function("switching_functions", switching.of_state)
            switching = replace(switching, of_state=of_state)
        projection = problem.projection
        if projection is not None:
            made: dict[str, Any] = {
                field: self.function(name, getattr(projection, field))
                for field, name in PROJECTION.items()
                if hasattr(self.module, name)
            }
            projection = replace(projection, **made)
        implicit_step = problem.implicit_step
        if implicit_step is not None:
            implicit_step = self.function("implicit_step", implicit_step, np.atleast_1d)
        jacobian = problem.jacobian
        if hasattr(self.module, "jacobian"):
            jacobian = self.function("jacobian", jacobian)
        return replace(
            problem,
            derivative=self.function("derivative", problem.derivative),
            jacobian=jacobian,
            contacts=contacts,
            switching=switching,
            projection=projection,
            implicit_step=implicit_step,
        )

    def function(
        self, name: str, python: Value, extra: Callable[..., FloatArray] | None = None
    ) -> Value:
        """A function that Python computes until its library is there.

        `extra` makes the kernel's further numbers from the arguments after time and state.
        """
        look, spent, due = self.look(name), 0.0, 0.0  # the time since the last look, s
        compiled: Callable[..., FloatArray | None] | None = None

        def value(t: float, y: FloatArray, *more: Any) -> FloatArray:
            nonlocal compiled, due, spent
            if compiled is not None:
                found = compiled(t, y, *((extra(*more),) if extra else ()))
                return python(t, y, *more) if found is None else found
            if spent >= due:
                library = look(spent)
                due, spent = INTERVAL, 0.0
                if library is not None:
                    compiled = compiled_function(
                        self.module, library, name, *self.values, origin=self.origin
                    )
                    if compiled is not None:
                        self.started()
                        return value(t, y, *more)
                    due = math.inf
            begun = time.perf_counter()
            result = python(t, y, *more)
            spent += time.perf_counter() - begun
            return result

        return value
