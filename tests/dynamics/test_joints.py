"""Each joint type alone, against formulas worked out by hand; and what the scene language says.

Rz(c) Ry(b) Rx(a) is the orientation [a, b, c]; places run from centres of mass; gravity acts along
-z. Both recursions are tried.
"""

import re
from typing import Any

import numpy as np
import pytest
from engine import DERIVATIVES, Engine, apart, engine

ASIDE = DERIVATIVES[1:]
EXACT = 1e-13
G = 9.81
M, R = 1.7, np.array([0.3, -0.2, 0.25])
INERTIA = np.array([[0.11, 0.01, -0.02], [0.01, 0.12, 0.015], [-0.02, 0.015, 0.17]])
ENTRIES = "[0.11, 0.12, 0.17, 0.01, -0.02, 0.015]"
X, Y, Z = np.eye(3)


@pytest.fixture(params=["aba", "ldl"])
def route(request: pytest.FixtureRequest) -> str:
    """Either recursion."""
    return str(request.param)


def scene(*tables: str, dimensions: int = 3, gravity: bool = True) -> str:
    """A scene of some tables."""
    head = f'name = "joints"\ndimensions = {dimensions}\n'
    weight = f'[[effects]]\ntype = "gravity"\ng = {G}\n' if gravity else ""
    return "\n".join((head, *tables, weight))


def body(name: str = "b", mass: float | str = M, inertia: str = ENTRIES) -> str:
    """A body's table."""
    return f'[[bodies]]\nname = "{name}"\nmass = {mass}\ninertia_com = {inertia}\n'


def joint(kind: str, *lines: str, child: str = "b", parent: str = "world", name: str = "j") -> str:
    """A joint's table."""
    head = f'[[joints]]\nname = "{name}"\ntype = "{kind}"\nchild = "{child}"\n'
    return head + "\n".join((f'parent = "{parent}"', *lines)) + "\n"


def at(key: str, vector: np.ndarray) -> str:
    """A line with a vector."""
    return f"{key} = {vector.tolist()}"


FORCE = '[[effects]]\ntype = "external_force"\nname = "f"\nbody = "b"\nforce = "input"\n'
MOTOR = '[[effects]]\ntype = "motor"\nname = "tau"\njoint = "j"\ntorque = "input"\n'


def load(text: str, route: str) -> Any:
    """The module of a scene, without Jacobians."""
    return engine(text, route, leave_out=DERIVATIVES).module


def rates(module: Any, values: dict[str, float], u: Any = None) -> dict[str, float]:
    """The state's rates by name, at a state given by name: 0 else, quaternions 1, 0, 0, 0."""
    y = state(module, values)
    return dict(zip(module.STATES, module.derivative(0.0, y, u=u).tolist(), strict=True))


def state(module: Any, values: dict[str, float]) -> np.ndarray:
    """A state given by name."""
    assert set(values) <= set(module.STATES)
    y = np.array([values.get(name, 0.0) for name in module.STATES])
    for indices in map(list, module.QUATERNIONS):
        if not np.any(y[indices]):
            y[indices[0]] = 1.0
    return y


def turn(axis: np.ndarray, angle: float) -> np.ndarray:
    """The rotation about a unit vector (Rodrigues)."""
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def of_quaternion(w: float, x: float, y: float, z: float) -> np.ndarray:
    """The rotation of a quaternion, by its axis and angle."""
    v = np.array([x, y, z])
    length = np.linalg.norm(v)
    return turn(v / length, 2 * np.arctan2(length, w)) if length else np.eye(3)


def about(inertia: np.ndarray, mass: float, r: np.ndarray) -> np.ndarray:
    """Inertia about a point at r from the centre of mass (parallel axes)."""
    return inertia + mass * (r @ r * np.eye(3) - np.outer(r, r))


# One joint at a time.


@pytest.mark.every(2)
@pytest.mark.parametrize("axis", [X, -Y, Z, np.array([2, -1, 2]) / 3, np.array([1, 2, -2]) / 3])
def test_revolute(route: str, axis: np.ndarray) -> None:
    """(a·I a + n² J) q̈ = τ + a · (arm × m g), with I about the pin; a = E axis."""
    text = scene(
        body(),
        joint(
            "revolute",
            at("axis", axis),
            at("r_child", R),
            "motor_inertia = 0.003",
            "gear_ratio = 12.5",
            "orientation_deg = [30, -50, 70]",
        ),
        MOTOR,
    )
    module = load(text, route)
    E = turn(Z, np.radians(70)) @ turn(Y, np.radians(-50)) @ turn(X, np.radians(30))
    for q, v, tau in ((0.0, 0.0, 0.0), (0.7, -2.0, 3.0)):
        world = E @ turn(axis, q)
        arm = -world @ R  # from the pin to the centre of mass
        felt = axis @ about(INERTIA, M, R) @ axis + 12.5**2 * 0.003
        pull = (E @ axis) @ np.cross(arm, [0, 0, -M * G])
        y = state(module, {"j_angle": q, "j_angle_dot": v})
        found = module.derivative(0.0, y, u={"tau": tau})
        assert found == pytest.approx([v, (tau + pull) / felt], rel=EXACT)
        assert apart(module.body_poses(0.0, y)[0], np.column_stack([world, arm])) < EXACT
        spin = E @ axis * v
        velocity = np.concatenate((np.cross(spin, arm), spin))
        assert apart(module.body_velocities(0.0, y)[0], velocity) < EXACT
        # m a = m g + f, and the moment about the axis is that of motor and rotor.
        a = np.cross(found[1] * E @ axis, arm) + np.cross(spin, np.cross(spin, arm))
        wrench = -module.joint_forces(0.0, y, u={"tau": tau})[0]
        assert apart(wrench[:3], M * (a + G * Z)) < EXACT
        rotor = tau - 12.5**2 * 0.003 * found[1]
        assert wrench[3:] @ E @ axis == pytest.approx(rotor, abs=1e-12)


def test_motor_inertia(route: str) -> None:
    """q̈ = τ / (I + n² J) about a principal axis; without a ratio n = 1; M and T have it too."""
    for line, n in (("", 1.0), ("gear_ratio = 20", 20.0), ("gear_ratio = -3.5", -3.5)):
        lines = ("motor_inertia = 0.02", line)
        text = scene(body(inertia="[0.3, 0.4, 0.5]"), joint("revolute", *lines), MOTOR)
        module = load(text, route)
        felt = 0.5 + n**2 * 0.02
        assert rates(module, {}, {"tau": 1.3})["j_angle_dot"] == pytest.approx(1.3 / felt)
        y = state(module, {"j_angle_dot": 3.0})
        assert module.mass_matrix(0.0, y)[0, 0] == pytest.approx(felt)
        assert module.kinetic_energy(0.0, y) == pytest.approx(felt * 9 / 2)
        assert module.momentum(0.0, y)[5] == pytest.approx(1.5)  # rotors are no bodies
        assert module.inverse_dynamics([0.0], [0.0], [2.0])[0] == pytest.approx(2 * felt)


@pytest.mark.every(2)
@pytest.mark.parametrize("axis", [X, Z, -Z, np.array([0.6, 0.0, 0.8])])
def test_prismatic(route: str, axis: np.ndarray) -> None:
    """(m + n² J) q̈ = F - m g a_z: along the axis alone, whatever the places."""
    text = scene(
        body(),
        joint(
            "prismatic",
            at("axis", 3 * axis),  # a direction, of any length
            at("r_parent", np.array([1.0, 2.0, 3.0])),
            at("r_child", R),
            "orientation_deg = [0, 90, 0]",
            "motor_inertia = 0.4",
            "gear_ratio = 2",
        ),
        MOTOR,
    )
    module = load(text, route)
    E = turn(Y, np.pi / 2)
    world = E @ axis
    found = rates(module, {"j_slide": 0.3, "j_slide_dot": 1.1}, {"tau": 5.0})
    assert found["j_slide"] == 1.1
    expected = (5.0 - M * G * world[2]) / (M + 1.6)
    assert found["j_slide_dot"] == pytest.approx(expected, rel=EXACT)
    y = state(module, {"j_slide": 0.3, "j_slide_dot": 1.1})
    place = np.array([1.0, 2.0, 3.0]) + 0.3 * world - E @ R
    assert apart(module.body_poses(0.0, y)[0], np.column_stack([E, place])) < EXACT
    assert apart(module.body_velocities(0.0, y)[0], [*1.1 * world, 0, 0, 0]) < EXACT
    # The joint carries m (a - g) across the axis, at its own point on the child.
    force = -module.joint_forces(0.0, y, u={"tau": 5.0})[0]
    assert apart(force[:3], M * (expected * world + G * Z)) < EXACT
    assert apart(force[3:], np.cross(-E @ R, force[:3])) < EXACT


def test_cylindrical(route: str) -> None:
    """Along and about one axis at once: a bolt whose centre of mass is r off its axis.

    Level along x: slide and angle know nothing of each other; the angle is a pendulum.
    """
    text = scene(body(inertia="[0.3, 0.4, 0.5]"), joint("cylindrical", at("axis", X), LEVER), FORCE)
    module = load(text, route)
    assert module.STATES == ("j_slide", "j_angle", "j_slide_dot", "j_angle_dot")
    q = 0.6
    values = {"j_slide": 0.2, "j_angle": q, "j_slide_dot": -0.4, "j_angle_dot": 1.5}
    found = rates(module, values, {"f_x": 2.0})
    assert (found["j_slide"], found["j_angle"]) == (-0.4, 1.5)
    assert found["j_slide_dot"] == pytest.approx(2.0 / M)
    lever = 0.2  # r_child = [0, -0.2, 0]: the centre of mass is at y = 0.2 of the turned axes
    expected = -M * G * lever * np.cos(q) / (0.3 + M * lever**2)
    assert found["j_angle_dot"] == pytest.approx(expected, rel=EXACT)
    upright = scene(body(), joint("cylindrical", LEVER))  # z where no axis is named
    found = rates(load(upright, route), values)
    assert found["j_slide_dot"] == pytest.approx(-G)
    assert found["j_angle_dot"] == pytest.approx(0.0, abs=1e-13)


LEVER = "r_child = [0, -0.2, 0]"


def test_universal(route: str) -> None:
    """About x, then y, at the centre of mass, moments A, B, C, with c = cos q₂, s = sin q₂:

    ω = (q̇₁ c, q̇₂, q̇₁ s) in the body, so T = ½ (A c² + C s²) q̇₁² + ½ B q̇₂², and by Lagrange
    (A c² + C s²) q̈₁ + 2 (C - A) s c q̇₁ q̇₂ = 0 and B q̈₂ - (C - A) s c q̇₁² = 0.
    """
    A, B, C = 0.3, 0.4, 0.6
    module = load(scene(body(inertia=f"[{A}, {B}, {C}]"), joint("universal")), route)
    q1, q2, v1, v2 = 0.5, -0.8, 1.3, 2.1
    values = dict(zip(module.STATES, (q1, q2, v1, v2), strict=True))
    c, s = np.cos(q2), np.sin(q2)
    first = -2 * (C - A) * s * c * v1 * v2 / (A * c**2 + C * s**2)
    second = (C - A) * s * c * v1**2 / B
    found = rates(module, values)
    assert [found["j_angle_1_dot"], found["j_angle_2_dot"]] == pytest.approx([first, second])
    y = state(module, values)
    assert apart(module.mass_matrix(0.0, y), np.diag([A * c**2 + C * s**2, B])) < EXACT
    world = turn(X, q1) @ turn(Y, q2)
    assert apart(module.body_poses(0.0, y)[0, :, :3], world) < EXACT
    spin = world @ [v1 * c, v2, v1 * s]
    assert apart(module.body_velocities(0.0, y)[0, 3:], spin) < EXACT


QUATERNION = np.array([0.5, -0.7, 0.1, 0.5])


def quaternion(prefix: str) -> dict[str, float]:
    """A quaternion given by name."""
    return {f"{prefix}_q{c}": x for c, x in zip("wxyz", QUATERNION.tolist(), strict=True)}


def spin_of(prefix: str, spin: np.ndarray) -> dict[str, float]:
    """An angular velocity given by name."""
    return {f"{prefix}_w{c}": x for c, x in zip("xyz", spin.tolist(), strict=True)}


def vector(found: dict[str, float], *names: str) -> np.ndarray:
    """Some of what is given by name."""
    return np.array([found[name] for name in names])


def test_ball(route: str) -> None:
    """Euler's equations about the joint, in body axes: I ω̇ + ω × I ω = arm × Rᵀ m g.

    The quaternion changes by ½ q ∘ ω: its scalar part by -½ v·ω, the rest by ½ (w ω + v × ω).
    """
    lines = (at("r_child", R), "orientation_deg = [0, 0, 90]", "r_parent = [0.5, 0, 0]")
    module = load(scene(body(), joint("ball", *lines)), route)
    assert module.QUATERNIONS == ((0, 1, 2, 3),)
    w = np.array([1.0, -2.0, 1.5])
    values = {**quaternion("j"), **spin_of("j", w)}
    found = rates(module, values)
    world = turn(Z, np.pi / 2) @ of_quaternion(*QUATERNION)
    I = about(INERTIA, M, R)  # noqa: E741
    moment = np.cross(-R, world.T @ [0, 0, -M * G])
    expected = np.linalg.solve(I, moment - np.cross(w, I @ w))
    assert apart(vector(found, "j_wx", "j_wy", "j_wz"), expected) < EXACT
    s, v = QUATERNION[0], QUATERNION[1:]
    change = 0.5 * np.array([-v @ w, *(s * w + np.cross(v, w))])
    assert apart(vector(found, "j_qw", "j_qx", "j_qy", "j_qz"), change) < EXACT
    y = state(module, values)
    pose = np.column_stack([world, [0.5, 0, 0] - world @ R])
    assert apart(module.body_poses(0.0, y)[0], pose) < EXACT
    assert apart(module.mass_matrix(0.0, y), I) < EXACT
    assert apart(module.velocity_force(0.0, y), np.cross(w, I @ w)) < EXACT


def test_free(route: str) -> None:
    """Newton in world axes, Euler in the body's: I ω̇ + ω × I ω = at × Rᵀ f."""
    place = np.array([0.1, -0.3, 0.2])
    text = scene(body(), '[[joints]]\nname = "j"\ntype = "free"\nchild = "b"\n', PUSHED)
    module = load(text, route)
    assert module.JOINTS == ()
    assert module.joint_forces(0.0, module.initial_state()).shape == (0, 6)
    w, f = np.array([1.0, -2.0, 1.5]), np.array([3.0, -4.0, 5.0])
    moving = {"b_x": 0.4, "b_y": -2.0, "b_z": 1.0, "b_x_dot": 1.0, "b_y_dot": 2.0, "b_z_dot": -3.0}
    values = {**moving, **quaternion("b"), **spin_of("b", w)}
    found = rates(module, values, dict(zip(("f_x", "f_y", "f_z"), f.tolist(), strict=True)))
    world = of_quaternion(*QUATERNION)
    assert apart(vector(found, "b_x", "b_y", "b_z"), [1.0, 2.0, -3.0]) == 0
    assert apart(vector(found, "b_x_dot", "b_y_dot", "b_z_dot"), f / M - G * Z) < EXACT
    moment = np.cross(place, world.T @ f)
    expected = np.linalg.solve(INERTIA, moment - np.cross(w, INERTIA @ w))
    assert apart(vector(found, "b_wx", "b_wy", "b_wz"), expected) < EXACT
    y = state(module, values)
    velocity = np.array([1.0, 2.0, -3.0, *(world @ w)])
    assert apart(module.body_velocities(0.0, y)[0], velocity) < EXACT
    linear = M * velocity[:3]
    angular = np.cross([0.4, -2.0, 1.0], linear) + world @ INERTIA @ w
    assert apart(module.momentum(0.0, y), [*linear, *angular]) < EXACT
    assert apart(module.mass_matrix(0.0, y)[3:, 3:], INERTIA) < EXACT


PUSHED = FORCE + "at = [0.1, -0.3, 0.2]\n"


def test_planar(route: str) -> None:
    """On a slope: x and y of the tilted axes, and the angle about their z.

    With the centre of mass at r from the joint's point, in axes of the slope and turned by q:
    m (ẍ + r̈) = m g along the slope, and I_p q̈ + z · m r × (ẍ - g) = 0.
    """
    text = scene(
        body(inertia="[0.3, 0.4, 0.5]"),
        joint("planar", "orientation_deg = [90, 0, 0]", "r_child = [0.2, -0.1, 0.3]"),
    )
    module = load(text, route)
    assert module.STATES[:3] == ("j_x", "j_y", "j_angle")
    q, w = 0.7, 1.9
    values = {"j_x": 0.3, "j_y": -0.2, "j_angle": q, "j_x_dot": 1.0, "j_angle_dot": w}
    found = rates(module, values)
    c, s = np.cos(q), np.sin(q)
    r = -np.array([c * 0.2 + s * 0.1, s * 0.2 - c * 0.1])  # y of the slope is the world's z
    m, J = M, 0.5 + M * (r @ r)
    system = np.array([[m, 0, -m * r[1]], [0, m, m * r[0]], [-m * r[1], m * r[0], J]])
    right = [m * w**2 * r[0], m * w**2 * r[1] - m * G, -m * G * r[0]]
    expected = np.linalg.solve(system, right)
    assert apart(vector(found, "j_x_dot", "j_y_dot", "j_angle_dot"), expected) < EXACT
    y = state(module, values)
    world = turn(X, np.pi / 2) @ turn(Z, q)
    place = np.array([0.3, 0.0, -0.2]) - world @ [0.2, -0.1, 0.3]
    assert apart(module.body_poses(0.0, y)[0], np.column_stack([world, place])) < EXACT


def test_weld(route: str) -> None:
    """Two bodies welded are one: masses add, and inertias about the common axis (parallel axes)."""
    text = scene(
        body("carrier", 2.0, "[0.2, 0.3, 0.4]"),
        joint("revolute", "axis = [0, 1, 0]", at("r_child", R), child="carrier", name="pin"),
        body(),
        joint(
            "weld",
            "r_parent = [0.3, 0.1, 0.2]",
            "r_child = [-0.1, 0.2, 0]",
            "orientation_deg = [20, 40, -60]",
            parent="carrier",
        ),
    )
    module = load(text, route)
    assert module.STATES == ("pin_angle", "pin_angle_dot")
    E = turn(Z, np.radians(-60)) @ turn(Y, np.radians(40)) @ turn(X, np.radians(20))
    second = np.array([0.3, 0.1, 0.2]) - E @ [-0.1, 0.2, 0] - R  # from the pin, carrier's axes
    whole = about(np.diag([0.2, 0.3, 0.4]), 2.0, R) + about(E @ INERTIA @ E.T, M, second)
    assert module.mass_matrix(0.0, [0.4, 0.0])[0, 0] == pytest.approx(whole[1, 1], rel=EXACT)
    world = turn(Y, 0.4)
    weights = 2.0 * world @ -R + M * world @ second
    pull = np.cross(weights, [0, 0, -G])[1]
    found = module.derivative(0.0, [0.4, 2.5])
    assert found == pytest.approx([2.5, pull / whole[1, 1]], rel=EXACT)
    row = module.BODIES.index("b")
    pose = np.column_stack([world @ E, world @ second])
    assert apart(module.body_poses(0.0, [0.4, 0.0])[row], pose) < EXACT
    # The weld gives its body weight and acceleration, at its own point on it.
    still = module.joint_forces(0.0, [0.4, 0.0])[module.JOINTS.index("j")]
    a = np.cross(found[1] * Y, world @ second) + G * Z
    assert apart(still[:3], -M * a) < EXACT
    moment = world @ E @ INERTIA @ E.T @ world.T @ (found[1] * Y)
    arm = world @ E @ [0.1, -0.2, 0.0]
    assert apart(still[3:], -moment - np.cross(arm, M * a)) < EXACT


# What composite joints are made of.


# Names and conventions.

NAMES = {
    (2, "weld"): ((), ()),
    (2, "revolute"): (("j_angle",), ("j_angle_dot",)),
    (2, "prismatic"): (("j_slide",), ("j_slide_dot",)),
    (2, "planar"): (("j_x", "j_y", "j_angle"), ("j_x_dot", "j_y_dot", "j_angle_dot")),
    (2, "particle"): (("b_x", "b_y"), ("b_x_dot", "b_y_dot")),
    (2, "free"): (("b_x", "b_y", "b_angle"), ("b_x_dot", "b_y_dot", "b_angle_dot")),
    (3, "weld"): ((), ()),
    (3, "revolute"): (("j_angle",), ("j_angle_dot",)),
    (3, "prismatic"): (("j_slide",), ("j_slide_dot",)),
    (3, "cylindrical"): (("j_slide", "j_angle"), ("j_slide_dot", "j_angle_dot")),
    (3, "universal"): (("j_angle_1", "j_angle_2"), ("j_angle_1_dot", "j_angle_2_dot")),
    (3, "planar"): (("j_x", "j_y", "j_angle"), ("j_x_dot", "j_y_dot", "j_angle_dot")),
    (3, "particle"): (("b_x", "b_y", "b_z"), ("b_x_dot", "b_y_dot", "b_z_dot")),
    (3, "ball"): (("j_qw", "j_qx", "j_qy", "j_qz"), ("j_wx", "j_wy", "j_wz")),
    (3, "free"): (
        ("b_x", "b_y", "b_z", "b_qw", "b_qx", "b_qy", "b_qz"),
        ("b_x_dot", "b_y_dot", "b_z_dot", "b_wx", "b_wy", "b_wz"),
    ),
}


@pytest.mark.every(2)
@pytest.mark.parametrize(("dimensions", "kind"), NAMES)
def test_names(dimensions: int, kind: str) -> None:
    """Of coordinates and velocities, as they are by themselves and as a scene gives them."""
    positions, velocities = NAMES[dimensions, kind]
    inertia = "0.2" if dimensions == 2 else ENTRIES
    axis = f"axis = {[1, 0, 0][:dimensions]}" if kind == "prismatic" else ""
    hinge = joint("revolute", child="door", name="hinge")
    for given in (False, kind not in ("weld", "ball")):
        line = ""
        plain = tuple(name for name in positions if "_q" not in name)
        renamed = tuple(f"own_{i}" for i in range(len(plain))) if given else plain
        if given and len(plain) == 1:
            line = 'coordinate = "own_0"'
        elif given:
            line = f"coordinates = {[*renamed]}"
        text = scene(
            body("door", 1.0, inertia),
            hinge,
            body(inertia=inertia),
            joint(kind, axis, line),
            dimensions=dimensions,
        )
        module = load(text, "aba")
        all_q = ("hinge_angle", *renamed, *positions[len(plain) :])
        all_v = ("hinge_angle_dot", *(f"{name}_dot" for name in renamed), *velocities[len(plain) :])
        assert (*all_q, *all_v) == module.STATES
        assert tuple(range(len(all_q))) == module.POSITIONS
        assert dimensions == module.DIMENSIONS
        spun = len(positions) > len(velocities)
        assert len(module.QUATERNIONS) == spun
        for indices in module.QUATERNIONS:
            assert [module.STATES[i][-3:] for i in indices] == ["_qw", "_qx", "_qy", "_qz"]
            assert module.initial_state()[list(indices)].tolist() == [1, 0, 0, 0]
        units = [module.UNITS[name] for name in module.STATES]
        assert units[len(all_q)] == "rad/s"
        for name, unit in zip(positions, units[1:], strict=False):
            assert unit == ("rad" if "angle" in name else "" if "_q" in name else "m")


def test_orientation_in_the_plane() -> None:
    """One angle; it counts in the pose, whole turns and all."""
    text = scene(
        body("a", 1.0, "0.1"),
        joint("revolute", "orientation_deg = 450", "r_child = [-1, 0]", child="a", name="i"),
        body(inertia="0.1"),
        joint("weld", "orientation_deg = -30", "r_parent = [1, 0]", parent="a"),
        dimensions=2,
    )
    module = load(text, "aba")
    poses = module.body_poses(0.0, [0.25, 0.0])
    turned = np.radians(450) + 0.25
    c, s = np.cos(turned), np.sin(turned)
    assert apart(poses, [[c, s, turned], [2 * c, 2 * s, turned - np.pi / 6]]) < EXACT


# The plane is a part of space.


OUT_OF_PLANE = re.compile(
    r"(inertia_.*_(xx|yy|xy|xz|yz)|(moment|delta)_.*_z|(omega|alpha)_.*_[xy])"
)


@pytest.mark.every(3)
@pytest.mark.parametrize("name", ["acrobot", "cart_pole", "chain", "two_body_forced"])
def test_the_plane_does_not_pay_for_space(route: str, name: str) -> None:
    """No step of a planar program is about what the plane makes zero."""
    words = engine(name, route, leave_out=ASIDE).system.program.names.values()
    assert [word for word in words if OUT_OF_PLANE.fullmatch(word)] == []
    top = engine("spinning_top", route, leave_out=ASIDE).system.program.names.values()
    assert any(OUT_OF_PLANE.fullmatch(word) for word in top)


def particle(kind: str, dimensions: int, *lines: str) -> Engine:
    """A particle on a joint."""
    text = scene(body(mass=2.0, inertia="0"), joint(kind, *lines), dimensions=dimensions)
    return engine(text, "aba", leave_out=ASIDE)


def test_simple_things_are_simple() -> None:
    """A pendulum, a weight on a slide: the operations that one would write by hand."""
    pendulum = particle("revolute", 2, "r_child = [-0.5, 0]").module
    assert pendulum.COST["derivative"]["total"] <= 4  # g cos(q) / r
    slide = particle("prismatic", 2, "axis = [0, 1]").module
    assert slide.COST["derivative"]["total"] == 0  # -g, which is done once
    swing = particle("revolute", 3, "axis = [0, 1, 0]", "r_child = [0, 0, 0.5]").module
    assert swing.COST["derivative"]["total"] <= 5
    free = '[[joints]]\nname = "j"\ntype = "free"\nchild = "b"\n'
    tumbling = engine(scene(body(), free, gravity=False), "aba", leave_out=ASIDE).module
    assert tumbling.COST["derivative"]["total"] <= 100
