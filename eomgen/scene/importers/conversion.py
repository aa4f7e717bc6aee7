"""States of a generated module as those of another program, and back."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from eomgen.base.errors import RunError
from eomgen.scene.importers.conventions import Convention, Frame, JointStates

Array = npt.NDArray[np.float64]


def conversion(convention: Convention, module: Any) -> "Conversion":
    """The conversion of a loaded module's states.

    Raises `RunError` if the module is of another robot or state form, or the other program's robot
    moves otherwise.
    """
    if convention.obstacle:
        raise RunError(f"{convention.program}: {convention.obstacle}")
    known = {*getattr(module, "STATES", ()), *getattr(module, "FOLLOWING", ())}
    for name in (*convention.positions, *convention.velocities):
        if name not in known:
            raise RunError(
                f"{convention.program}: the module has no '{name}'; give a loaded module of this "
                "robot, of form 'velocity'"
            )
    return Conversion(convention, module)


@dataclass(frozen=True)
class Conversion:
    """States of a generated module as another program's coordinates q and velocities v, and back.

    Numbers are in SI units. Several states at once are the columns of arrays, as in the module.
    """

    convention: Convention
    module: Any

    def state(self, q: npt.ArrayLike, v: npt.ArrayLike, **others: float) -> Array:
        """The state y of the module, (ny,), at q, (nq,), and v, (nv,).

        What is held, or follows from the state in closed form, is not taken from q and v.
        Quaternions are scaled to length 1. `others` are states of controllers by name; without one
        it is as at the start. Raises `RunError` for another number of numbers, or an unknown name.
        """
        joints, given = self.convention.joints, np.asarray(q, dtype=float)
        left_q = _columns(given, sum(joint.nq for joint in joints), "q")
        left_v = _columns(v, sum(len(joint.velocities) for joint in joints), "v")
        start = _named(self.module.STATES, _columns(self.module.initial_state()))
        moving = {*self.convention.positions, *self.convention.velocities}
        found: dict[str, Any] = dict(others)
        for name in found:
            if name not in start or name in moving:
                raise RunError(f"state: '{name}' is no state beside coordinates and velocities")
        for joint in joints:
            own_q, left_q = np.split(left_q, [joint.nq])
            own_v, left_v = np.split(left_v, [len(joint.velocities)])
            own_q, own_v = FRAMES[joint.frame].inwards(own_q, own_v, self._com(joint))
            found |= _named(joint.positions, own_q) | _named(joint.velocities, own_v)
        still = np.zeros(left_q.shape[1])
        rows = [found.get(name, value) + still for name, value in start.items()]
        return np.array(rows).reshape(-1, *given.shape[1:])

    def position(self, y: npt.ArrayLike) -> Array:
        """q, (nq,), at a state of the module."""
        return self._outwards(y)[0]

    def velocity(self, y: npt.ArrayLike) -> Array:
        """v, (nv,), at a state of the module."""
        return self._outwards(y)[1]

    def acceleration(self, t: float, y: npt.ArrayLike, u: Any = None) -> Array:
        """The rate of v, (nv,), at time t and a state of the module, with its inputs u."""
        module, names = self.module, self.convention.velocities
        if {*names} <= {*module.STATES}:
            rates = _named(module.STATES, _columns(module.derivative(t, y, None, u)))
        else:
            rates = _named(names, _columns(module.accelerations(t, y, None, u)))
        return self._outwards(y, rates)[2]

    def _com(self, joint: JointStates) -> Array:
        """The centre of mass of a free body, (3, 1), as the module has it."""
        known = self.module.PARAMETERS
        names = (f"{joint.body}_com_{axis}" for axis in "xyz")
        return np.array([[known.get(name, x)] for name, x in zip(names, joint.com, strict=True)])

    def _outwards(
        self, y: npt.ArrayLike, rates: Mapping[str, Array] | None = None
    ) -> tuple[Array, ...]:
        """q, v and, from rates of the velocities by name, v̇; without these v̇ is that at rest."""
        given, state = self.convention, np.asarray(y, dtype=float)
        columns = _columns(state, len(self.module.STATES), "y")
        still = np.zeros(columns.shape[1])
        values = _named(self.module.STATES, columns)
        if not {*given.positions} <= {*values}:
            values |= _named(given.positions, _columns(self.module.coordinates(0.0, state)))
            values |= _named(given.velocities, _columns(self.module.velocities(0.0, state)))
        values |= {name: x + still for name, x in given.held.items()}
        found = list[tuple[Array, ...]]()
        for joint in given.joints:
            q = np.array([values[name] for name in joint.positions])
            v = np.array([values.get(name, still) for name in joint.velocities])
            a = np.array([(rates or {}).get(name, still) for name in joint.velocities])
            found.append(FRAMES[joint.frame].outwards(q, v, a, self._com(joint)))
        wholes = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return tuple(whole.reshape(-1, *state.shape[1:]) for whole in wholes)


def _named(names: Iterable[str], values: Array) -> dict[str, Array]:
    return dict(zip(names, values, strict=True))


def _columns(values: npt.ArrayLike, count: int | None = None, what: str = "") -> Array:
    """An array with a column for each state. Raises `RunError` unless it has `count` rows."""
    array = np.asarray(values, dtype=float)
    if count is not None and (array.ndim not in (1, 2) or len(array) != count):
        raise RunError(
            f"{what}: has the shape {array.shape}; give ({count},), or columns ({count}, k)"
        )
    return array.reshape(len(array), -1)


# Frames. Arrays have a column for each state.


class _Change(NamedTuple):
    """How a joint's numbers become those of the other program, and back.

    outwards  q, v, v̇ of the other program by those of the scene and the centre of mass
    inwards   q and v of the scene by those of the other program
    """

    outwards: Callable[[Array, Array, Array, Array], tuple[Array, Array, Array]]
    inwards: Callable[[Array, Array, Array], tuple[Array, Array]]


def _world(q: Array) -> Array:
    """The rotation (3, 3, k) of the quaternion w, x, y, z that q ends with."""
    w, x, y, z = q[-4:] / np.linalg.norm(q[-4:], axis=0)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _turned(rotation: Array, vectors: Array) -> Array:
    return np.asarray(np.einsum("ijk,jk->ik", rotation, vectors))


def _cross(a: Array, b: Array) -> Array:
    return np.cross(a, np.broadcast_to(b, a.shape), axis=0)


def _unit(q: Array) -> Array:
    """q with the quaternion that it ends with scaled to length 1."""
    return np.concatenate([q[:-4], q[-4:] / np.linalg.norm(q[-4:], axis=0)])


def _at_origin(q: Array, v: Array, a: Array, com: Array) -> tuple[Array, Array, Array]:
    """Place, velocity and acceleration of a body's origin in place of its centre of mass."""
    turn, w = _world(q), v[3:]
    spin = _cross(w, com)
    bent = _cross(a[3:], com) + _cross(w, spin)
    arms = (np.broadcast_to(com, w.shape), spin, bent)
    q, v, a = (
        np.concatenate([x[:3] - _turned(turn, arm), x[3:]])
        for x, arm in zip((q, v, a), arms, strict=True)
    )
    return q, v, a


def _at_centre(q: Array, v: Array, com: Array) -> tuple[Array, Array]:
    """The reverse."""
    q = _unit(q)
    turn, w = _world(q), v[3:]
    place = q[:3] + _turned(turn, np.broadcast_to(com, w.shape))
    speed = v[:3] + _turned(turn, _cross(w, com))
    return np.concatenate([place, q[3:]]), np.concatenate([speed, w])


def _in_body(q: Array, v: Array, a: Array, com: Array) -> tuple[Array, Array, Array]:
    """The same of the origin, with velocities in the body's axes, and the real part last."""
    q, v, a = _at_origin(q, v, a, com)
    back, w = _world(q).swapaxes(0, 1), v[3:]
    speed = _turned(back, v[:3])
    push = _turned(back, a[:3]) - _cross(w, speed)
    return (
        np.concatenate([q[:3], q[4:], q[3:4]]),
        np.concatenate([speed, w]),
        np.concatenate([push, a[3:]]),
    )


def _of_body(q: Array, v: Array, com: Array) -> tuple[Array, Array]:
    """The reverse."""
    q = np.concatenate([q[:3], q[6:], q[3:6]])
    return _at_centre(q, np.concatenate([_turned(_world(q), v[:3]), v[3:]]), com)


def _on_circle(q: Array, v: Array, a: Array, com: Array) -> tuple[Array, Array, Array]:
    return np.concatenate([np.cos(q), np.sin(q)]), v, a


def _on_line(q: Array, v: Array, com: Array) -> tuple[Array, Array]:
    return np.arctan2(q[1:], q[:1]), v


def _in_plane(q: Array, v: Array, a: Array, com: Array) -> tuple[Array, Array, Array]:
    """x, y, cosine and sine of the angle; velocities along the turned axes."""
    (x, y, angle), (_, _, w) = q, v
    c, s = np.cos(angle), np.sin(angle)
    along, across = c * v[0] + s * v[1], c * v[1] - s * v[0]
    pushes = c * a[0] + s * a[1] + w * across, c * a[1] - s * a[0] - w * along
    return np.array([x, y, c, s]), np.array([along, across, w]), np.array([*pushes, a[2]])


def _of_plane(q: Array, v: Array, com: Array) -> tuple[Array, Array]:
    """The reverse."""
    (x, y, c, s), (along, across, w) = q, v
    speeds = c * along - s * across, s * along + c * across
    return np.array([x, y, np.arctan2(s, c)]), np.array([*speeds, w])


FRAMES: Mapping[Frame, _Change] = {
    "same": _Change(lambda q, v, a, com: (q, v, a), lambda q, v, com: (q, v)),
    "quaternion": _Change(lambda q, v, a, com: (q, v, a), lambda q, v, com: (_unit(q), v)),
    "origin in the world": _Change(_at_origin, _at_centre),
    "origin in the body": _Change(_in_body, _of_body),
    "cosine and sine": _Change(_on_circle, _on_line),
    "plane in the body": _Change(_in_plane, _of_plane),
}
