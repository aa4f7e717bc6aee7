"""A generated module whose constants are moved by what rounding may have moved them.

What a module computes once from its parameters is rounded, and every run of it shares that. The
motion of the parameters' own values differs by it, and near a separatrix or in chaos by much more
than any run's own error; two runs of one module can never tell. A run of the moved module can.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial
from types import FunctionType, ModuleType
from typing import Any, cast

import numpy as np

from eomgen.model.model import Model
from eomgen.precision.precise import digits, exact_parameters
from eomgen.program.kernel import fixed_values
from eomgen.program.program import Program
from eomgen.program.tape import Stage
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import Problem
from eomgen.scalars.extended import Bits
from eomgen.scalars.floats import FloatScalars
from eomgen.store import program_of
from eomgen.study.diagnosis import problem_of

TIMES = 2.0
"""Constants that are rounded are moved by so many times that, or a unit in the last place."""
UNIT = float(np.finfo(float).eps)


def moved_problem(
    module: GeneratedModule, model: Model, parameters: Any = None, inputs: Any = None
) -> Callable[[int], Problem]:
    """Gives the problem of a model's module moved in one way or another, by number, from the same
    initial state; each is made once, when it is first asked for.
    """
    program = cache(partial(program_of, model))
    return cache(partial(_made, module, program, model, parameters, inputs))


def _made(
    module: GeneratedModule,
    program: Callable[[], Program],
    model: Model,
    parameters: Any,
    inputs: Any,
    way: int,
) -> Problem:
    true = problem_of(module, parameters, inputs, model)
    twin = moved(module, program(), parameters, way)
    return replace(problem_of(twin, parameters, inputs, model), initial=true.initial)


def moved(
    module: GeneratedModule, program: Program, parameters: Any = None, way: int = 0
) -> GeneratedModule:
    """The module of a program with the constants that belong to some parameters moved.

    Each goes `TIMES` as far as rounding took it from its exact value, or a unit in its last place,
    whatever is more, one way or the other by chance, of which `way` is the number. Those that are
    exact stay: what steps round is not shared by runs of other steps.
    """
    given = cast(Any, module)
    own = given._parameters(parameters) if parameters is not None else given._DEFAULT
    values = {name: constants for name, constants in own.items() if isinstance(constants, tuple)}
    off = _roundings(program, module, parameters)
    random, known = np.random.default_rng(way), dict[float, float]()
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
    """A module's functions over other constants, whatever the parameters."""
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
    names["_parameters"] = lambda _: constants
    return cast(GeneratedModule, twin)
