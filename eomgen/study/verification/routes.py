"""The other routes of a model, each compiled and loaded."""

from dataclasses import dataclass, replace

from eomgen.base.errors import EomgenError
from eomgen.codegen.choice import routes_of, why_not_compared, why_not_loops
from eomgen.codegen.system import System
from eomgen.dynamics.start.walks import with_safe_pivots
from eomgen.model.model import Model
from eomgen.pipeline import compile_program, python_module
from eomgen.run.module import GeneratedModule, load_module


@dataclass(frozen=True)
class Made:
    """A system, and the module compiled from it."""

    system: System
    module: GeneratedModule


def compiled(model: Model, but: str) -> tuple[dict[str, Made], dict[str, str]]:
    """Every route that the model admits except `but`, and the reasons why others are missing."""
    made: dict[str, Made] = {}
    missing: dict[str, str] = {}
    for route in routes_of(model):
        if route == but:
            continue
        words = why_not_compared(model, route)
        if model.constraints and not words:
            words = why_not_loops(with_safe_pivots(model), route)
        try:
            if not words:
                made[route] = loaded(
                    compile_program(replace(model, route=route), jacobian=False).system
                )
        except EomgenError as error:
            words = str(error)
        if words:
            missing[route] = words
    return made, missing


def loaded(system: System) -> Made:
    """A system, rendered as a module and loaded."""
    return Made(system, load_module(python_module(system), system.model.name))


def velocities(made: Made) -> slice:
    """The slice of v̇ in the derivative."""
    model = made.system.model
    first = len(model.state_coordinates)
    return slice(first, first + len(model.state_velocities))
