"""Locked coordinates against welds, velocity forces left out; the page; what is refused."""

import json
import math
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from campaign import some
from engine import DERIVATIVES, along, apart, engine, exact
from scenes import effect, refusal
from spatial_trees import PLANE, SPACE, random_spatial_tree

from eomgen.base.errors import SceneError
from eomgen.codegen.backends.javascript import mechanism
from eomgen.codegen.interface import interface_of
from eomgen.commands.main import main
from eomgen.dynamics.start.singularity import check_nonsingular
from eomgen.model.elaborate import elaborate
from eomgen.pipeline import generate
from eomgen.scene.reader import parse_scene
from eomgen.study.linear.equilibrium import equilibrium

ROUTES = ("aba", "ldl")

LEG = """\
name = "leg"
outputs = "all"
dimensions = {dimensions}
[[bodies]]
name = "thigh"
mass = 7.0
inertia_com = {inertia}
[[bodies]]
name = "shank"
mass = 3.1
inertia_com = {inertia}
[[bodies]]
name = "foot"
mass = 0.9
inertia_com = {inertia}
[[points]]
name = "toe"
body = "foot"
at = {toe}
[[joints]]
name = "hip"
type = "{hip}"
parent = "world"
child = "thigh"
r_child = {up}
[[joints]]
name = "knee"
parent = "thigh"
child = "shank"
r_parent = {down}
r_child = {up}
{knee}
[[joints]]
name = "ankle"
type = "revolute"
parent = "shank"
child = "foot"
r_parent = {down}
r_child = {toe}
[[effects]]
type = "gravity"
g = 9.81
[[effects]]
type = "drag"
name = "air"
bodies = "all"
quadratic = 0.3
{more}
"""


def leg(dimensions: int, knee: str, more: str = "") -> str:
    """Three bodies, of which only the knee differs."""
    plane = dimensions == PLANE
    return LEG.format(
        dimensions=dimensions,
        inertia="0.12" if plane else "[0.12, 0.1, 0.03, 0.01, 0, 0.002]",
        toe="[0.07, 0.02]" if plane else "[0.07, 0.02, 0.01]",
        hip="revolute" if plane else "ball",
        up="[0, 0.2]" if plane else "[0.01, 0, 0.2]",
        down="[0, -0.2]" if plane else "[0, 0.02, -0.2]",
        knee=knee,
        more=more,
    )


HINGE, WELD = 'type = "revolute"\n', 'type = "weld"\n'
PAIRS = [  # dimensions, the joint, what is locked, the weld in its place
    (PLANE, HINGE, "knee_angle_deg = 20", WELD + "orientation_deg = 20"),
    (PLANE, HINGE, "knee_angle_deg = -90", WELD + "orientation_deg = -90"),
    (PLANE, HINGE + "orientation_deg = 30", "knee_angle_deg = 15", WELD + "orientation_deg = 45"),
    (PLANE, HINGE, "knee_angle = 0", WELD),
    (
        SPACE,
        HINGE + "axis = [0, 1, 0]",
        "knee_angle_deg = 35",
        WELD + "orientation_deg = [0, 35, 0]",
    ),
    (
        SPACE,
        HINGE + "axis = [1, 0, 0]",
        "knee_angle_deg = 90",
        WELD + "orientation_deg = [90, 0, 0]",
    ),
    (
        SPACE,
        'type = "universal"\naxes = [[0, 1, 0], [1, 0, 0]]',
        "knee_angle_1_deg = 25\nknee_angle_2_deg = -70",
        WELD + "orientation_deg = [-70, 25, 0]",
    ),
    (
        SPACE,
        'type = "cylindrical"\naxis = [0, 0, 1]',
        "knee_slide = 0\nknee_angle_deg = 25",
        WELD + "orientation_deg = [0, 0, 25]",
    ),
]


@pytest.mark.parametrize(
    ("dimensions", "joint", "locked", "weld", "route"),
    [(*pair, r) for i, pair in enumerate(PAIRS) for r in some(ROUTES[i % 2 :][:1], ROUTES)],
)
@pytest.mark.every(6)
def test_locked_is_welded(dimensions: int, joint: str, locked: str, weld: str, route: str) -> None:
    """The same numbers at the same cost: a locked joint is gone from the equations."""
    held = engine(leg(dimensions, joint, f"[locked]\n{locked}"), route)
    welded = engine(leg(dimensions, weld), route)
    assert held.module.STATES == welded.module.STATES
    for output in ("derivative", "jacobian", "joint_forces", "body_poses"):
        assert held.module.COST[output] == welded.module.COST[output], output
    rng = np.random.default_rng(7)
    for _ in range(3):
        y = held.random_state(rng)
        for output in ("jacobian", "parameter_jacobian", "derivative", *held.model.outputs):
            if output.endswith("_dynamics"):
                continue
            own, other = (getattr(e.module, output)(0.0, y) for e in (held, welded))
            assert apart(own, other) < 1e-13, output


def test_a_locked_slide_is_where_it_was_locked() -> None:
    """A slide along an axis of a turned joint, held at 0.3 m."""
    slide = 'type = "prismatic"\naxis = [0.6, 0.8]\norientation_deg = 40'
    held = engine(leg(PLANE, slide, "[locked]\nknee_slide = 0.3"), "aba")
    moved = 'type = "weld"\norientation_deg = 40\n'
    text = leg(PLANE, moved).replace("r_child = [0, 0.2]\ntype", "r_child = [-0.18, -0.04]\ntype")
    assert text != leg(PLANE, moved)
    welded = engine(text.replace("r_child = [0, 0.2]\n" + moved, ""), "aba")
    y = held.random_state(np.random.default_rng(3))
    for output in ("derivative", "jacobian", "body_poses", "kinetic_energy", "momentum"):
        own, other = (getattr(e.module, output)(0.0, y) for e in (held, welded))
        assert apart(own, other) < 1e-13, output
    costs = [e.module.COST["derivative"]["total"] for e in (held, welded)]
    assert costs[0] == costs[1]


def test_effects_see_locked_coordinates() -> None:
    """A spring at a locked joint holds energy and does nothing; a formula reads the value."""
    more = """
[[effects]]
type = "joint_spring"
name = "stiff"
joint = "knee"
stiffness = 50.0
[[effects]]
type = "motor"
name = "calf"
joint = "ankle"
torque = "3*knee_angle + knee_angle_dot"
[locked]
knee_angle = 0.5
"""
    e = engine(leg(PLANE, HINGE, more))
    plain = engine(leg(PLANE, WELD + f"orientation_deg = {math.degrees(0.5)}"))
    y = e.random_state(np.random.default_rng(1))
    energies = (m.potential_energy(0.0, y) for m in (e.module, plain.module))
    assert apart(next(energies) - next(energies), 0.5 * 50.0 * 0.5**2) < 1e-13
    forces = [m.applied_force(0.0, y) for m in (e.module, plain.module)]
    assert apart(forces[0] - forces[1], [0.0, 1.5]) < 1e-13


def test_a_held_free_body_is_held_by_something() -> None:
    """A free body with one coordinate locked slides on a wall, which takes its weight sideways."""
    text = """\
name = "bead"
outputs = "all"
[[bodies]]
name = "bead"
mass = 2.0
inertia_com = 0.1
[[joints]]
name = "loose"
type = "free"
child = "bead"
[[effects]]
type = "gravity"
g = 9.81
direction = [0.6, -0.8]
[locked]
bead_x = 0.7
"""
    e = engine(text)
    assert e.module.STATES == ("bead_y", "bead_angle", "bead_y_dot", "bead_angle_dot")
    y = np.array([0.3, 0.2, 1.0, -2.0])
    assert apart(e.module.derivative(0.0, y), [1.0, -2.0, -0.8 * 9.81, 0.0]) < 1e-14
    assert apart(e.module.joint_forces(0.0, y), [[0.6 * 2.0 * 9.81, 0.0, 0.0]]) < 1e-13
    assert apart(e.module.body_poses(0.0, y), [[0.7, 0.3, 0.2]]) < 1e-15


# Velocity forces left out.

DOUBLE = """\
name = "double"
outputs = "all"
leave_out = ["velocity_forces"]
[[bodies]]
name = "one"
mass = 1.5
inertia_com = 0
[[bodies]]
name = "two"
mass = 0.8
inertia_com = 0
[[joints]]
name = "first"
type = "revolute"
parent = "world"
child = "one"
r_child = [0, 0.6]
[[joints]]
name = "second"
type = "revolute"
parent = "one"
child = "two"
r_child = [0, 0.9]
[[effects]]
type = "gravity"
g = 9.81
"""


@pytest.mark.parametrize("route", ["", *ROUTES])
def test_double_pendulum_without_velocity_forces(route: str) -> None:
    """M q̈ = -G with M and G by hand, in relative angles."""
    e = engine(DOUBLE, route)
    m, n, a, b, g = 1.5, 0.8, 0.6, 0.9, 9.81
    for q, r, v, w in np.random.default_rng(5).uniform(-3.0, 3.0, (5, 4)):
        inner = n * b * b + n * a * b * np.cos(r)
        M = np.array(
            [[(m + n) * a * a + n * b * b + 2 * n * a * b * np.cos(r), inner], [inner, n * b * b]]
        )
        outer = n * g * b * np.sin(q + r)
        G = np.array([(m + n) * g * a * np.sin(q) + outer, outer])
        found = e.module.derivative(0.0, np.array([q, r, v, w]))
        assert apart(found, [v, w, *np.linalg.solve(M, -G)]) < 1e-13


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize(
    ("dimensions", "seed"), [(PLANE, 3), (PLANE, 38), (SPACE, 11), (SPACE, 14)]
)
@pytest.mark.every(6)
def test_without_velocity_forces(dimensions: int, seed: int, route: str) -> None:
    """V is 0 and h is G; accelerations, inverse dynamics and joint forces are those of the whole
    scene at rest in the same place; what moves still moves; the Jacobian is exact.
    """
    text = random_spatial_tree(seed, dimensions, 5)[1]
    e = engine(text.replace("\n", '\nleave_out = ["velocity_forces"]\n', 1), route)
    whole = engine(text, "aba", leave_out=DERIVATIVES)
    rng = np.random.default_rng(seed)
    y, u = e.random_state(rng), e.random_inputs(rng)
    nq, nv = len(e.model.coordinates), len(e.model.velocities)
    rest = [*exact(y[:nq]), *exact(np.zeros(nv))]
    extra = list(exact(rng.uniform(-5.0, 5.0, nv)))
    assert not np.any(e.exactly("velocity_force", y, u))
    assert e.module.COST["velocity_force"]["total"] == 0
    assert np.any(whole.exactly("velocity_force", y, u))
    pairs = [
        (e.exactly("bias_force", y, u), whole.exactly("gravity_force", y, u)),
        (e.exactly("derivative", y, u)[nq:], whole.exactly("derivative", rest, u)[nq:]),
        (e.exactly("joint_forces", y, u), whole.exactly("joint_forces", rest, u)),
    ]
    for name in ("forward_dynamics", "inverse_dynamics"):
        own, other = e.exactly(name, y, u, extra=extra), whole.exactly(name, rest, u, extra=extra)
        pairs.append((own, other))
    same = ("kinetic_energy", "momentum", "body_velocities", "mass_matrix")
    pairs += [(e.exactly(name, y, u), whole.exactly(name, y, u)) for name in same]
    pairs.append((e.exactly("derivative", y, u)[:nq], whole.exactly("derivative", y, u)[:nq]))
    for own, other in pairs:
        assert apart(own, other) < 1e-13
    jacobian = e.exactly("jacobian", y, u)
    for i, unit in enumerate(exact(np.eye(len(y)))):
        if i not in {i for four in e.module.QUATERNIONS for i in four}:
            rate = along(lambda z: e.exactly("derivative", z, u), exact(y), unit)
            assert apart(jacobian[:, i], rate) < 1e-13


def test_driven_and_without_velocity_forces() -> None:
    """What stays is what the driven acceleration takes: M_ff v̇ = -G - M_fd f''."""
    drive = effect("driven", name="swing", joint="first", coordinate="0.5*sin(2*t)")
    e = engine(DOUBLE + drive)
    n, a, b, g = 0.8, 0.6, 0.9, 9.81
    for t, r, w in np.random.default_rng(5).uniform(-3.0, 3.0, (5, 3)):
        f, fdd = 0.5 * np.sin(2 * t), -2.0 * np.sin(2 * t)
        force = (n * b * b + n * a * b * np.cos(r)) * fdd
        y = np.array([r, w])
        assert apart(e.module.velocity_force(t, y), [force]) < 1e-13
        rate = -(n * g * b * np.sin(f + r) + force) / (n * b * b)
        assert apart(e.module.derivative(t, y), [w, rate]) < 1e-13


# The page.


@pytest.mark.skipif(shutil.which("node") is None, reason="runs JavaScript in Node")
def test_poses_of_every_function_in_javascript() -> None:
    """`bodyPoses` of a drive that uses every function, at many times."""
    formula = (
        "0.1*asin(0.5*sin(t)) + 0.2*acos(0.3*cos(t)) + atan(t) + exp(-t) + log(1 + t) + tanh(t)"
        " + sqrt(1 + t) + abs(t - 1) + step(t - 2) + atan2(t, 2) + min(t, 1.5) + max(t, 0.5)"
        " + tan(0.1*t) + (t if t < 1.2 else 0.3)"
    )
    text = DOUBLE + (
        f'[[effects]]\ntype = "driven"\nname = "all"\njoint = "first"\ncoordinate = "{formula}"\n'
    )
    e = engine(text)
    y, times = np.array([0.4, -1.0]), [0.0, 0.4, 1.1, 1.3, 1.9, 2.7]
    p = list(e.module.PARAMETERS.values())
    call = f"mechanism.bodyPoses(t, {json.dumps(y.tolist())}, {json.dumps(p)}, [])"
    script = f"{mechanism(e.system.program, interface_of(e.system))}\n"
    script += f"console.log(JSON.stringify({json.dumps(times)}.map((t) => [...{call}])));"
    answer = subprocess.run(["node", "-e", script], capture_output=True, text=True, check=True)
    expected = [e.module.body_poses(t, y).ravel() for t in times]
    assert apart(json.loads(answer.stdout), expected) < 1e-14


# What is reported to a user.

CART = (
    DOUBLE.replace('leave_out = ["velocity_forces"]\n', "")
    + """\
[[bodies]]
name = "ball"
mass = 1.0
inertia_com = 0.1
[[joints]]
name = "loose"
type = "free"
child = "ball"
[[effects]]
type = "driven"
name = "swing"
joint = "first"
coordinate = "A*sin(w*t)"
[parameters]
A = 0.3
w = 4.0
"""
)
MORE = '[[effects]]\ntype = "driven"\nname = "{}"\njoint = "{}"\ncoordinate = {}\n'
AT = "effects[1].coordinate"
BAD = [
    ("A*sin", "first_angle*sin", f"{AT}: 'first_angle' is the motion that the formula prescribes, "
     "which is circular; use t and parameters"),
    ("A*sin", "first_angle_dot*sin", f"{AT}: 'first_angle_dot' is the motion that the formula "
     "prescribes, which is circular; use t and parameters"),
    ("A*sin", "second_angle*sin", f"{AT}: 'second_angle' is part of the solution, which a "
     "prescribed motion cannot depend on; use t and parameters"),
    ("A*sin", "B*sin", f"{AT}: unknown parameter 'B'; give it a value in [parameters]"),
    ("A*sin(w*t)", "sqrt(t)", f"{AT}: it, its rate or its acceleration is not finite at t = 0; "
     "change the formula"),
    ("A*sin(w*t)", "A/t", f"{AT}: it, its rate or its acceleration is not finite at t = 0; change "
     "the formula"),
    ('joint = "first"', 'joint = "loose"', "effects[1].joint: 'loose' is a free joint, which "
     "'driven' does not act on; name a revolute or prismatic joint"),
    ("[parameters]", MORE.format("other", "first", 0.2) + "[parameters]", "effects[2].joint: "
     "'first' is driven by 'swing', too; give only one of them"),
    ("[parameters]", "[initial.q]\nfirst_angle_deg = 5\n[parameters]", "initial.q.first_angle_deg: "
     "'first_angle' is driven by 'swing'; leave it out"),
    ("[parameters]", "[initial.v]\nfirst_angle_dot = 5\n[parameters]", "initial.v.first_angle_dot: "
     "'first_angle' is driven by 'swing'; leave it out"),
    ("[parameters]", "[initial]\nq = [0, 0, 0, 0, 0]\n[parameters]", "initial.q: has 5 numbers for "
     "4 coordinates; give one each for second_angle, ball_x, ball_y, ball_angle"),
    ("[parameters]", "[locked]\nfirst_angle = 1\n[parameters]", "locked: 'first_angle' is driven "
     "by 'swing', too; give only one of them"),
    ("[parameters]", "[locked]\nsecond_angel = 1\n[parameters]", "locked.second_angel: no "
     "coordinate has this name (did you mean 'second_angle'?)"),
    ("[parameters]", "[locked]\nsecond_angle = 1\nsecond_angle_deg = 2\n[parameters]",
     "locked.second_angle_deg: second_angle is also given; give only one of them"),
    ("[parameters]", '[locked]\nsecond_angle = "1"\n[parameters]',
     "locked.second_angle: '1' is not a number; give one"),
    ("[parameters]", "[locked]\nsecond_angle = 1\n[initial.q]\nsecond_angle = 0\n[parameters]",
     "initial.q.second_angle: 'second_angle' is locked; leave it out"),
    ('outputs = "all"', 'outputs = "all"\nroute = "closed"', "route: 'closed' needs the closed "
     "form, and it takes no driven coordinate ('first_angle'); leave it out"),
    ('outputs = "all"', 'outputs = "all"\nform = "momentum"', "form: 'momentum' needs the closed "
     "form, and it takes no driven coordinate ('first_angle'); leave it out"),
    ('outputs = "all"', 'leave_out = ["friction"]', "leave_out[0]: unknown value 'friction'; "
     "known: velocity_forces"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "message"), BAD)
def test_bad_scenes(old: str, new: str, message: str) -> None:
    """Each a scene with one mistake, and the exact message for it."""
    assert CART.count(old) == 1
    text = CART.replace(old, new)
    assert refusal(lambda: generate(elaborate(parse_scene(text)))) == message


OTHERS = [
    ("[locked]\nhip_qx = 0", "", "locked.hip_qx: is part of a quaternion, which cannot be locked "
     "in part; give joint 'hip' type = 'weld'"),
    ("[locked]\nknee_angle = 1", 'route = "closed"\n', "route: 'closed' needs the closed form, and "
     "it takes no locked coordinate ('knee_angle'); leave it out"),
    ("", 'leave_out = ["velocity_forces"]\nroute = "closed"\n', "route: 'closed' needs the closed "
     "form, and it leaves nothing out ('velocity_forces'); leave it out"),
    ("", 'outputs = ["driving_forces"]\n', "outputs[0]: 'driving_forces' needs driven joints, "
     "and there are none"),
]  # fmt: skip


@pytest.mark.parametrize(("tail", "head", "message"), OTHERS)
def test_bad_scenes_in_space(tail: str, head: str, message: str) -> None:
    """The same for quaternions, and for what keeps a scene from the closed form."""
    text = leg(SPACE, HINGE, tail).replace('outputs = "all"\n', head, 1)
    text = text.replace(
        '[[effects]]\ntype = "drag"\nname = "air"\nbodies = "all"\nquadratic = 0.3\n', ""
    )
    assert refusal(lambda: generate(elaborate(parse_scene(text)))) == message


def test_a_singular_drive_is_no_fault() -> None:
    """A massless body may be driven; one that hangs free on it may not."""
    light = CART.replace("mass = 1.5", "mass = 0")
    check_nonsingular(elaborate(parse_scene(light)))
    with pytest.raises(SceneError, match="body 'two': nothing resists 'second_angle_dot'"):
        check_nonsingular(elaborate(parse_scene(light.replace("mass = 0.8", "mass = 0"))))


@pytest.mark.usefixtures("blank_figures")
def test_what_check_and_the_module_say(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Driven and locked coordinates with their values, and what is left out."""
    monkeypatch.setenv("EOMGEN_CACHE", str(tmp_path))
    path = tmp_path / "double.toml"
    text = CART.replace("[parameters]", "[locked]\nball_angle_deg = 90\n[parameters]")
    path.write_text(text.replace("outputs", 'leave_out = ["velocity_forces"]\noutputs', 1))
    assert main(["check", str(path)]) == 0
    said = capsys.readouterr().out
    assert "freedom     3 degrees of freedom" in said
    assert "driven      first_angle = (A * sin((w * t))) rad" in said
    assert f"locked      ball_angle = {math.pi / 2} rad" in said
    assert "left out    velocity forces" in said
    about = engine(path.read_text()).module.__doc__
    for line in ("first_angle = (A * sin((w * t)))", "ball_angle = 1.57", "Left out: velocity"):
        assert line in about
    assert main(["simulate", str(path), "--t-end", "0.2", "-o", str(tmp_path)]) == 0
    assert main(["linearise", str(path), "--at", "initial"]) == 0


def test_equilibrium_of_a_driven_scene() -> None:
    """At t = 0, with rates as they are then: the bob of a turning arm hangs off the vertical."""
    drive = '[[effects]]\ntype = "driven"\nname = "swing"\njoint = "first"\ncoordinate = "2*t"\n'
    module = engine(DOUBLE.replace('leave_out = ["velocity_forces"]\n', "") + drive).module
    found = equilibrium(module, np.zeros(2))
    assert apart(module.derivative(0.0, found.y), np.zeros(2)) < 1e-9
