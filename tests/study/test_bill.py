"""The bill of effects: counts that are those of the modules, motions by closed forms."""

import math
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from engine import text_of

from eomgen.commands.main import main
from eomgen.model.elaborate import elaborate
from eomgen.run.module import load_module
from eomgen.scene.reader import parse_scene, read_scene
from eomgen.study import timing
from eomgen.study.cost.bill import Bill, Item, bill
from eomgen.study.cost.omission import Run, distances
from eomgen.study.cost.variants import (
    complete,
    removed,
    variants,
    without_effects,
    without_velocity_forces,
)

STONE = """
name = "stone"
bodies = [{ name = "a", mass = 2.0, inertia_com = 0.3 }]
joints = [{ name = "flight", type = "free", child = "a" }]
simulation = { t_end = 2.0 }
[[effects]]
type = "gravity"
g = 9.81
[[effects]]
type = "drag"
name = "air"
body = "a"
linear = 0.5
"""
WHEEL = """
name = "wheel"
bodies = [{ name = "a", mass = 2.0, inertia_com = 0.3 }]
joints = [{ name = "axle", type = "revolute", parent = "world", child = "a", coordinate = "q" }]
simulation = { t_end = 1.0 }
effects = [{ type = "motor", name = "drive", joint = "axle", torque = 0.6 }]
"""
ARM = """
name = "arm"
simulation = { t_end = 0.5 }
chains = [
    { name = "link", count = 2, mass = 1.0, inertia_com = 0.1, r_parent = [0.5, 0], \
r_child = [-0.5, 0] },
]
bodies = [
    { name = "hand", mass = 0.5, inertia_com = 0.02 },
    { name = "peg", mass = 0.5, inertia_com = 0.02 },
]
joints = [
    { name = "wrist", type = "revolute", parent = "link_2", child = "hand", r_parent = [0.5, 0], \
r_child = [-0.1, 0], coordinate = "r" },
    { name = "nail", type = "prismatic", parent = "world", child = "peg", axis = [1, 0], \
coordinate = "q" },
]
[[effects]]
type = "gravity"
g = 9.81
[[effects]]
type = "joint_spring"
name = "first"
joint = "link_joint_1"
stiffness = 4.0
[[effects]]
type = "joint_spring"
name = "second"
joint = "link_joint_2"
stiffness = 3.0
[[effects]]
type = "motor"
name = "command"
joint = "link_joint_2"
torque = "input"
[[effects]]
type = "controller"
name = "own"
states = { z = { rate = "command - z" } }
torques = { link_joint_1 = "2*z" }
[initial]
q = { r = 0.3 }
v = { q_dot = 2.0, link_joint_1_angle_dot = 3.0 }
"""


@pytest.fixture(autouse=True)
def in_little_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Times are not looked at here."""
    monkeypatch.setattr(timing, "TIMING", 0.0)


@cache
def costed(text: str, *, motion: float = 10.0, each: bool = False) -> Bill:
    """The bill of a scene's text."""
    scene = parse_scene(text)
    return bill(scene, variants(scene, each=each), motion=motion)


def items(found: Bill) -> dict[str, Item]:
    """By their labels."""
    return {item.label: item for item in found.items}


def counted(scene: object) -> int:
    """Operations of a derivative as the scene's whole module says."""
    total: int = load_module(text_of(scene)).COST["derivative"]["total"]
    return total


@pytest.mark.every(2)
@pytest.mark.parametrize("each", [False, True])
def test_counts_are_those_of_the_modules(each: bool) -> None:
    """Of the whole, of the mechanism, without each effect and without each type of them; nothing is
    lost between them.
    """
    scene = parse_scene(ARM)
    found = costed(ARM, motion=0.0, each=each)
    by_label = items(found)
    assert found.operations == counted(scene)
    assert found.bare_operations == counted(scene.replaced(effects=()))
    labels = ["gravity", "2 joint_spring", "motor (command)", "controller (own)"]
    if each:
        labels[1:2] = ["joint_spring (first)", "joint_spring (second)"]
    assert list(by_label) == [*labels, "velocity forces"]
    assert by_label["motor (command)"].needed_by == ("own",)
    springs = [e for e in scene.effects if e.type == "joint_spring"][: 1 if each else 2]
    item = by_label[labels[1]]
    assert item.operations == found.operations - counted(removed(scene, springs)) > 0
    assert (by_label["controller (own)"].states, by_label["controller (own)"].inputs) == (1, 0)
    known = [item.operations for item in found.items if item.kind == "effect"]
    assert found.bare_operations + sum(known) + found.shared[0] == found.operations
    assert all(item.seconds != 0 for item in found.items if not item.needed_by)


def test_inputs_and_removed_effects() -> None:
    """An input is counted with its effect, and its parameters go with it."""
    scene = read_scene("two_body_forced").replaced(route="aba")
    found = items(bill(scene, without_effects(scene), motion=0.0))
    assert found["2 external_force"].inputs == 4
    assert found["motor (tau)"].inputs == 1
    (air,) = (part for part in without_effects(parse_scene(STONE)) if "air" in part.label)
    assert air.model is not None
    assert not [p for p in air.model.parameters if p.name.startswith("air")]
    bare = parse_scene(STONE[: STONE.index('[[effects]]\ntype = "drag"')])
    outputs = elaborate(bare).outputs
    assert text_of(replace(air.model, outputs=outputs)) == text_of(bare)


def test_routes() -> None:
    """Each with its operations or why not; those of the route taken are the scene's own."""
    found = costed(WHEEL, motion=0.0)
    routes = {route.route: route for route in found.routes}
    assert set(routes) >= {"closed", "ldl", "aba"}
    (taken,) = (route for route in found.routes if route.words == "taken")
    assert taken.operations == found.operations
    for name, route in routes.items():
        scene = parse_scene(f'route = "{name}"\n{WHEEL}')
        assert route.operations == counted(scene)
    kept = STONE.replace('name = "stone"', 'name = "stone"\nleave_out = ["velocity_forces"]')
    closed = {route.route: route for route in costed(kept, motion=0.0).routes}["closed"]
    assert closed.operations is None
    assert "'velocity_forces'" in closed.words


def test_motion_without_gravity() -> None:
    """From rest a stone stays without gravity, and falls ½ g t² without drag, instead of
    g/k (t - (1 - exp(-k t))/k), k = c/m.
    """
    found = costed(STONE)
    by_label, g, k, t = items(found), 9.81, 0.25, 2.0

    def fallen(t: float) -> float:
        return g / k * (t - (1 - math.exp(-k * t)) / k)

    assert found.extent == pytest.approx(fallen(t), rel=1e-6)
    gravity, air = by_label["gravity"].change, by_label["drag (air)"].change
    assert gravity is not None and air is not None
    assert gravity.relative == pytest.approx(1.0, rel=1e-9)
    late = next(x for x in np.linspace(0, t, 1001) if fallen(x) > 0.01 * fallen(t))
    assert gravity.since == pytest.approx(late, abs=1e-9)
    apart = g * t * t / 2 - fallen(t)
    assert air.relative == pytest.approx(apart / fallen(t), rel=1e-5)
    assert air.distance == pytest.approx(apart, rel=1e-5)
    assert (air.body, air.until, air.ended) == ("a", t, "")
    assert gravity.angle == air.angle == 0


def test_motion_of_turning() -> None:
    """A wheel about its centre moves though no centre does: rms radius times 2 sin(½ angle)."""
    found = costed(WHEEL)
    change = items(found)["motor (drive)"].change
    assert change is not None
    angle = 0.5 * 0.6 / 0.3
    assert found.extent == pytest.approx(math.sqrt(0.3 / 2) * 2 * math.sin(angle / 2), rel=1e-6)
    assert change.relative == pytest.approx(1.0)
    assert change.angle == pytest.approx(angle, rel=1e-6)
    assert change.distance == 0


def test_motion_of_a_driven_joint() -> None:
    """A wheel is driven to and fro; left to itself it goes on as fast as it starts."""
    free = WHEEL[: WHEEL.index("effects")].replace("t_end = 1.0", "t_end = 1.5")
    drive = '{ type = "driven", name = "crank", joint = "axle", coordinate = "0.4*sin(2*t)" }'
    other = (
        'bodies = [{ name = "b", mass = 1e-9, inertia_com = 1e-9 }, '
        '{ name = "a", mass = 2.0, inertia_com = 0.3 }]\n'
        'joints = [{ name = "idle", type = "revolute", parent = "world", child = "b" }, '
    )
    start = free.index("bodies")
    text = free[:start] + other + free[free.index("joints = [") + len("joints = [") :]
    change = items(costed(f"{text}effects = [{drive}]"))["driven (crank)"].change
    assert change is not None
    assert change.angle == pytest.approx(0.8 * 1.5 - 0.4 * math.sin(3.0), rel=1e-6)


def test_distance_of_all_mass() -> None:
    """By points of mass that make up the bodies, in space; and it sees no difference in place."""
    rng = np.random.default_rng(5)
    points = rng.normal(size=(6, 3))
    points -= points.mean(axis=0)
    square = np.sum(points * points)
    inertia = 0.2 * (square * np.eye(3) - points.T @ points)
    entries = [float(inertia[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    text = f"""
    name = "lump"
    dimensions = 3
    bodies = [{{ name = "a", mass = 1.2, inertia_com = {entries} }}]
    joints = [{{ name = "f", type = "free", child = "a" }}]
    """
    model = elaborate(parse_scene(text))
    poses = []
    for _ in range(2):
        turned, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        turned *= np.sign(np.linalg.det(turned))
        poses.append(np.column_stack((turned, rng.normal(size=3))))
    one, two = (pose[:, :3] @ points.T + pose[:, 3:] for pose in poses)
    expected = math.sqrt(np.mean(np.sum((one - two) ** 2, axis=0)))
    found = distances(model, poses[0][None, None], poses[1][None, None])
    assert found == pytest.approx([expected], rel=1e-12)
    assert distances(model, poses[0][None, None], poses[0][None, None]) == [0.0]


def test_nothing_that_moves() -> None:
    """No share of a motion that is none."""
    still = costed(STONE.replace("9.81", "0.0"))
    assert all(math.isnan(item.change.relative) for item in still.items if item.change)
    assert all(item.change.percent == "-" for item in still.items if item.change)


def test_what_a_scene_leaves_out() -> None:
    """Velocity forces and locked coordinates: measured against the scene that has them."""
    bare = ARM.replace("[initial]\nq = { r = 0.3 }\n", "[initial]\n")
    text = 'leave_out = ["velocity_forces"]\nlocked = { r = 0.3 }\n' + bare
    scene = parse_scene(text)
    found = items(costed(text))
    forces, locked = found["velocity forces"], found["1 locked coordinate"]
    assert forces.kind == locked.kind == "left out"
    assert forces.operations == counted(scene.replaced(leave_out=())) - counted(scene) > 0
    assert locked.states == 2
    freed = parse_scene('leave_out = ["velocity_forces"]\n' + ARM)
    assert locked.operations == counted(freed) - counted(scene)
    by_label = {part.label: part for part in complete(scene)}
    model = by_label["1 locked coordinate"].model
    assert model is not None
    assert model.initial_q == elaborate(freed).initial_q
    assert locked.change is not None and locked.change.relative > 1e-3
    assert without_velocity_forces(scene) == ()
    kept = items(costed(ARM))["velocity forces"]
    assert kept.kind == "mechanism"
    assert kept.operations == counted(parse_scene(ARM)) - counted(freed)


def test_time_runs_out() -> None:
    """Then motions are compared as far as they got, and that is said."""
    found = costed(STONE, motion=1e-9)
    for item in found.items:
        assert item.change is not None
        assert item.change.until < 2.0
        assert item.change.ended


def test_interrupted(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ctrl-C ends all motions, not one of them; the costs, which are known, are kept."""

    def interrupt(*_: object, **__: object) -> Run:
        raise KeyboardInterrupt

    monkeypatch.setattr("eomgen.run.integrate.all_finite", interrupt)
    found = costed.__wrapped__(STONE)
    assert found.stopped and found.extent is None and found.operations > 0
    assert all(item.change is None for item in found.items)
    assert main(["effects", "pendulum", "-o", str(tmp_path)]) == 130
    out, err = capsys.readouterr()
    assert "one derivative takes" in out and "pendulum_effects.png" in out
    assert err == "eomgen: pendulum: interrupted; motions are not compared\n"


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The table adds up, a line a type or an effect; a figure; nothing wider than a terminal."""
    scene = tmp_path / "arm.toml"
    scene.write_text(ARM, "utf-8")
    assert main(["effects", str(scene), "-o", str(tmp_path)]) == 0
    output = capsys.readouterr()
    assert output.err == ""
    lines = output.out.splitlines()
    assert max(map(len, lines)) <= 100
    column = [
        int(found[1])
        for line in lines
        if (found := re.match(r"    [a-z0-9 ()_]*?  +(-?\d+) +-?[\d.]+%", line))
        and "velocity" not in line
    ]
    whole = int(re.match(r"arm: one derivative takes (\d+) operations", lines[0])[1])
    assert sum(column) == whole
    assert "others need it: own" in output.out
    assert (tmp_path / "arm_effects.png").stat().st_size > 10_000
    assert main(["effects", str(scene), "-o", str(tmp_path), "--each", "--no-motion"]) == 0
    short = capsys.readouterr().out
    assert "joint_spring (second)" in short and "2 joint_spring" not in short
    assert "motion:" not in short and "from 1 %" not in short


def test_command_of_a_scene_without_effects(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The mechanism itself is all there is."""
    scene = tmp_path / "wheel.toml"
    scene.write_text(WHEEL[: WHEEL.index("effects")], "utf-8")
    assert main(["effects", str(scene), "-o", str(tmp_path)]) == 0
    assert "the mechanism itself" in capsys.readouterr().out


def test_rigid_contacts_are_reported_beside_the_derivative() -> None:
    """What is computed when they strike or hold is no part of it; without contacts nothing is."""
    floor = '[[effects]]\ntype = "contact"\nname = "floor"\nlaw = "impact"\nbody = "a"\n'
    found = costed(STONE + floor + "radius = 0.1\nrestitution = 0.5\n", motion=0.0)
    assert set(found.at_contacts) == {"gaps", "gap_rates", "impact", "held"}
    assert found.at_contacts["impact"] > 0 and found.at_contacts["held"] > 0
    assert found.operations == costed(STONE, motion=0.0).operations
    assert not costed(STONE, motion=0.0).at_contacts
