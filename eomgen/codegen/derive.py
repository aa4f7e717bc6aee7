"""Derivation of a model's equations by a route."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from eomgen.base.errors import SceneError
from eomgen.codegen.from_recursion import from_recursion
from eomgen.codegen.recording import Recording
from eomgen.codegen.stand_ins import with_stand_ins
from eomgen.codegen.system import System
from eomgen.derivation.supported import why_not_closed, why_not_momenta, why_not_pins
from eomgen.dynamics.tree.kinematics import Axes
from eomgen.model.model import Model
from eomgen.program.passes import optimise
from eomgen.program.program import Output, Program, cost, finish
from eomgen.tables.routes import ROUTES


@dataclass(frozen=True)
class Derived:
    """A model's equations by a route.

    recorder  makes the system of all outputs, with or without the Jacobian; see `record`
    alone     the optimised program of the derivative and nothing else; None for a symbolic route
    every     of a model with groups, a program of all accelerations
    axes      the axes in which the recursion works; None for a symbolic route
    """

    route: str
    recorder: Callable[..., System]
    alone: Program | None = None
    axes: Axes | None = None
    every: Program | None = None


def derive(model: Model, route: str) -> Derived:
    """The equations of a model by a route.

    A recursion works in the axes that take the fewest operations: in space the body axes; in the
    plane the world's, in which angles add up, or the body axes where rotating bodies carry
    prismatic joints.

    Raises `SceneError` if the route does not apply to the model.
    """
    if why_not := why_not_derived(model, route):
        raise SceneError(why_not)
    if ROUTES[route].symbolic:
        return _symbolic(model)
    return min((_recursive(model, route, axes) for axes in _axes(model, route)), key=_operations)


def record(derived: Derived, *, jacobian: bool = True) -> System:
    """The system of all outputs, with or without the Jacobian of the derivative, not optimised."""
    return derived.recorder(jacobian=jacobian)


def why_not_derived(model: Model, route: str) -> str:
    """Why a route does not apply to a model, with key and remedy; "" if it does."""
    if ROUTES[route].loops and not model.constraints:
        return f"route: '{route}' is for mechanisms with loops, and there are none; leave it out"
    if ROUTES[route].trees and model.constraints:
        return f"route: '{route}' is for mechanisms without loops, and there are some; leave it out"
    velocity = model.form == "velocity"
    if not velocity and not ROUTES[route].symbolic:
        return (
            f"route: '{route}' is for form = 'velocity'; the form '{model.form}' comes from the "
            "closed form"
        )
    why_not = ""
    if ROUTES[route].symbolic:
        why_not = why_not_closed(model) if velocity else why_not_momenta(model)
    asked = f"route: '{route}'" if velocity else f"form: '{model.form}'"
    return f"{asked} needs the closed form, and {why_not}; leave it out" if why_not else ""


def _symbolic(model: Model) -> Derived:
    # Imported here because SymPy takes longer to load than all other modules together.
    from eomgen.codegen.from_closed_form import from_closed_form, of_pins, of_projected
    from eomgen.codegen.from_equations import from_equations
    from eomgen.derivation.handout import closed
    from eomgen.derivation.projected.derive import derive_projected

    derived, _ = with_stand_ins(model)
    if why_not_pins(derived):
        form = of_projected(derive_projected(derived))
    elif derived is model:
        return Derived("closed", partial(from_equations, closed.derive(model)))
    else:
        form = of_pins(closed.derive(derived))
    return Derived("closed", partial(from_closed_form, form, model))


def _axes(model: Model, route: str) -> list[Axes | None]:
    slides = (
        primitive.kind == "prismatic"
        for body in model.bodies
        if body.parent >= 0
        for primitive in body.joint.primitives(2)
    )
    both = not ROUTES[route].frame_axes and model.dimensions == 2 and any(slides)
    return [None, "own"] if both else [None]


def _recursive(model: Model, route: str, axes: Axes | None) -> Derived:
    recording = Recording(model, route, axes=axes)
    nodes = tuple(node.index for node in recording.rates)
    outputs = {"derivative": Output((len(nodes),), nodes)}
    alone = optimise(finish(recording.tape, outputs, ()))
    every = None
    if model.groups:
        found = tuple(node.index for node in recording.closed(recording.vd))
        every = finish(recording.tape, {"derivative": Output((len(found),), found)}, ())
    recorder = partial(from_recursion, recording)
    return Derived(route, recorder, alone, recording.dynamics.axes, every)


def _operations(derived: Derived) -> int:
    assert derived.alone is not None
    return cost(derived.alone, "derivative")["total"]
