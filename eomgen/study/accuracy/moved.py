"""A generated module whose constants are perturbed by rounding errors.

A module computes constants from its parameters and rounds them. All runs of the module share these
errors, so comparing them cannot show their effect. Near a separatrix or in chaotic motion it
exceeds a run's own error by far. A run of the perturbed module shows it.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial
from types import FunctionType, ModuleType
from typing import Any, cast

import numpy as np

from eomgen.model.model import Model
from eomgen.program.kernel import fixed_values
from eomgen.program.program import Program
from eomgen.program.tape import Stage
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import FloatArray, Problem
from eomgen.scalars.extended import Bits
from eomgen.scalars.floats import FloatScalars
from eomgen.store import program_of
from eomgen.study.diagnosis import problem_of
from eomgen.study.precision.precise import digits, exact_parameters

TIMES = 2.0
"""Rounded constants are moved by this many times their rounding error, or by a unit in the last
place."""
UNIT = float(np.finfo(float).eps)


def moved_problem(
    module: GeneratedModule,
    model: Model,
    parameters: Any = None,
    inputs: Any = None,
    *,
    start: FloatArray | None = None,
    compiled: Callable[[Problem, GeneratedModule], Problem] | None = None,
) -> Callable[[int], Problem]:
    """A function that gives, by number, the problem of a model's module with constants perturbed in
    one of several patterns of signs, from the same initial state. Each problem is made once.

    start     the initial state, (ny,); None for that of the module
    compiled  adds compiled steps to a problem and its perturbed module
    """
    program = cache(partial(program_of, model))
    made = partial(_made, module, program, model, parameters, inputs, start, compiled)
    return cache(made)


def _made(
    module: GeneratedModule,
    program: Callable[[], Program],
    model: Model,
    parameters: Any,
    inputs: Any,
    start: FloatArray | None,
    compiled: Callable[[Problem, GeneratedModule], Problem] | None,
    seed: int,
) -> Problem:
    if start is None:
        start = problem_of(module, parameters, inputs, model).initial
    twin = moved(module, program(), parameters, seed)
    problem = replace(problem_of(twin, parameters, inputs, model), initial=start)
    return compiled(problem, twin) if compiled else problem


def moved(
    module: GeneratedModule, program: Program, parameters: Any = None, seed: int = 0
) -> GeneratedModule:
    """The module of a program with the constants that belong to some parameters perturbed.

    Each constant is moved by `TIMES` its rounding error or by a unit in its last place, whichever
    is more. The signs are random, from `seed`. Exact constants stay. Rounding errors of
    the steps need no perturbation: runs with other steps do not share them.
    """
    given = cast(Any, module)
    own = given._parameters(parameters) if parameters is not None else given._DEFAULT
    values = {name: constants for name, constants in own.items() if isinstance(constants, tuple)}
    off = _roundings(program, module, parameters)
    random, known = np.random.default_rng(seed), dict[float, float]()
    for value in (value for constants in values.values() for value in constants):
        if value not in known:
            distance = off.get(value, 0.0)
            known[value] = value + float(random.choice([-1.0, 1.0])) * distance
    found = {name: tuple(known[value] for value in constants) for name, constants in values.items()}
    return _over(module, {**own, **found})


def _roundings(program: Program, module: GeneratedModule, parameters: Any) -> dict[float, float]:
    """How far each value that depends on parameters alone is to be moved."""
    steps = [i for i, step in enumerate(program.steps) if step.stage <= Stage.PARAMETERS]
    with digits():
        given = exact_parameters(module, parameters)
        exact = fixed_values(program, steps, given, Bits())
        rounded = fixed_values(
            program, steps, {name: float(x) for name, x in given.items()}, FloatScalars()
        )
        found: dict[float, float] = {}
        for i, value in rounded.items():
            distance = TIMES * abs(float(value - exact[i]))
            if distance:
                distance = max(distance, UNIT * abs(value))
            found[value] = max(found.get(value, 0.0), distance)
    return found


def _over(module: GeneratedModule, constants: Mapping[str, Any]) -> GeneratedModule:
    """The module's functions with other constants, which no longer depend on the parameters."""
    original = cast(ModuleType, module)
    twin = ModuleType(original.__name__)
    names = twin.__dict__
    names.update(original.__dict__)
    for name, value in original.__dict__.items():
        if isinstance(value, FunctionType) and value.__globals__ is original.__dict__:
            names[name] = FunctionType(
                value.__code__, names, name, value.__defaults__, value.__closure__
            )
    names["_DEFAULT"], names["_DERIVATIVE"] = constants, constants["derivative"]
    names["_parameters"] = lambda *_: constants
    return cast(GeneratedModule, twin)
