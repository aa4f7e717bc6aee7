"""Generated modules verified: the independent solver, the bounds, what is found out, evidence."""

import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from campaign import some
from engine import MP, read
from gmpy2 import mpfr
from scenes import effect

from eomgen.base.errors import RunError
from eomgen.commands.main import main
from eomgen.dynamics.start.assembly import assembled
from eomgen.model.elaborate import elaborate, in_order
from eomgen.model.model import Model
from eomgen.pipeline import compile_program, python_module
from eomgen.run.failure import EndedRunError
from eomgen.run.integrate import integrate
from eomgen.run.module import load_module
from eomgen.scene.reader import find_scene, parse_scene
from eomgen.scene.schema import Simulation
from eomgen.store import generated_code, interfaced_program_of
from eomgen.study.diagnosis import problem_of
from eomgen.study.precision.extended import doubles, extended, extended_digits
from eomgen.study.verification import drift as drifting
from eomgen.study.verification import horizon as horizons
from eomgen.study.verification import sampled as sampling
from eomgen.study.verification.free_bodies import FreeBodies
from eomgen.study.verification.hard_states import KINDS, hard_states
from eomgen.study.verification.horizon import horizon as horizon_of
from eomgen.study.verification.judging import judged
from eomgen.study.verification.laws import kept
from eomgen.study.verification.roundings import Roundings
from eomgen.study.verification.truth import Truth
from eomgen.study.verification.verify import OUTPUTS, Verified, verify

SCREW = """
name = "screw"
dimensions = 3
parameters = { m = 1.7, J = 0.3 }
simulation = { t_end = 5.0 }
bodies = [
    { name = "a", mass = "m", inertia_com = [0.2, "J", 0.25, 0.01, -0.02, 0.03] },
    { name = "b", mass = 0.8, inertia_com = [0.05, 0.06, 0.07] },
    { name = "c", mass = 0.4, inertia_com = 0 },
    { name = "d", mass = 0.6, inertia_com = [0.02, 0.03, 0.04] },
    { name = "e", mass = 0.3, inertia_com = [0.02, 0.03, 0.04] },
    { name = "f", mass = 0.2, inertia_com = [0.02, 0.03, 0.04] },
]
joints = [
    { name = "ja", type = "revolute", parent = "world", child = "a", axis = [0.6, 0.0, 0.8], \
r_parent = [0.1, 0.2, 0.3], r_child = [-0.4, 0.1, 0.0], orientation_deg = [90.0, 0.0, 180.0], \
motor_inertia = 0.002, gear_ratio = 20.0 },
    { name = "jb", type = "universal", parent = "a", child = "b", r_parent = [0.3, 0.0, 0.1], \
r_child = [0.0, 0.2, -0.2] },
    { name = "jc", type = "cylindrical", parent = "b", child = "c", axis = [0.0, 1.0, 0.0], \
r_child = [0.3, 0.1, -0.2] },
    { name = "jd", type = "ball", parent = "a", child = "d", r_parent = [-0.3, 0.0, 0.1], \
r_child = [0.0, 0.0, 0.4] },
    { name = "je", type = "prismatic", parent = "d", child = "e", axis = [0.0, 0.0, 1.0], \
r_parent = [0.1, 0.1, 0.1] },
    { name = "jf", type = "planar", parent = "d", child = "f", r_parent = [0.0, 0.2, 0.1] },
]
effects = [
    { type = "gravity", g = 9.81 },
    { type = "driven", name = "drive", joint = "je", coordinate = "0.1*sin(3*t)" },
    { type = "spring", name = "cord", body_1 = "world", at_1 = [0.5, 0.5, 0.5], body_2 = "c", \
stiffness = 30.0, damping = 0.4, rest_length = 0.2 },
    { type = "motor", name = "tau", joint = "ja", torque = "input" },
]
"""
"""All joints of space but the free one, a rotor, a drive, a spring with damping, a motor."""

PENDULUM_ROUTES = ("closed", "ldl", "aba", "orthogonal")


@pytest.fixture(autouse=True)
def in_little_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Short runs will do."""
    monkeypatch.setattr(sampling, "MOST_OPERATIONS", 20_000)
    monkeypatch.setattr(drifting, "MOST_CALLS", 2_000)


@cache
def model_of(scene: str) -> Model:
    """A built-in scene's model, or one of a text."""
    return elaborate(read(scene))


def scene_of(scene: str) -> tuple[Model, Simulation]:
    """The same, and how the scene is to be run."""
    return model_of(scene), read(scene).simulation


def as_long(x: Any) -> Any:
    """An mpmath number as one of MPFR, exactly."""
    sign, digits, exponent, _ = x._mpf_
    return (-1) ** sign * mpfr(int(digits)) * mpfr(2) ** int(exponent)


def check(found: Verified, what: str) -> Any:
    """A line of the report."""
    return next(line for line in found.checks if line.what.startswith(what))


# The independent solver.


@pytest.mark.parametrize("scene", ["babyboot", "tumbling_body", "chain", "two_body_forced"])
def test_virtual_work_agrees_with_articulated_bodies_to_55_digits(scene: str) -> None:
    """Where all fixed rotations are exact the two ways share data, and nothing else."""
    model = replace(model_of(scene), form="velocity", outputs=())
    truth, rng = Truth(model), np.random.default_rng(3)
    count = len(model.coordinates) + len(model.velocities)
    y = np.array([MP.mpf(x) for x in rng.uniform(-3, 3, count)], dtype=object)
    for indices in map(list, model.quaternions):
        y[indices] /= MP.sqrt(sum(y[indices] ** 2))
    articulated = truth(np.array([0.3]), y[None])[:, 0]
    with extended_digits():
        vd = FreeBodies(model, 0.3, [as_long(x) for x in y]).vd
        off = abs(vd - [as_long(x) for x in articulated])
        assert max(off) <= 1e-55 * float(max(abs(vd)))


def test_virtual_work_on_all_joints_with_drive_rotor_and_spring() -> None:
    """Against LᵀDL factors in 60 digits, at a time when the drive moves."""
    model = replace(model_of(SCREW), outputs=())
    truth, rng = Truth(model), np.random.default_rng(4)
    y = rng.uniform(-1, 1, len(model.coordinates) + len(model.velocities))
    for indices in map(list, model.quaternions):
        y[indices] /= np.linalg.norm(y[indices])
    with extended_digits():
        whole = extended(y)
        for indices in map(list, model.quaternions):
            whole[indices] = whole[indices] / (whole[indices] @ whole[indices]) ** mpfr(0.5)
        vd = FreeBodies(model, 0.7, whole).vd
        # The axis 0.6, 0, 0.8 is rounded to doubles in one and made of unit length in the other.
        off = doubles(vd - truth.extended(mpfr(0.7), whole, {}, {}))
    assert np.max(np.abs(off)) <= 1e-14 * np.max(np.abs(doubles(vd)))


@pytest.mark.parametrize(
    ("formula", "t", "expected"),
    [
        ("t**3", 0.0, (0.0, 0.0)),
        ("2*t/3 + max(t, 0)**3", 0.0, (2 / 3, 0.0)),
        ("sin(3*t)", 0.25, (3 * np.cos(0.75), -9 * np.sin(0.75))),
        ("max(t, 0)", 0.0, None),
        ("t*abs(t)", 0.0, None),
    ],
)
def test_drives_have_exact_rates_and_none_at_a_corner(
    formula: str, t: float, expected: tuple[float, float] | None
) -> None:
    """What is 0 is 0, not what is left of a difference; nan where the two sides differ."""
    model = model_of(SCREW.replace("0.1*sin(3*t)", formula))
    y = np.zeros(len(model.coordinates) + len(model.velocities))
    with extended_digits():
        free = FreeBodies(model, t, y)
        rates = (float(free.v[-1]), float(free.driven_rates[0]))
    if expected is None:
        assert np.isnan(rates).all()
    else:
        assert np.allclose(rates, expected, rtol=1e-15, atol=0)


def test_kinetic_energy_of_free_bodies_has_their_mass_matrix() -> None:
    """T = ½ vᵀ M v, two sums that are made apart, where no drive moves anything."""
    model = replace(model_of("quadruped"), outputs=())
    rng = np.random.default_rng(5)
    y = rng.uniform(-1, 1, len(model.coordinates) + len(model.velocities) + len(model.extra))
    with extended_digits():
        free = FreeBodies(model, 0.0, y)
        twice = free.rates @ free.mass_matrix @ free.rates
        # Off the sphere of unit quaternions angular velocity is defined by its skew part alone.
        for indices in map(list, model.quaternions):
            assert len(indices) == 4
        assert abs(free.kinetic_energy - twice / 2) <= 1e-50 * float(free.kinetic_energy)


# States.


def test_hard_states_are_what_their_kinds_say() -> None:
    """The same for the same seed, others for another; each of its kind."""
    model = replace(model_of("human_figure"), form="velocity", outputs=())
    module: Any = load_module(python_module(compile_program(model, jacobian=False).system))
    nv, nq = len(model.velocities), len(model.coordinates)
    states = hard_states(module, nv, 2, 0, 1.0)
    assert [s.kind for s in states] == [k for k in KINDS for _ in range(1 if k == "zero" else 2)]
    again, other = hard_states(module, nv, 2, 0, 1.0), hard_states(module, nv, 2, 1, 1.0)
    assert all(np.array_equal(a.y, b.y) and a.t == b.t for a, b in zip(states, again, strict=True))
    assert not np.array_equal(states[-1].y, other[-1].y)
    by = {state.kind: state for state in states}
    for state in states:
        for indices in map(list, module.QUATERNIONS):
            assert abs(np.linalg.norm(state.y[indices]) - 1) < 1e-15
    turning = {i for q in module.QUATERNIONS for i in q}
    angles = [i for i in range(nq) if i not in turning and module.UNITS[module.STATES[i]] == "rad"]
    quarters = by["aligned"].y[angles] / (np.pi / 4)
    assert np.array_equal(quarters, np.round(quarters)) and np.ptp(quarters) > 0
    assert np.array_equal(np.abs(by["folded"].y[angles]), np.full(len(angles), np.pi))
    gimbal = np.abs(np.cos(by["gimbal"].y[angles]))
    assert np.all((gimbal > 1e-10) & (gimbal < 1.1e-3))
    assert not np.any(by["still"].y[nq : nq + nv])
    assert np.max(np.abs(by["fast"].y[nq : nq + nv])) > 100


# What is found.


def test_a_good_module_passes_by_every_route() -> None:
    """Errors of a few ulps, and every identity holds."""
    found = verify(*scene_of("cart_pole"), states=some(1, 2))
    assert not found.missed and found.left_out == 0
    assert set(found.ulps) == set(PENDULUM_ROUTES)
    assert max(np.median(errors) for errors in found.ulps.values()) < 10
    assert check(found, "virtual work").value < 1e-40
    assert check(found, "energy law").value < 30
    assert check(found, "drift of momentum x").value < 1e-9  # a rail without friction


def test_what_takes_energy_is_named() -> None:
    """Damping does, gravity, the spring without and a motor at rest do not."""
    model = replace(model_of(SCREW), outputs=())
    module: Any = load_module(python_module(compile_program(model, jacobian=False).system))
    states = [s for s in hard_states(module, len(model.velocities), 1, 0, 1.0) if s.number == 0]
    keeps = kept(model, states[-2:])
    assert not keeps.energy and keeps.takers == ("drive", "cord") and keeps.momentum == ()


@pytest.mark.full
def test_all_joints_with_drive_rotor_and_spring_are_verified() -> None:
    """Driven coordinates, their powers, and inputs among all else."""
    found = verify(*scene_of(SCREW), states=1)
    assert not found.missed, [line.what for line in found.missed]
    assert {"effect_powers", "inverse_dynamics", "body_poses"} <= {c.what for c in found.checks}


ARM = """
name = "arm"
bodies = [
    { name = "a", mass = 1.0, inertia_com = 0.2 },
    { name = "b", mass = 0.7, inertia_com = 0.1 },
]
simulation = { t_end = 1.0 }
[[joints]]
name = "j"
type = "revolute"
parent = "world"
child = "a"
[[joints]]
name = "k"
type = "revolute"
parent = "a"
child = "b"
r_parent = [0.5, 0.0]
r_child = [-0.5, 0.0]
"""
GRAVITY = '[[effects]]\ntype = "gravity"\ng = 9.81\n'
DRIVE = '[[effects]]\ntype = "driven"\nname = "drive"\njoint = "j"\ncoordinate = "FORMULA"\n'
PUSH = effect(
    "external_force", name="push", body="b", force=["5*step(t - 0.01)*step(0.2 - t)", 0.0]
)
QUIET = {
    "a body alone, which nothing accelerates": """
name = "alone"
bodies = [{ name = "a", mass = 1.0, inertia_com = 0.2 }]
joints = [{ name = "j", type = "free", child = "a" }]
""",
    "a drive that starts from rest": ARM + GRAVITY + DRIVE.replace("FORMULA", "0.1*t**3"),
    "a drive that waits": ARM + DRIVE.replace("FORMULA", "select(t - 0.8, (t - 0.8)**3, 0)"),
    "a force for a while": ARM + GRAVITY + PUSH,
    "a plate at rest, which nothing turns": find_scene("babyboot").read_text(),
}


@pytest.mark.every(2)
@pytest.mark.parametrize("case", some([*QUIET][::2], [*QUIET]))
def test_where_quantities_vanish_no_rounding_of_the_judge_counts(case: str) -> None:
    """Terms that cancel, drives at rest, what acts for a while: good modules pass."""
    found = verify(*scene_of(QUIET[case]), states=some(1, 2))
    assert not found.missed, [line.what for line in found.missed]
    if "a while" in case:
        assert any("push give or take" in note for note in found.notes)


def test_a_heavy_body_on_light_ones_is_found_to_lose_digits_by_aba() -> None:
    """Each decade of mass costs the recursion a digit."""
    lossy = verify(*scene_of(HEAVY.replace("ROUTE", "aba")), states=1)
    line = check(lossy, "forward error of v̇, aba (taken)")
    assert line.missed and line.value > 1e6 and "orthogonal" in lossy.better


@pytest.mark.full
def test_a_heavy_body_on_light_ones_is_found_to_lose_none_by_orthogonal() -> None:
    """The route of last resort does not."""
    sound = verify(*scene_of(HEAVY.replace("ROUTE", "orthogonal")), states=1)
    line = check(sound, "forward error of v̇, orthogonal (taken)")
    assert not line.missed and line.value < 2000
    assert check(sound, "residual").value < 450


FAULTS = {
    "a sign in v̇": (r"(def _derivative\(.*?\n.*?) - ", r"\1 + "),
    "a factor in v̇": (r"(def _derivative\(.*?\n.*?)sin\(", r"\1 1.0000001*sin("),
    "mass matrix": (r"(def _mass_matrix\(.*?\n.*?)cos\(", r"\1 1.001*cos("),
    "energy": (r"(def _potential_energy\(.*?\n.*?)cos\(", r"\1 1.001*cos("),
    "jacobian": (r"(def _jacobian\(.*?\n.*?) - ", r"\1 + "),
    "momentum": (r"(def _momentum\(.*?\n.*?)cos\(", r"\1 -cos("),
    "inverse dynamics": (r"(def _inverse_dynamics\(.*?\n.*?)sin\(", r"\1 -sin("),
    "poses": (r"(def _body_poses\(.*?\n.*?)cos\(", r"\1 -cos("),
}


@cache
def good() -> tuple[tuple[Model, Simulation], str]:
    """A model and how it is run, and the source of its module in which nothing is found."""
    model, wanted = scene_of("acrobot")
    model = replace(model, outputs=in_order(OUTPUTS), route="aba")
    source = python_module(compile_program(model).system)
    assert not verify(model, wanted, states=1, module=load_module(source)).missed
    return (model, wanted), source


@pytest.mark.every(2)
@pytest.mark.parametrize("fault", some([*FAULTS][::2], [*FAULTS]))
def test_a_fault_in_a_module_is_caught(fault: str) -> None:
    """Each seeded in a copy of a good module, in one place."""
    scene, source = good()
    seeded, places = re.subn(*FAULTS[fault], source, count=1, flags=re.DOTALL)
    assert places == 1 and seeded != source
    assert verify(*scene, states=1, module=load_module(seeded)).missed


LOOP_OUTPUTS = (*OUTPUTS, "constraint_forces")
DRIVEN_LOOP = """
name = "driven_loop"
simulation = { t_end = 0.3 }
bodies = [
    { name = "cart", mass = 1.5, inertia_com = 0 },
    { name = "arm", mass = 1.2, inertia_com = 0.1 },
    { name = "bob", mass = 0.7, inertia_com = 0.02 },
]
joints = [
    { name = "rail", type = "prismatic", parent = "world", child = "cart", axis = [1, 0] },
    { name = "pin", type = "revolute", parent = "world", child = "arm", \
r_parent = [0.8, 0], r_child = [0, 0.4] },
    { name = "hook", type = "revolute", parent = "arm", child = "bob", \
r_parent = [0, -0.4], r_child = [0, 0.3] },
]
constraints = [
    { type = "distance", name = "rod", body_1 = "cart", body_2 = "arm", length = 0.9 },
]
effects = [
    { type = "gravity", g = 9.81 },
    { type = "driven", name = "shaker", joint = "rail", coordinate = "0.1*sin(3*t)" },
]
"""
LOOP_FAULTS = {
    "v̇": (r"(def _derivative\(.*?\n.*?) - ", r"\1 + "),
    "ġ": (r"(def _constraint_rates\(.*?\n.*?)cos\(", r"\1 1.0000001*cos("),
    "λ": (r"(def _constraint_forces\(.*?\n.*?) - ", r"\1 + "),
}


@pytest.mark.every(2)
@pytest.mark.parametrize("fault", some(["", "λ"], ["", *LOOP_FAULTS]))
def test_loops_are_verified_by_their_own_rows(fault: str) -> None:
    """A slider-crank, against virtual work with multipliers: sound, and with a fault."""
    module, (model, wanted) = None, scene_of("slider_crank")
    model = assembled(replace(model, route="independent", outputs=in_order(LOOP_OUTPUTS)))
    source = python_module(compile_program(model).system)
    if fault:
        seeded, places = re.subn(*LOOP_FAULTS[fault], source, count=1, flags=re.DOTALL)
        assert places == 1 and seeded != source
        module = load_module(seeded)
    found = verify(model, wanted, states=1, module=module)
    assert bool([x for x in found.missed if "(taken)" in x.what or "forward" not in x.what]) == (
        fault != ""
    )
    if not fault:
        agreed = check(found, "virtual work against articulated bodies")
        assert agreed.value < 1e-24


def test_driving_forces_count_what_constraints_load() -> None:
    """A drive beside a loop: its power explains the energy, by the laws and in a short run."""
    scene = parse_scene(DRIVEN_LOOP)
    found = verify(assembled(elaborate(scene)), scene.simulation, states=1)
    lines = ("energy law", "effect_powers", "energy less works", "constraint_forces")
    assert not [line for line in lines if check(found, line).missed]


def test_a_module_that_gives_no_number_misses_its_bound() -> None:
    """Errors are infinite then, and nothing is raised."""
    model = replace(model_of("pendulum"), outputs=())
    module: Any = load_module(python_module(compile_program(model).system))
    bare = replace(model, outputs=in_order(OUTPUTS))
    full: Any = load_module(python_module(compile_program(bare).system))
    state = hard_states(module, 1, 1, 0, 1.0)[1]
    module.derivative = lambda *_: np.full(2, np.nan)
    roundings = Roundings([interfaced_program_of(bare)])
    found = judged(model, Truth(model), "aba", {"aba": module}, full, roundings, state)
    assert found is not None and np.isnan(found.errors["aba"]).all()
    assert found.residuals["aba"].error == np.inf


# How long doubles mean anything.


DRY = """
name = "dry"
route = "aba"
bodies = [{ name = "b", mass = 1.0, inertia_com = 0.1 }]
joints = [{ name = "j", type = "revolute", parent = "world", child = "b", r_child = [0, 1] }]
initial = { q = { j_angle = 1.0 } }
effects = [
    { type = "gravity", g = 9.81 },
    { type = "motor", name = "f", joint = "j", torque = "3 - 6*step(j_angle_dot)" },
]
"""


def test_a_horizon_that_chatters_keeps_to_its_time_and_reports_how_far_it_is() -> None:
    """Dry friction that sticks turns at every step, in doubles too, which had all the time."""
    scene = scene_of(DRY)
    module = load_module(python_module(compile_program(scene[0]).system))
    reported: list[float] = []
    with pytest.raises(RunError, match=r"^horizon: no run of 10 s.*: more than 1 s in .*; give a"):
        horizon_of(*scene, module, seconds=0.5, progress=reported.append)
    assert reported and all(0.0 <= part < 1.0 for part in reported)


def test_horizon_is_where_doubles_part_from_long_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    """A short run means something all along; asked for more digits, it has them for a while."""
    model, wanted = scene_of("double_pendulum")
    model, wanted = replace(model, outputs=()), wanted.replaced(t_end=0.8)
    module = load_module(python_module(compile_program(model).system))
    whole = horizon_of(model, wanted, module)
    assert whole.time is None and 1e-16 < whole.worst < 1e-10 and whole.sure < 1e-15
    assert whole.words.startswith(
        "doubles are meaningful for the whole run, 0.8 s: a relative error of"
    )
    monkeypatch.setattr(horizons, "PARTED", whole.worst / 2)
    part = horizon_of(model, wanted, module)
    assert part.time is not None and 0.1 < part.time <= 0.8
    assert part.words.startswith(f"doubles are meaningful to t = {part.time:.4g} s of 0.8 s")
    with pytest.raises(
        RunError, match=r"^horizon: no run of 0\.8 s in .* more than 1e-06 s in extended precision"
    ):
        horizon_of(model, wanted, module, seconds=1e-6)
    with pytest.raises(RunError, match="rigid contacts strike"):
        bouncing = replace(model_of("bouncing_two_body"), outputs=())
        horizon_of(bouncing, wanted, load_module(python_module(compile_program(bouncing).system)))


# The command.


def test_verify_says_saves_and_repeats(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Same scene, same bytes; nothing of others is overwritten; data hold every state."""
    arguments = ["verify", "pendulum", "--states", "1", "--save", str(tmp_path)]
    assert main(arguments) == 0
    text = capsys.readouterr().out
    assert "forward error of v̇, closed (taken)" in text and "MISSED" not in text
    paths = [tmp_path / f"pendulum_verified.{kind}" for kind in ("txt", "json")]
    first = [path.read_bytes() for path in paths]
    data = json.loads(first[1])
    assert data["passed"] and len(data["states"]) > 8
    own = [state["t"] for state in data["states"] if state["state"].startswith("scene's run")]
    assert f"the scene's run followed to t = {max(own):.4g} s" in text
    assert {"y", "vd", "error_ulps", "condition"} <= set(data["states"][0])
    assert str(tmp_path).encode() not in first[0] + first[1]
    assert main(arguments) == 0 and [path.read_bytes() for path in paths] == first
    paths[0].write_text("mine")
    assert main(arguments) == 1 and "was not written by eomgen" in capsys.readouterr().err
    assert paths[0].read_text() == "mine" and paths[1].read_bytes() == first[1]
    assert main([*arguments, "--force"]) == 0 and paths[0].read_bytes() == first[0]


def test_a_missed_bound_is_named_and_exits_1(capsys: pytest.CaptureFixture[str]) -> None:
    """With the state in full, so that anyone can look at it."""
    assert main(["verify", "furuta_pendulum", "--states", "1", "--bound", "0.6"]) == 1
    out, err = capsys.readouterr()
    assert "MISSED" in out
    line = next(line for line in err.splitlines() if "forward error of v̇" in line)
    assert "above its bound 0.6 ulp, at state '" in line and "theta=" in line and "tau=" in line


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ("--states 0", "--states: 0 is not a number from 1"),
        ("--seed -1", "--seed: -1 is negative"),
        ("--bound 0.1", "--bound: 0.1 ulps is not a bound"),
        ("--bound nan", "--bound: nan ulps is not a bound"),
        ("--horizon 0", "--horizon: 0 is not a positive time"),
    ],
)
def test_wrong_options_get_a_line(
    option: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """And no traceback."""
    assert main(["verify", "pendulum", *option.split()]) == 1
    assert words in capsys.readouterr().err


HEAVY = """
name = "heavy_tip"
route = "ROUTE"
effects = [{ type = "gravity", g = 9.81 }]
bodies = [{ name = "tip", mass = 1e12, inertia_com = 1e11 }]
simulation = { t_end = 0.2, integrator = "rk4", dt = 0.01 }
chains = [
    { name = "link", count = 2, mass = 1, inertia_com = 0.1, r_parent = [0.5, 0], \
r_child = [-0.5, 0] },
]
joints = [
    { name = "last", type = "revolute", parent = "link_2", child = "tip", r_parent = [0.5, 0], \
r_child = [-0.5, 0] },
]
"""
"""A tip of 1e12 kg on two links of 1 kg."""


def test_an_interrupt_keeps_the_states_judged_so_far(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Their report is printed, nothing is written, and the exit code is that of an interrupt."""
    seen: list[Any] = []

    def some_time(*given: Any) -> Any:
        if len(seen) == 3:
            raise KeyboardInterrupt
        seen.append(judged(*given))
        return seen[-1]

    monkeypatch.setattr("eomgen.study.verification.verify.judged", some_time)
    assert main(["verify", "pendulum", "--save", str(tmp_path / "kept")]) == 130
    out, err = capsys.readouterr()
    assert "v̇" in out and "interrupted after 3 of " in out and "drift of" not in out
    assert err.startswith("eomgen: pendulum: interrupted after 3 of ")
    assert not list((tmp_path / "kept").iterdir())


# Small faults in components and terms that others hide.


@pytest.mark.every(2)
@pytest.mark.parametrize(
    ("output", "entry", "size", "lines"),
    [
        ("mass_matrix", (-1, 1), 3e-14, ["each component"]),
        ("jacobian", (-1, 1), 1e-12, ["jacobian, each row", "jacobian, each entry"]),
        ("jacobian", (-1, 3), 3e-14, ["jacobian, each entry"]),  # beside a greater one in its row
    ],
)
def test_a_small_fault_in_a_component_is_noticed(
    output: str, entry: tuple[int, int], size: float, lines: list[str]
) -> None:
    """By what rounding makes of it; the bounds of whole outputs let it pass."""
    model = replace(model_of("furuta_pendulum"), outputs=in_order(OUTPUTS))
    module: Any = load_module(generated_code(model).module, "small_fault")
    right = getattr(module, output)

    def wrong(*given: Any) -> Any:
        found = right(*given)
        found[entry] *= 1 + size
        return found

    setattr(module, output, wrong)
    found = verify(model, Simulation(t_end=0.1), states=1, module=module)
    assert [one.what for one in found.missed] == lines


FALLING = """
name = "falling"
bodies = [
    { name = "hull", mass = 3, inertia_com = 0.7 },
    { name = "mast", mass = 0.3, inertia_com = 0.025 },
]
effects = [{ type = "gravity", g = 9.81 }]
joints = [
    { name = "flight", type = "free", child = "hull" },
    { name = "pin", type = "revolute", parent = "hull", child = "mast", \
r_parent = [0, 0.37], r_child = [0, -0.53] },
]
"""


def test_an_acceleration_of_nothing_is_no_loss(monkeypatch: pytest.MonkeyPatch) -> None:
    """In free fall a hinge at rest does not turn: all its terms cancel, whatever the data."""
    monkeypatch.setattr("eomgen.study.verification.verify.compiled", lambda *_, **__: ({}, {}))
    found = verify(model_of(FALLING), Simulation(t_end=0.1), states=1)
    assert not found.missed
    still = next(one for one in found.judged if one.state.kind == "still")
    assert abs(still.vd[-1]) < 1e-30


def test_a_run_of_a_mechanism_that_is_ended_is_not_called_singular() -> None:
    """No way through a change point is sought, which would call the derivative again."""
    model, wanted = assembled(elaborate(read("rattleback"))), read("rattleback").simulation
    module: Any = load_module(generated_code(model).module, "ended")
    problem, times = problem_of(module, model=model), list[float]()

    def derivative(t: float, y: np.ndarray) -> np.ndarray:
        times.append(t)
        if len(times) > 40:
            raise EndedRunError("enough")
        return problem.derivative(t, y)

    run = integrate(replace(problem, derivative=derivative), "DOP853", wanted.t_end)
    assert (run.outcome.kind, run.outcome.reason) == ("ended", "enough")
    assert len(times) <= 42
