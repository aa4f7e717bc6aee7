"""The initial state: the values that a scene gives, and defaults for the others."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from eomgen.base.errors import SceneError, listed
from eomgen.language.conditions import ROUNDING
from eomgen.model.bodies import Body, Prescribed, positions_of, velocities_of
from eomgen.model.prescribed import values_by_name
from eomgen.scene.joints.base import Coordinate
from eomgen.scene.schema import Initial


@dataclass(frozen=True)
class Start:
    """The initial `q` (nq,) and `v` (nv,), a notice for each quaternion that was scaled and each
    angle that may be in degrees, and the names of the coordinates and velocities that the scene
    gives.
    """

    q: tuple[float, ...]
    v: tuple[float, ...]
    notices: tuple[str, ...]
    given: tuple[str, ...] = ()


def initial_state(
    given: Initial, bodies: Sequence[Body], prescribed: Sequence[Prescribed]
) -> Start:
    """The initial state, with quaternions scaled to length 1.

    Raises `SceneError`, naming the location, for an unknown or `prescribed` coordinate, a list of
    the wrong length, or a quaternion of length zero.
    """
    coordinates = positions_of(bodies, prescribed)
    q = _values(given.q, coordinates, "initial.q", prescribed)
    v = _values(given.v, velocities_of(bodies, prescribed), "initial.v", prescribed)
    values = {c.name: x for c, x in zip(coordinates, q, strict=True)}
    values |= _guesses(given, coordinates, prescribed)
    plain = {c.name for c in coordinates} & set(given.q if isinstance(given.q, dict) else values)
    notices = [
        _angle_notice(c.name, x)
        for c, x in zip(coordinates, q, strict=True)
        if _far(c, x) and c.name in plain
    ]
    for body in bodies:
        if names := [c.name for c in body.positions[body.plain :]]:
            parts = [values[name] for name in names]
            notices += _length_notice(parts, names[0])
            is_given = not isinstance(given.q, dict) or any(name in given.q for name in names)
            values |= zip(names, _unit(parts, names[0], is_given), strict=True)
    names = [*_given(given.q, coordinates), *_given(given.v, velocities_of(bodies, prescribed))]
    return Start(tuple(values.values()), v, tuple(notices), tuple(names))


def _given(
    given: Sequence[float] | dict[str, float], coordinates: Sequence[Coordinate]
) -> list[str]:
    """The names of those that a list or a table gives, in order."""
    names = [c.name for c in coordinates]
    if not isinstance(given, dict):
        return names
    return [name for name in names if name in given or f"{name}_deg" in given]


def _guesses(
    given: Initial, coordinates: Sequence[Coordinate], prescribed: Sequence[Prescribed]
) -> dict[str, float]:
    """The start values of coordinates that are to be found. Raises `SceneError` for one given."""
    names, kept = _given(given.guess, coordinates), set(_given(given.q, coordinates))
    both = [name for name in names if name in kept]
    if both:
        raise SceneError(
            f"initial.guess.{both[0]}: initial.q gives it, so that it is not to be found; leave "
            "one out"
        )
    values = _values(given.guess, coordinates, "initial.guess", prescribed)
    pairs = zip((c.name for c in coordinates), values, strict=True)
    return {name: value for name, value in pairs if name in names}


def _unit(parts: Sequence[float], first: str, is_given: bool) -> list[float]:
    """A quaternion scaled to length 1; the identity if the scene does not give it.

    `first` is the name of its first component. Raises `SceneError` if a given one has length zero.
    """
    length = math.hypot(*parts)
    if length != 0.0:
        return [part / length for part in parts]
    if is_given:
        raise SceneError(
            f"initial.q: the quaternion that starts at {first} has no length; give 1, 0, 0, 0 for "
            "no rotation"
        )
    return [1.0, 0.0, 0.0, 0.0]


def _far(coordinate: Coordinate, value: float) -> bool:
    """Whether the value is an angle of more than two turns."""
    return coordinate.unit == "rad" and abs(value) > 4.0 * math.pi


def _angle_notice(name: str, value: float) -> str:
    return f"initial.q.{name}: {value:g} rad are more than two turns; for degrees write {name}_deg"


def _length_notice(parts: Sequence[float], first: str) -> list[str]:
    length = math.hypot(*parts)
    if length == 0.0 or abs(length - 1.0) <= ROUNDING:
        return []
    return [f"initial.q: the quaternion that starts at {first} has length {length:g}; scaled to 1"]


def _values(
    given: Sequence[float] | dict[str, float],
    coordinates: Sequence[Coordinate],
    location: str,
    prescribed: Sequence[Prescribed],
) -> tuple[float, ...]:
    """The values of coordinates or velocities, in order; 0 for those that a table leaves out."""
    names = [c.name for c in coordinates]
    if not isinstance(given, dict):
        if len(given) != len(names):
            raise SceneError(
                f"{location}: has {len(given)} numbers for {len(names)} coordinates; "
                f"give one each for {listed(names)}"
            )
        return tuple(float(x) for x in given)
    reasons = _reasons(prescribed)
    for key in given:
        if why := reasons.get(key) or reasons.get(key.removesuffix("_deg")):
            raise SceneError(f"{location}.{key}: {why}; leave it out")
    return tuple(
        (dict.fromkeys(names, 0.0) | values_by_name(given, coordinates, location)).values()
    )


def _reasons(prescribed: Sequence[Prescribed]) -> dict[str, str]:
    """For each prescribed coordinate and its velocity why it takes no initial value."""
    return {
        name: f"'{c.position.name}' is {'locked' if c.locked else f'driven by {c.by!r}'}"
        for c in prescribed
        for name in (c.position.name, c.velocity.name)
    }
