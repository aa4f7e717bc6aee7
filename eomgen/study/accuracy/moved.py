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
from eomgen.precision.precise import constants_of, digits
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import Problem
from eomgen.study.diagnosis import problem_of

TIMES = 2.0
"""Constants that are rounded are moved by so many times that, or a unit in the last place."""
UNIT = float(np.finfo(float).eps)


def moved_problem(
    module: GeneratedModule,
    parameters: Any = None,
    inputs: Any = None,
    model: Model | None = None,
) -> Callable[[int], Problem]:
    """Gives the problem of the module moved in one way or another, by number, from the same initial
    state; each is made once, when it is first asked for.
    """
    return cache(partial(_made, module, parameters, inputs, model))


def _made(
    module: GeneratedModule, parameters: Any, inputs: Any, model: Model | None, way: int
) -> Problem:
    true = problem_of(module, parameters, inputs, model)
    twin = moved(module, parameters, way)
    return replace(problem_of(twin, parameters, inputs, model), initial=true.initial)


def moved(module: GeneratedModule, parameters: Any = None, way: int = 0) -> GeneratedModule:
    """The module with the constants that belong to some parameters moved.

    Each goes `TIMES` as far as rounding took it from its exact value, or a unit in its last place,
    whatever is more, one way or the other by chance, of which `way` is the number. Those that are
    exact stay: what steps round is not shared by runs of other steps.
    """
    given = cast(Any, module)
    with digits():
        exact = constants_of(module, parameters)
        values = given._parameters(parameters) if parameters is not None else given._DEFAULT
        random, known = np.random.default_rng(way), {}
        for name, constants in exact.items():
            for value, true in zip(values[name], constants, strict=True):
                if value not in known:
                    off = TIMES * abs(float(value - true))
                    off = max(off, UNIT * abs(value)) if off else 0.0
                    known[value] = value + float(random.choice([-1.0, 1.0])) * off
    found = {name: tuple(known[value] for value in values[name]) for name in exact}
    return _over(module, {**values, **found})


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
