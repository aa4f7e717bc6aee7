"""What the loads of an effect depend on, found by running its own code over scalars that remember
nothing but what they were computed from.
"""

from collections.abc import Iterable
from typing import Any

from eomgen.language.formula import Formula, names_in
from eomgen.model.model import Model, dofs_of
from eomgen.scene.effects.base import EffectTable, JointLoad, Vector


class Traced:
    """A scalar that knows what it was computed from: "body" for the pose or the motion of a body,
    "height" of a body, "joint" for coordinates, rates and time, "state" for extra states.
    """

    def __init__(self, *sources: str) -> None:
        self.sources = frozenset(sources)

    def _with(self, other: Any) -> "Traced":
        return Traced(*self.sources, *sources_of([other]))

    __add__ = __radd__ = __sub__ = __rsub__ = _with
    __mul__ = __rmul__ = __truediv__ = __rtruediv__ = _with

    def __neg__(self) -> "Traced":
        return self


def sources_of(values: Iterable[Any]) -> frozenset[str]:
    """What any of the values depends on."""
    return frozenset(s for value in values for s in getattr(value, "sources", ()))


class _Tracing:
    """A model as effects see it, over such scalars: see `scene.effects.base.Mechanism`."""

    def __init__(self, model: Model) -> None:
        self.dimensions, self.magnitude = model.dimensions, model.magnitude
        self.bodies = tuple(body.name for body in model.bodies)
        self.masses, self.zero = {body.name: body.mass for body in model.bodies}, Traced()
        self.joints = dofs_of(model.bodies, model.dimensions)
        self._positions = {body.joint.name: body.positions for body in model.bodies}
        self._points = {point.name: point.body for point in model.points}
        moving = ("t", *(c.name for c in (*model.coordinates, *model.velocities)))
        self._names = dict.fromkeys(moving, Traced("joint"))
        self._names |= {state.name: Traced("state") for state in model.extra}

    def height(self, body: str) -> Traced:
        return Traced("height")

    def position(self, body: str, at: Vector) -> Vector:
        return (Traced("body"),) * self.dimensions

    velocity = outward = position

    def point(self, name: str) -> tuple[str, Vector]:
        return self.bodies[self._points[name]], (Traced("body"),) * self.dimensions

    def angular_velocity(self, body: str) -> Vector:
        return (Traced("body"),) * (1 if self.dimensions == 2 else 3)

    def coordinate(self, joint: str, index: int = 0) -> Traced:
        return Traced("joint")

    rate = coordinate

    def coordinate_name(self, joint: str, index: int = 0) -> str:
        return self._positions[joint][index].name

    def value(self, formula: Formula, **names: Any) -> Traced:
        known = {**self._names, **names}
        return Traced(*sources_of(known.get(name) for name in names_in(formula)))

    def input(self, name: str) -> Traced:
        return Traced()

    def number(self, value: object) -> Traced:
        return Traced()

    def state(self, name: str) -> Traced:
        return Traced("state")

    def call(self, function: str, *arguments: Any) -> Traced:
        return Traced(*sources_of(arguments))

    def called(self, letter: str, *values: Any) -> Vector:
        return values


def is_plain(effect: EffectTable, model: Model) -> bool:
    """Whether a derivation writes out an effect. Its loads on bodies depend on parameters and
    inputs alone, those at joints also on coordinates, rates and time, its energy on these and on
    heights. It has neither states nor rigid contacts.
    """
    mechanism: Any = _Tracing(model)
    if effect.states(model.dimensions) or effect.contacts(mechanism):
        return False
    at_joints, on_bodies = list[Any](), list[Any]()
    for load in effect.loads(mechanism):
        if isinstance(load, JointLoad):
            at_joints.append(load.force)
        else:
            on_bodies += (*load.force, *load.torque, *load.at)
    energy = sources_of([effect.potential_energy(mechanism)])
    return not sources_of(on_bodies) and (
        sources_of(at_joints) <= {"joint"} and energy <= {"joint", "height"}
    )
