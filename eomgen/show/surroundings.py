"""Fixed objects in the world: planes and balls that bodies touch, and obstacles of fields."""

from collections.abc import Iterator

from eomgen.model.model import Model
from eomgen.scalars.exact import direction
from eomgen.scene.effects.contact import BodyContact
from eomgen.scene.effects.field import ForceField
from eomgen.scene.joints.base import WORLD
from eomgen.show.motion import Ball, Plane


def planes_of(model: Model) -> tuple[Plane, ...]:
    """The planes of contacts with the world, at the values of the parameters, without repeats."""
    found = (
        Plane(tuple(map(float, direction(c.normal))), model.value(c.offset))
        for c in _with_world(model, "plane")
    )
    return tuple(dict.fromkeys(found))


def balls_of(model: Model) -> tuple[Ball, ...]:
    """The balls of contacts with the world and the obstacles of fields, likewise."""
    found = [
        Ball(tuple(map(model.value, c.other_at)), model.value(c.other_radius))
        for c in _with_world(model, "ball")
    ]
    for effect in model.effects:
        if isinstance(effect, ForceField) and effect.kind == "avoid":
            assert effect.radius is not None and effect.reach is not None  # by the kind
            center = tuple(map(model.value, effect.center))
            found.append(Ball(center, model.value(effect.radius), model.value(effect.reach)))
    return tuple(dict.fromkeys(found))


def _with_world(model: Model, against: str) -> Iterator[BodyContact]:
    for effect in model.effects:
        if isinstance(effect, BodyContact) and (effect.against, effect.other) == (against, WORLD):
            yield effect
