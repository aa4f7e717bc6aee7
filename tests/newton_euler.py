"""A numeric solver that shares nothing with eomgen: maximal coordinates, one linear system.

The unknowns are the accelerations (ẍ, ÿ, ψ̈) of every body and the force of every pin. The equations
are Newton's and Euler's for every body and, for every pin, the second time derivative of

    x_child = x_parent + r_parent - r_child .

Nothing is eliminated and no mass matrix is formed. Numbers go in, numbers come out.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Mechanism:
    """A planar tree in plain numbers, one entry a body, parents before children.

    `parent` is an index, -1 the world. A `free` body has coordinates x, y, angle; any other one the
    angle relative to its parent, about a pin at `r_parent` in the parent's axes and at `r_child` in
    its own, both from the centre of mass (of the world: from its origin). `torque` is what the
    motor of a body's own pin puts on the body and takes from the parent. `forces` are
    (body, arm in body axes, force in world axes). Gravity acts along -y.
    """

    mass: ArrayLike
    inertia: ArrayLike
    parent: ArrayLike
    free: ArrayLike
    r_parent: ArrayLike
    r_child: ArrayLike
    gravity: float = 0.0
    torque: ArrayLike | None = None
    forces: tuple[tuple[int, ArrayLike, ArrayLike], ...] = field(default=())


@dataclass(frozen=True)
class Motion:
    """What the solver finds.

    `accelerations` are those of the coordinates. Per body: `poses`, `velocities` and
    `body_accelerations` as (x, y, angle), and `pin_forces`, the force of the body's own pin on its
    parent (0 for a free body). `external_power` is that of applied forces and motors,
    `external_force` and `external_torque` (about the world's origin) are all that acts from
    outside: gravity, applied forces, motors and pins of the world.
    """

    accelerations: np.ndarray
    poses: np.ndarray
    velocities: np.ndarray
    body_accelerations: np.ndarray
    pin_forces: np.ndarray
    external_power: float
    external_force: np.ndarray
    external_torque: float


def solve(mechanism: Mechanism, q: ArrayLike, v: ArrayLike) -> Motion:
    """Accelerations and pin forces at coordinates `q` and velocities `v`, bodies in order."""
    mass, inertia = np.asarray(mechanism.mass, float), np.asarray(mechanism.inertia, float)
    parent, free = np.asarray(mechanism.parent), np.asarray(mechanism.free, bool)
    n = len(mass)
    torque = np.zeros(n) if mechanism.torque is None else np.asarray(mechanism.torque, float)
    poses, velocities = np.zeros((n, 3)), np.zeros((n, 3))
    arm_parent, arm_child = np.zeros((n, 2)), np.zeros((n, 2))
    first = 0
    for k in range(n):
        if free[k]:
            poses[k], velocities[k] = q[first : first + 3], v[first : first + 3]
            first += 3
            continue
        base, base_rate = np.zeros(3), np.zeros(3)
        if parent[k] >= 0:
            base, base_rate = poses[parent[k]], velocities[parent[k]]
        poses[k, 2], velocities[k, 2] = base[2] + q[first], base_rate[2] + v[first]
        first += 1
        arm_parent[k] = _turned(mechanism.r_parent[k], base[2])
        arm_child[k] = _turned(mechanism.r_child[k], poses[k, 2])
        poses[k, :2] = base[:2] + arm_parent[k] - arm_child[k]
        velocities[k, :2] = (
            base_rate[:2]
            + base_rate[2] * _quarter_turn(arm_parent[k])
            - velocities[k, 2] * _quarter_turn(arm_child[k])
        )

    pinned = [k for k in range(n) if not free[k]]
    size = 3 * n + 2 * len(pinned)
    matrix, right = np.zeros((size, size)), np.zeros(size)
    for k in range(n):
        row = slice(3 * k, 3 * k + 2)
        matrix[row, row] = mass[k] * np.eye(2)
        right[row] = [0.0, -mass[k] * mechanism.gravity]
        matrix[3 * k + 2, 3 * k + 2] = inertia[k]
    power = 0.0
    outside = np.array([0.0, -mass.sum() * mechanism.gravity])
    twist = -mechanism.gravity * (mass @ poses[:, 0])
    for k, at, force in mechanism.forces:
        arm, force = _turned(at, poses[k, 2]), np.asarray(force, float)
        right[3 * k : 3 * k + 2] += force
        right[3 * k + 2] += _cross(arm, force)
        power += force @ (velocities[k, :2] + velocities[k, 2] * _quarter_turn(arm))
        outside += force
        twist += _cross(poses[k, :2] + arm, force)
    for i, k in enumerate(pinned):
        column = slice(3 * n + 2 * i, 3 * n + 2 * i + 2)  # the pin's force on the parent
        own, pin = slice(3 * k, 3 * k + 2), slice(3 * n + 2 * i, 3 * n + 2 * i + 2)
        matrix[own, column] += np.eye(2)
        matrix[3 * k + 2, column] += [-arm_child[k, 1], arm_child[k, 0]]
        right[3 * k + 2] += torque[k]
        matrix[pin, own] = np.eye(2)
        matrix[pin, 3 * k + 2] = _quarter_turn(arm_child[k])
        right[pin] = velocities[k, 2] ** 2 * arm_child[k]
        p = parent[k]
        power += torque[k] * (velocities[k, 2] - (velocities[p, 2] if p >= 0 else 0.0))
        if p < 0:
            twist += torque[k]
            continue
        matrix[3 * p : 3 * p + 2, column] -= np.eye(2)
        matrix[3 * p + 2, column] -= [-arm_parent[k, 1], arm_parent[k, 0]]
        right[3 * p + 2] -= torque[k]
        matrix[pin, 3 * p : 3 * p + 2] = -np.eye(2)
        matrix[pin, 3 * p + 2] = -_quarter_turn(arm_parent[k])
        right[pin] -= velocities[p, 2] ** 2 * arm_parent[k]

    found = np.linalg.solve(matrix, right)

    body = found[: 3 * n].reshape(n, 3)
    forces = np.zeros((n, 2))
    forces[pinned] = found[3 * n :].reshape(-1, 2)
    accelerations: list[float] = []
    for k in range(n):
        if free[k]:
            accelerations += [*body[k]]
        else:
            accelerations.append(body[k, 2] - (body[parent[k], 2] if parent[k] >= 0 else 0.0))
            if parent[k] < 0:
                outside -= forces[k]
                twist -= _cross(arm_parent[k], forces[k])
    return Motion(
        np.array(accelerations), poses, velocities, body, forces, power, outside, float(twist)
    )


def _turned(vector: ArrayLike, angle: float) -> np.ndarray:
    """A vector of body axes in world axes."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]]) @ np.asarray(vector, float)


def _quarter_turn(vector: np.ndarray) -> np.ndarray:
    """ẑ × vector."""
    return np.array([-vector[1], vector[0]])


def _cross(r: np.ndarray, f: np.ndarray) -> float:
    """ẑ · (r × f)."""
    return r[0] * f[1] - r[1] * f[0]
