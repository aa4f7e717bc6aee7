"""Points given in a body's own frame, as points from its centre of mass."""

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any, TypeVar

from eomgen.errors import SceneError
from eomgen.language.formula import ZERO, Apply, Constant, Formula
from eomgen.scene.effects import BodyContact
from eomgen.scene.effects.base import EffectTable
from eomgen.scene.joints import Free, Joint

AnyEffect = TypeVar("AnyEffect", bound=EffectTable)
Vector = tuple[Formula, ...]
Centres = Mapping[str, Vector]
"""For each body that has its own frame the centre of mass in it, m."""


def from_centre(point: Vector, centre: Vector | None) -> Vector:
    """A point in a body's frame, from its centre of mass; `centre` is None if it is the origin."""
    if not centre:
        return point
    return tuple(_difference(r, c) for r, c in zip(point, centre, strict=True))


def joint_from_centres(joint: Joint, centres: Centres) -> Joint:
    """A joint with its points from the centres of mass of its bodies."""
    if isinstance(joint, Free):
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
    if isinstance(effect, BodyContact) and effect.against == "plane" and effect.other in centres:
        fields["offset"] = _offset(effect, centres[effect.other])
    return effect.replaced(**fields) if fields else effect


def _offset(contact: BodyContact, centre: Vector) -> Formula:
    """The offset of a plane, which its own frame gives, from the centre of mass."""
    normal = contact.normal or tuple(float(i == len(centre) - 1) for i in range(len(centre)))
    length = math.hypot(*normal)
    offset = contact.offset
    for n, c in zip(normal, centre, strict=True):
        if n:
            offset = _difference(
                offset, c if n == length else Apply("*", (Constant(n / length), c))
            )
    return offset


def _difference(a: Formula, b: Formula) -> Formula:
    """a - b, without terms that are 0."""
    if b == ZERO:
        return a
    if a == b:
        return ZERO
    return Apply("neg", (b,)) if a == ZERO else Apply("-", (a, b))
