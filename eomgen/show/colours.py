"""Colours of bodies to which the scene gives none: distinct, and readable on light and dark."""

from eomgen.model.model import Model

BODIES = (
    "#4c86b8",
    "#ef7b45",
    "#f2b632",
    "#5fa777",
    "#a678b0",
    "#d1605e",
    "#6cb6c9",
    "#b58b5a",
)


def body_colours(model: Model) -> tuple[str, ...]:
    """A colour for each body; a body that is welded to another has the same.

    Many bodies go through the colours gradually, so that neighbours in a chain are alike.
    """
    moving = [k for k, body in enumerate(model.bodies) if body.parent < 0 or body.velocities]
    shades = _ramp(len(moving))
    own = dict(zip(moving, shades, strict=True))
    found: list[str] = []
    for k, body in enumerate(model.bodies):
        found.append(own[k] if k in own else found[body.parent])
    return tuple(found)


def shade(colour: str, share: float = 0.3) -> str:
    """A darker colour: mixed with `share` parts of a dark blue."""
    return blend(colour, "#1d2b38", share)


def blend(one: str, other: str, share: float) -> str:
    """A mixture of two colours, with `share` parts of the other."""
    pairs = zip(_parts(one), _parts(other), strict=True)
    return "#" + "".join(f"{round((1 - share) * a + share * b):02x}" for a, b in pairs)


def _parts(colour: str) -> list[int]:
    return [int(colour[k : k + 2], 16) for k in (1, 3, 5)]


def _ramp(count: int) -> list[str]:
    if count <= len(BODIES):
        return list(BODIES[:count])
    last = len(BODIES) - 1
    found = []
    for i in range(count):
        place = i * last / (count - 1)
        k = min(int(place), last - 1)
        found.append(blend(BODIES[k], BODIES[k + 1], place - k))
    return found
