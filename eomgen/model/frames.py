"""Points given in a body's own frame, as points from its centre of mass."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any, TypeVar

from eomgen.base.errors import SceneError
from eomgen.language.formula import Formula
from eomgen.language.rewriting import difference
from eomgen.scene.effects.base import EffectTable
from eomgen.scene.joints import Joint

AnyEffect = TypeVar("AnyEffect", bound=EffectTable)
Vector = tuple[Formula, ...]
Centres = Mapping[str, Vector]
"""For each body that has its own frame the centre of mass in it, m."""


def from_centre(point: Vector, centre: Vector | None) -> Vector:
    """A point in a body's frame, from its centre of mass; `centre` is None if it is the origin."""
    if not centre:
        return point
    return tuple(difference(r, c) for r, c in zip(point, centre, strict=True))


def joint_from_centres(joint: Joint, centres: Centres) -> Joint:
    """A joint with its points from the centres of mass of its bodies."""
    if not joint.holds:
        return joint
    return joint.replaced(
        r_parent=from_centre(joint.r_parent, centres.get(joint.parent)),
        r_child=from_centre(joint.r_child, centres.get(joint.child)),
    )


def effect_from_centres(
    effect: AnyEffect,
    given: Collection[str],
    bodies: Sequence[str],
    centres: Centres,
    location: str,
) -> AnyEffect:
    """An effect with the points that are `given`, by field, from centres of mass; those that are
    absent are there already.

    Raises `SceneError` for a point of several bodies of which one has its own frame.
    """
    fields: dict[str, Any] = {}
    for field, naming in effect.points_of.items():
        names = effect.named(naming, bodies)
        own = [name for name in names if name in centres]
        if field not in given or not own:
            continue
        if len(names) > 1:
            raise SceneError(
                f"{location}.{field}: is a point of several bodies, and '{own[0]}' has a frame of "
                "its own; name one body, or points"
            )
        fields[field] = from_centre(getattr(effect, field), centres[own[0]])
    fields |= effect.from_centres(centres)
    return effect.replaced(**fields) if fields else effect
