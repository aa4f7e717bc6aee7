"""The equations of a model by a route, ready to be recorded."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from eomgen.codegen.from_recursion import Recording, from_recursion
from eomgen.codegen.system import System
from eomgen.derivation.supported import why_not_closed, why_not_pins
from eomgen.dynamics.kinematics import Axes
from eomgen.errors import SceneError
from eomgen.model.model import Model
from eomgen.program.passes import optimise
from eomgen.program.program import Output, Program, cost, finish
from eomgen.routes import ROUTES


@dataclass(frozen=True)
class Derived:
    """A route's equations: what `record` makes a system of, whole, with the Jacobian or without.

    Of a recursion they lie on a tape as far as v̇ already, `alone` being the optimised program of
    the derivative and nothing else, and `axes` those that it works in. Of SymPy both are None.
    """

    route: str
    recorder: Callable[..., System]
    alone: Program | None = None
    axes: Axes | None = None


def derive(model: Model, route: str) -> Derived:
    """The equations of a model by a route.

    By a recursion they are in the axes that take the fewest operations. In the plane those are the
    world's, in which angles add up, unless bodies that turn carry slides; in space they are the
    frames' own.

    Raises `SceneError` if the route is not for the model.
    """
    if why_not := why_not_derived(model, route):
        raise SceneError(why_not)
    if ROUTES[route].symbolic:
        return _symbolic(model)
    return min((_recursive(model, route, axes) for axes in _axes(model, route)), key=_operations)


def record(derived: Derived, *, jacobian: bool = True) -> System:
    """All outputs on a tape, no pass run over it; with the derivative's Jacobian or without."""
    return derived.recorder(jacobian=jacobian)


def why_not_derived(model: Model, route: str) -> str:
    """What keeps a model from a route, naming key and remedy; "" if nothing does."""
    velocity = model.form == "velocity"
    if not velocity and not ROUTES[route].symbolic:
        return (
            f"route: '{route}' is for form = 'velocity'; the form '{model.form}' comes from the "
            "closed form"
        )
    why_not = ""
    if ROUTES[route].symbolic:
        why_not = why_not_closed(model) if velocity else why_not_pins(model)
    asked = f"route: '{route}'" if velocity else f"form: '{model.form}'"
    return f"{asked} needs the closed form, and {why_not}; leave it out" if why_not else ""


def _symbolic(model: Model) -> Derived:
    # Imported here because SymPy takes longer to load than everything else together.
    if why_not_pins(model):
        from eomgen.codegen.from_projected import from_projected
        from eomgen.derivation.projected.derive import derive_projected

        return Derived("closed", partial(from_projected, derive_projected(model)))
    from eomgen.codegen.from_equations import from_equations
    from eomgen.derivation import closed

    return Derived("closed", partial(from_equations, closed.derive(model)))


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
    recorder = partial(from_recursion, recording)
    return Derived(route, recorder, alone, recording.dynamics.axes)


def _operations(derived: Derived) -> int:
    assert derived.alone is not None
    return cost(derived.alone, "derivative")["total"]
