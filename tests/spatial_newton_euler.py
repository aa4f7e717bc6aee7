"""A numeric solver of trees in space that shares nothing with eomgen: one linear system.

The unknowns are the accelerations of every body's centre of mass, every body's angular
acceleration, and one multiplier for each direction that a joint blocks. The equations are Newton's
and Euler's for every body and the second time derivative of every blocked direction. A direction is
blocked by one of two kinds of equation, n fixed in the parent and m in the child:

    n · (joint's point on the child - joint's point on the parent) = 0        n · m = constant

Nothing is eliminated and no mass matrix is formed. The plane is motion in space with z = 0. A joint
that closes a loop blocks directions between two bodies as any other does; in the plane only those
that the tree leaves free.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike
from spatial_trees import PLANE, SpatialTree, TreeJoint, Z

CHILD, PARENT = slice(0, 6), slice(6, 12)
"""Where a row has the accelerations (linear, angular) of the child and of the parent."""


@dataclass(frozen=True)
class SpatialMotion:
    """What the solver finds, in the shapes and axes of a generated module's outputs.

    `accelerations` (nv,) are the rates of the velocities, `rates` (nq,) those of the coordinates.
    In the plane | in space: `body_poses` (nb, 3) x, y, angle | (nb, 3, 4) rotation and place;
    `body_velocities` (nb, 3) | (nb, 6), `body_accelerations` alike: linear of the centre of mass,
    then angular, world axes; `momentum` (3,) | (6,) about the world's origin, of the bodies alone;
    `centre_of_mass`, `point_positions`, `point_velocities` with 2 | 3 components.

    `joint_forces` (nj, 3) | (nj, 6), one for each of the tree's `joints`, loops too: force and
    moment of the whole wrench that the joint puts on its parent, at the joint's point on the child,
    world axes.
    It is what the child and all it carries need to move as they do, turned round: reactions of
    blocked directions, the motor's torque and the rotor's inertia torque (-armature q̈ on the child)
    included. Along a free direction the wrench on the child is hence torque - armature q̈.

    `kinetic_energy` has the rotors' ½ armature q̇². `external_power` is that of push and motor;
    `external_wrench` (6,), about the world's origin, is all that acts from outside: gravity, the
    push, and the joints of the world. `driving` is the force along each prescribed velocity.
    """

    accelerations: np.ndarray
    rates: np.ndarray
    body_poses: np.ndarray
    body_velocities: np.ndarray
    body_accelerations: np.ndarray
    joint_forces: np.ndarray
    kinetic_energy: float
    potential_energy: float
    momentum: np.ndarray
    centre_of_mass: np.ndarray
    point_positions: np.ndarray
    point_velocities: np.ndarray
    external_power: float
    external_wrench: np.ndarray
    driving: Mapping[str, float] = field(default_factory=dict)


@dataclass
class BodyMotion:
    """Where a body is and how it moves, in world axes; `angle` has a meaning in the plane alone."""

    place: np.ndarray
    axes: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray
    angle: float = 0.0

    def at(self, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Place and velocity of a point in its axes."""
        arm = self.axes @ point
        return self.place + arm, self.velocity + _cross(self.spin, arm)


STILL = BodyMotion(np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3))
"""The world."""


def solve(
    tree: SpatialTree,
    q: np.ndarray,
    v: np.ndarray,
    u: Mapping[str, float] | None = None,
    prescribed: Mapping[str, float] | None = None,
    *,
    redundant: bool = False,
) -> SpatialMotion:
    """Everything about the tree at coordinates `q`, velocities `v` and inputs `u` by name.

    Velocities in `prescribed` change at the rates given there: one more blocked direction each.
    Loops are closed at `q` and `v`. If they block directions twice (`redundant`), the joint forces
    are the least of those that are possible.
    """
    n = len(tree.bodies)
    pairs = _pairs(tree, q, v)
    moving = [pair.child for pair in pairs]

    blocked = [pair.blocked() for pair in pairs]
    free = [pair.free() for pair in pairs]
    driven: dict[str, tuple[int, int]] = {}  # the body, and which of its joint's directions
    for k, (body, (ways, lacks)) in enumerate(zip(tree.bodies, free, strict=True)):
        for name, way, lack in zip(body.joint.velocities, ways, lacks, strict=True):
            if name in (prescribed or {}):
                rows, rest = blocked[k]
                driven[name] = (k, len(rows))
                rest = np.append(rest, lack - (prescribed or {})[name])
                blocked[k] = np.vstack([rows.reshape(-1, 12), way]), rest
    closing = _closing(tree, moving)
    blocked += [loop.blocked() for loop in closing]
    ends = 6 * n + np.cumsum([0] + [len(rows) for rows, _ in blocked])
    matrix, right = np.zeros((ends[-1], ends[-1])), np.zeros(ends[-1])
    inertias: list[np.ndarray] = []
    outside = np.zeros(6)
    for k, (body, moved) in enumerate(zip(tree.bodies, moving, strict=True)):
        inertia = moved.axes @ body.inertia_matrix @ moved.axes.T
        inertias.append(inertia)
        weight = body.mass * tree.gravity_vector()
        linear, angular = slice(6 * k, 6 * k + 3), slice(6 * k + 3, 6 * k + 6)
        matrix[linear, linear], matrix[angular, angular] = body.mass * np.eye(3), inertia
        right[linear], right[angular] = weight, -_cross(moved.spin, inertia @ moved.spin)
        outside += [*weight, *_cross(moved.place, weight)]
    torques = tree.torques(u)
    power = float(torques @ v)
    for k, at, force in tree.push_forces(u):
        arm = moving[k].axes @ at
        right[6 * k : 6 * k + 6] += [*force, *_cross(arm, force)]
        power += float(force @ (moving[k].velocity + _cross(moving[k].spin, arm)))
        outside += [*force, *_cross(moving[k].place + arm, force)]
    held = [(k, body.joint.parent) for k, body in enumerate(tree.bodies)]
    held += [(loop.child, loop.joint.parent) for loop in tree.loops]
    for i, (k, parent) in enumerate(held):
        places, columns = _touched(k, parent)
        rows, own = blocked[i][0][:, columns], np.arange(ends[i], ends[i + 1])
        matrix[np.ix_(own, places)], matrix[np.ix_(places, own)] = rows, -rows.T
        right[own] = -blocked[i][1]
    for k, (body, rate) in enumerate(zip(tree.bodies, tree.v_slices(), strict=True)):
        touched, columns = _touched(k, body.joint.parent)
        rows, lack = free[k][0][:, columns], free[k][1]
        matrix[np.ix_(touched, touched)] += body.joint.armature * rows.T @ rows
        right[touched] += rows.T @ (torques[rate] - body.joint.armature * lack)

    if redundant:
        found = np.linalg.lstsq(matrix, right, rcond=1e-12)[0]
    else:
        found = np.linalg.solve(matrix, right)

    changes = found[: 6 * n].reshape(n, 6)
    accelerations = np.zeros(len(v))
    wrenches = np.zeros((len(held), 6))
    for k, (body, rate) in enumerate(zip(tree.bodies, tree.v_slices(), strict=True)):
        rows, lack = free[k]
        accelerations[rate] = rows[:, CHILD] @ changes[k] + lack
        if body.joint.parent >= 0:
            accelerations[rate] += rows[:, PARENT] @ changes[body.joint.parent]
        along = torques[rate] - body.joint.armature * accelerations[rate]
        wrench = found[ends[k] : ends[k + 1]] @ blocked[k][0][:, CHILD] + along @ rows[:, CHILD]
        force, arm = wrench[:3], pairs[k].arm_child
        wrenches[k] = [*-force, *(_cross(arm, force) - wrench[3:])]
        if body.joint.parent < 0:
            outside += [*force, *(_cross(moving[k].place, force) + wrench[3:])]
    for i, (loop, pair) in enumerate(zip(tree.loops, closing, strict=True), n):
        wrench = found[ends[i] : ends[i + 1]] @ blocked[i][0][:, CHILD]
        force, arm = wrench[:3], pair.arm_child
        wrenches[i] = [*-force, *(_cross(arm, force) - wrench[3:])]
        whole = np.array([*force, *(_cross(pair.child.place, force) + wrench[3:])])
        outside += whole * ((loop.joint.parent < 0) - (loop.child < 0))
    report = _report(tree, v, pairs, inertias, changes, accelerations, wrenches, power, outside)
    return replace(
        report, driving={name: float(found[ends[k] + i]) for name, (k, i) in driven.items()}
    )


def under(
    tree: SpatialTree,
    q: np.ndarray,
    v: np.ndarray,
    loads: Sequence[tuple[int, np.ndarray, np.ndarray]],
    u: Mapping[str, float] | None = None,
) -> np.ndarray:
    """Accelerations under more forces: body, point in its axes, force in world axes."""
    more = [(f"load_{i}", k, at, force) for i, (k, at, force) in enumerate(loads)]
    given = {
        f"{name}_{x}": part
        for name, _, _, force in more
        for x, part in zip("xyz", force, strict=True)
    }
    pushes = (*tree.pushes, *((name, k, tuple(at)) for name, k, at, _ in more))
    return solve(replace(tree, pushes=pushes), q, v, {**(u or {}), **given}).accelerations


def carried(motion: SpatialMotion, k: int) -> BodyMotion:
    """A body, in three components in the plane, too."""
    pose, moved = motion.body_poses[k], motion.body_velocities[k]
    if len(moved) > 3:
        return BodyMotion(pose[:, 3], pose[:, :3], moved[:3], moved[3:])
    place, velocity = np.array([*pose[:2], 0.0]), np.array([*moved[:2], 0.0])
    return BodyMotion(place, _turn(Z, pose[2]), velocity, moved[2] * np.array(Z), pose[2])


def _pairs(tree: SpatialTree, q: np.ndarray, v: np.ndarray) -> list["_Pair"]:
    """The joints of the tree, with the bodies that they carry."""
    pairs: list[_Pair] = []
    for body, at, rate in zip(tree.bodies, tree.q_slices(), tree.v_slices(), strict=True):
        base = STILL if body.joint.parent < 0 else pairs[body.joint.parent].child
        pairs.append(_Pair(tree, body.joint, base, q[at], v[rate]))
    return pairs


def _closing(tree: SpatialTree, moving: list[BodyMotion]) -> list["_Closing"]:
    """The joints that close loops."""
    bodies = [*moving, STILL]  # the last is the world
    return [
        _Closing(tree, loop.joint, bodies[loop.joint.parent], bodies[loop.child])
        for loop in tree.loops
    ]


def _touched(child: int, parent: int) -> tuple[list[int], list[int]]:
    """The places of the accelerations of two bodies, and their columns in a row; the world has
    none.
    """
    sides = [(k, at) for k, at in ((child, CHILD), (parent, PARENT)) if k >= 0]
    return (
        [i for k, _ in sides for i in range(6 * k, 6 * k + 6)],
        [i for _, at in sides for i in range(at.start, at.stop)],
    )


def at_rest(tree: SpatialTree, q: np.ndarray) -> list[BodyMotion]:
    """The bodies at coordinates q."""
    return [pair.child for pair in _pairs(tree, q, np.zeros(len(tree.velocities)))]


def velocities_of(tree: SpatialTree, q: np.ndarray) -> np.ndarray:
    """Velocities of all bodies, linear and angular, (6 nb, nv), for each velocity of the tree."""
    found = [[pair.child for pair in _pairs(tree, q, v)] for v in np.eye(len(tree.velocities))]
    return np.array([[x for b in bodies for x in (*b.velocity, *b.spin)] for bodies in found]).T


def mass_matrix(tree: SpatialTree, q: np.ndarray, velocities: np.ndarray) -> np.ndarray:
    """Twice the kinetic energy by the velocities of the tree, (nv, nv); see `velocities_of`."""
    found = np.diag([body.joint.armature for body in tree.bodies for _ in body.joint.velocities])
    for k, (body, there) in enumerate(zip(tree.bodies, at_rest(tree, q), strict=True)):
        linear, angular = velocities[6 * k : 6 * k + 3], velocities[6 * k + 3 : 6 * k + 6]
        inertia = there.axes @ body.inertia_matrix @ there.axes.T
        found = found + body.mass * linear.T @ linear + angular.T @ inertia @ angular
    return np.asarray(found)


def loop_rows(tree: SpatialTree, bodies: list[BodyMotion], velocities: np.ndarray) -> np.ndarray:
    """The rates of the directions that the loops block, for each velocity of the tree; `velocities`
    are those of its bodies, see `velocities_of`.
    """
    found = [np.zeros((0, velocities.shape[1]))]
    for loop, pair in zip(tree.loops, _closing(tree, bodies), strict=True):
        places, used = _touched(loop.child, loop.joint.parent)
        found.append(pair.blocked()[0][:, used] @ velocities[places])
    return np.vstack(found)


class _Pair:
    """A joint with its two bodies: how the child moves, and what is blocked."""

    def __init__(
        self, tree: SpatialTree, joint: TreeJoint, base: BodyMotion, q: np.ndarray, v: np.ndarray
    ) -> None:
        self.joint, self.base, self.q, self.v = joint, base, q, v
        plane = tree.dimensions == PLANE
        self.flat = joint.kind == "planar" or (joint.kind == "free" and plane)
        about_x, about_y, about_z = np.radians(joint.orientation_deg)
        turn = _turn((0, 0, 1), about_z) @ _turn((0, 1, 0), about_y) @ _turn((1, 0, 0), about_x)
        self.frame = base.axes @ turn
        self.arm_parent = base.axes @ joint.r_parent
        self.axis = self.frame @ joint.axes[0]
        slide, slide_rate, spin = np.zeros(3), np.zeros(3), np.zeros(3)
        turn, angle = np.eye(3), 0.0
        match joint.kind:
            case "revolute":
                turn, spin, angle = _turn(joint.axes[0], q[0]), self.axis * v[0], q[0]
            case "prismatic":
                slide, slide_rate = self.axis * q[0], self.axis * v[0]
            case "cylindrical":
                slide, slide_rate = self.axis * q[0], self.axis * v[0]
                turn, spin = _turn(joint.axes[0], q[1]), self.axis * v[1]
            case "universal":
                cross = _turn(joint.axes[0], q[0])
                turn = cross @ _turn(joint.axes[1], q[1])
                spin = self.axis * v[0] + self.frame @ cross @ joint.axes[1] * v[1]
            case _ if self.flat:
                slide, slide_rate = self.frame[:, :2] @ q[:2], self.frame[:, :2] @ v[:2]
                turn, spin, angle = _turn((0, 0, 1), q[2]), self.frame[:, 2] * v[2], q[2]
            case "ball":
                turn = _of_quaternion(q)
                spin = self.frame @ turn @ v
            case "free":
                slide, slide_rate, turn = q[:3], v[:3], _of_quaternion(q[3:])
                spin = turn @ v[3:]
        axes = self.frame @ turn
        self.arm_child = axes @ joint.r_child
        self.spin = base.spin + spin
        self.gap, self.gap_rate = slide, slide_rate + _cross(base.spin, slide)
        place = base.place + self.arm_parent + slide - self.arm_child
        velocity = base.velocity + _cross(base.spin, self.arm_parent) + self.gap_rate
        velocity = velocity - _cross(self.spin, self.arm_child)
        self.child = BodyMotion(place, axes, velocity, self.spin, base.angle + about_z + angle)

    def along(self, n: np.ndarray) -> tuple[np.ndarray, float]:
        """Second time derivative of n · gap, n fixed in the parent: a row and what it lacks."""
        row = np.zeros(12)
        row[CHILD] = [*n, *_cross(self.arm_child, n)]
        row[PARENT] = [*-n, *-_cross(self.arm_parent + self.gap, n)]
        inner, outer = self.base.spin, self.spin
        rest = _whirl(outer, self.arm_child) - _whirl(inner, self.arm_parent)
        turning = 2 * _cross(inner, n) @ self.gap_rate + _whirl(inner, n) @ self.gap
        return row, float(n @ rest + turning)

    def between(self, n: np.ndarray, m: np.ndarray) -> tuple[np.ndarray, float]:
        """The same of n · m, m fixed in the child."""
        row = np.zeros(12)
        row[3:6], row[9:12] = _cross(m, n), _cross(n, m)
        inner, outer = self.base.spin, self.spin
        rest = n @ _whirl(outer, m) + 2 * _cross(inner, n) @ _cross(outer, m)
        return row, float(rest + _whirl(inner, n) @ m)

    def blocked(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows of the directions that the joint blocks, and what they lack to be zero."""
        kind, axis, own = self.joint.kind, self.axis, self.child.axes
        x, y, z = self.frame.T
        beside = np.linalg.svd(axis[None])[2][1:]  # two unit vectors across the axis
        points, pairs = [], []  # n; n and m
        match kind:
            case "weld" | "revolute" | "universal" | "ball":
                points = [x, y, z]
            case "prismatic" | "cylindrical":
                points = [*beside]
        match kind:
            case "weld" | "prismatic":
                pairs = [(x, own[:, 1]), (y, own[:, 2]), (z, own[:, 0])]
            case "revolute" | "cylindrical":
                pairs = [(n, own @ self.joint.axes[0]) for n in beside]
            case "universal":
                pairs = [(axis, own @ self.joint.axes[1])]
        if self.flat:
            points, pairs = [z], [(x, own[:, 2]), (y, own[:, 2])]
        return _stacked([self.along(n) for n in points] + [self.between(*nm) for nm in pairs])

    def free(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows that give the accelerations of the joint's velocities, and what they lack."""
        x, y, z = self.frame.T
        own = self.child.axes
        match self.joint.kind:
            case "weld":
                return _stacked([])
            case "revolute":
                return _stacked([self.about(self.axis)])
            case "prismatic":
                return _stacked([self.along(self.axis)])
            case "cylindrical":
                return _stacked([self.along(self.axis), self.about(self.axis)])
            case "universal":
                second = own @ self.joint.axes[1]
                rest = _cross(self.base.spin, self.axis) * self.v[0]
                rest += _cross(self.spin, second) * self.v[1]
                inverse = np.linalg.pinv(np.column_stack([self.axis, second]))
                return _stacked([self.about(n, rest) for n in inverse])
            case "ball":
                rest = _cross(self.spin, self.spin - self.base.spin)
                return _stacked([self.about(n, rest) for n in own.T])
            case "free" if not self.flat:
                rows = np.zeros((6, 12))
                rows[:3, :3], rows[3:, 3:6] = np.eye(3), own.T
                return rows, np.zeros(6)
        return _stacked([self.along(x), self.along(y), self.about(z)])

    def about(self, n: np.ndarray, rest: np.ndarray | None = None) -> tuple[np.ndarray, float]:
        """n · (angular acceleration of the child less the parent's, less `rest`)."""
        row = np.zeros(12)
        row[3:6], row[9:12] = n, -n
        return row, 0.0 if rest is None else -float(n @ rest)


class _Closing(_Pair):
    """A joint between two bodies whose motions are known."""

    def __init__(
        self, tree: SpatialTree, joint: TreeJoint, base: BodyMotion, child: BodyMotion
    ) -> None:
        self.joint, self.base, self.child, self.spin = joint, base, child, child.spin
        self.plane = tree.dimensions == PLANE
        self.flat = joint.kind == "planar"
        turns = zip((Z, (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)), joint.orientation_deg[::-1], strict=True)
        about_z, about_y, about_x = (_turn(axis, np.radians(angle)) for axis, angle in turns)
        self.frame = base.axes @ about_z @ about_y @ about_x
        self.axis = self.frame @ joint.axes[0]
        self.arm_parent, self.arm_child = base.axes @ joint.r_parent, child.axes @ joint.r_child
        self.gap = child.place + self.arm_child - base.place - self.arm_parent
        at_child = child.velocity + _cross(child.spin, self.arm_child)
        self.gap_rate = at_child - base.velocity - _cross(base.spin, self.arm_parent)

    def blocked(self) -> tuple[np.ndarray, np.ndarray]:
        """In the plane without the directions that everything in it blocks."""
        rows, lack = super().blocked()
        if self.plane:
            inside = np.abs(rows[:, [0, 1, 5, 6, 7, 11]]).max(axis=1, initial=0.0) > 1e-9
            rows, lack = rows[inside], lack[inside]
        return rows, lack


def _report(
    tree: SpatialTree,
    v: np.ndarray,
    pairs: list[_Pair],
    inertias: list[np.ndarray],
    changes: np.ndarray,
    accelerations: np.ndarray,
    wrenches: np.ndarray,
    power: float,
    outside: np.ndarray,
) -> SpatialMotion:
    """The results in the shapes of the plane or of space."""
    moving = [pair.child for pair in pairs]
    mass = np.array([body.mass for body in tree.bodies])
    places = np.array([body.place for body in moving])
    speeds = np.array([[*body.velocity, *body.spin] for body in moving])
    kinetic = 0.0
    momentum = np.zeros(6)
    for m, inertia, body in zip(mass, inertias, moving, strict=True):
        linear, angular = m * body.velocity, inertia @ body.spin
        kinetic += 0.5 * (linear @ body.velocity + angular @ body.spin)
        momentum += [*linear, *(_cross(body.place, linear) + angular)]
    rates = []
    for pair, rate in zip(pairs, tree.v_slices(), strict=True):
        kinetic += 0.5 * pair.joint.armature * float(v[rate] @ v[rate])
        plain = len(pair.q) - 4 if len(pair.q) > len(pair.v) else len(pair.q)
        rates += [*pair.v[:plain], *_quaternion_rate(pair.q[plain:], pair.v[plain:])]
    poses = np.array([np.column_stack([body.axes, body.place]) for body in moving])
    components, kept = slice(0, 3), [0, 1, 2, 3, 4, 5]
    if tree.dimensions == PLANE:
        components, kept = slice(0, 2), [0, 1, 5]
        poses = np.array([[*body.place[:2], body.angle] for body in moving])
    arms = [(moving[k], moving[k].axes @ at) for _, k, at in tree.points]
    held = [k for k, body in enumerate(tree.bodies) if body.joint.kind != "free"]
    held += range(len(tree.bodies), len(wrenches))
    shown = np.array([body.place + arm for body, arm in arms]).reshape(-1, 3)
    shown_rate = [body.velocity + _cross(body.spin, arm) for body, arm in arms]
    return SpatialMotion(
        accelerations=accelerations,
        rates=np.array(rates),
        body_poses=poses,
        body_velocities=speeds[:, kept],
        body_accelerations=changes[:, kept],
        joint_forces=wrenches[held][:, kept],
        kinetic_energy=kinetic,
        potential_energy=-float(mass @ places @ tree.gravity_vector()),
        momentum=momentum[kept],
        centre_of_mass=(mass @ places / mass.sum())[components],
        point_positions=shown[:, components],
        point_velocities=np.array(shown_rate).reshape(-1, 3)[:, components],
        external_power=power,
        external_wrench=outside,
    )


def _stacked(rows: list[tuple[np.ndarray, float]]) -> tuple[np.ndarray, np.ndarray]:
    return np.array([row for row, _ in rows]).reshape(-1, 12), np.array([rest for _, rest in rows])


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a × b; `np.cross` takes ten times as long."""
    (a1, a2, a3), (b1, b2, b3) = a, b
    return np.array([a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1])


def _whirl(spin: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """Second time derivative of a vector that turns steadily."""
    return _cross(spin, _cross(spin, arm))


def _turn(axis: ArrayLike, angle: float) -> np.ndarray:
    """Rotation about a unit vector, by Rodrigues."""
    x, y, z = np.asarray(axis, float)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def _of_quaternion(quaternion: np.ndarray) -> np.ndarray:
    """Rotation of a unit quaternion w, x, y, z."""
    w, axis = quaternion[0], quaternion[1:]
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return (w * w - axis @ axis) * np.eye(3) + 2 * np.outer(axis, axis) + 2 * w * cross


def _quaternion_rate(quaternion: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """½ quaternion ∘ (0, spin), spin in the turned axes; nothing of nothing."""
    if not len(quaternion):
        return quaternion
    w, axis = quaternion[0], quaternion[1:]
    return 0.5 * np.array([-axis @ spin, *(w * spin + _cross(axis, spin))])
