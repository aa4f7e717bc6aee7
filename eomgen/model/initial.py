"""The state at the start: what a scene gives of it, and what stands for the rest."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from eomgen.errors import SceneError, listed
from eomgen.language.conditions import ROUNDING
from eomgen.model.model import Body, Prescribed, positions_of, velocities_of
from eomgen.model.prescribed import values_by_name
from eomgen.scene.joints.base import Coordinate
from eomgen.scene.schema import Initial


@dataclass(frozen=True)
class Start:
    """The initial `q` (nq,) and `v` (nv,), and a line for each thing that was put right."""

    q: tuple[float, ...]
    v: tuple[float, ...]
    notices: tuple[str, ...]


def initial_state(
    given: Initial, bodies: Sequence[Body], prescribed: Sequence[Prescribed]
) -> Start:
    """The state at the start, its quaternions of length 1.

    Raises `SceneError`, naming the place, for names that are not there or `prescribed`, lists that
    are too long or too short, and a quaternion of no length.
    """
    coordinates = positions_of(bodies, prescribed)
    q = _values(given.q, coordinates, "initial.q", prescribed)
    v = _values(given.v, velocities_of(bodies, prescribed), "initial.v", prescribed)
    values = {c.name: x for c, x in zip(coordinates, q, strict=True)}
    notices = []
    for body in bodies:
        if names := [c.name for c in body.positions[body.plain :]]:
            parts = [values[name] for name in names]
            notices += _length_noticed(parts, names[0])
            reported = not isinstance(given.q, dict) or any(name in given.q for name in names)
            values |= zip(names, _unit(parts, names[0], reported), strict=True)
    return Start(tuple(values.values()), v, tuple(notices))


def _unit(parts: Sequence[float], first: str, reported: bool) -> list[float]:
    """A quaternion scaled to length 1; 1, 0, 0, 0 where the scene has not `reported` it.

    `first` is the name of its first part. Raises `SceneError` for one of no length.
    """
    length = math.hypot(*parts)
    if length != 0.0:
        return [part / length for part in parts]
    if reported:
        raise SceneError(
            f"initial.q: the quaternion from {first} on has no length; give 1, 0, 0, 0 for no turn"
        )
    return [1.0, 0.0, 0.0, 0.0]


def _length_noticed(parts: Sequence[float], first: str) -> list[str]:
    length = math.hypot(*parts)
    if length == 0.0 or abs(length - 1.0) <= ROUNDING:
        return []
    return [f"initial.q: the quaternion from {first} on has length {length:g}; scaled to 1"]


def _values(
    given: Sequence[float] | dict[str, float],
    coordinates: Sequence[Coordinate],
    location: str,
    prescribed: Sequence[Prescribed],
) -> tuple[float, ...]:
    """The values of coordinates or velocities, in order: 0 for what a table does not name."""
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
    """Why each coordinate or velocity that is no state has no initial value."""
    return {
        name: f"'{c.position.name}' is {'locked' if c.locked else f'driven by {c.by!r}'}"
        for c in prescribed
        for name in (c.position.name, c.velocity.name)
    }
