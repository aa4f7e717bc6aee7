"""Fixed objects in the world: planes and balls that bodies touch, and obstacles of fields."""

from eomgen.model.model import Model
from eomgen.scene.effects import elements
from eomgen.show.effect_elements import elements_of
from eomgen.show.motion import Ball, Plane


def planes_of(model: Model) -> tuple[Plane, ...]:
    """The planes of contacts with the world, at the values of the parameters, without repeats."""
    found = (
        Plane(tuple(map(model.value, e.normal)), model.value(e.offset))
        for e in elements_of(model, 1.0)
        if isinstance(e, elements.Plane) and e.body == elements.WORLD_INDEX
    )
    return tuple(dict.fromkeys(found))


def balls_of(model: Model) -> tuple[Ball, ...]:
    """The balls of contacts with the world and the obstacles of fields, likewise."""
    found = (
        Ball(
            tuple(map(model.value, e.at)),
            model.value(e.radius),
            None if e.reach is None else model.value(e.reach),
        )
        for e in elements_of(model, 1.0)
        if isinstance(e, elements.Round) and e.body == elements.WORLD_INDEX
    )
    return tuple(dict.fromkeys(found))
