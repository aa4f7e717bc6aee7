"""What the loads of an effect depend on, found by running its own code over scalars that remember
nothing but what they were computed from.
"""

from collections.abc import Iterable
from functools import cached_property
from typing import Any

from eomgen.model.model import Model
from eomgen.model.named import NamedModel
from eomgen.scalars.protocol import Scalars
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


class _Tracing(Scalars):
    """Such scalars."""

    def number(self, value: object) -> Traced:
        return Traced()

    def call(self, function: str, *arguments: Any) -> Traced:
        return Traced(*sources_of(arguments))


class _Traced(NamedModel):
    """A model over such scalars."""

    @cached_property
    def names(self) -> dict[str, Traced]:
        model = self.model
        fixed = [*(p.name for p in model.parameters), *(i.name for i in model.inputs)]
        moving = ("t", *(c.name for b in model.bodies for c in (*b.positions, *b.velocities)))
        return {
            **dict.fromkeys(fixed, Traced()),
            **dict.fromkeys(moving, Traced("joint")),
            **{state.name: Traced("state") for state in model.extra},
        }

    def height(self, body: str) -> Traced:
        return Traced("height")

    def position(self, body: str, at: Vector) -> Vector:
        return (Traced("body"),) * self.dimensions

    velocity = outward = position

    def point(self, name: str) -> tuple[str, Vector]:
        body, _ = super().point(name)
        return body, (Traced("body"),) * self.dimensions

    def angular_velocity(self, body: str) -> Vector:
        return (Traced("body"),) * (1 if self.dimensions == 2 else 3)


def is_plain(effect: EffectTable, model: Model) -> bool:
    """Whether a derivation writes out an effect. Its loads on bodies depend on parameters and
    inputs alone, those at joints also on coordinates, rates and time, its energy on these and on
    heights. It has neither states nor rigid contacts.
    """
    mechanism = _Traced(model, _Tracing())
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
