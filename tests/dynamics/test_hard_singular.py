"""Models that are singular are refused with the reason, and such as are nearly so are solved as
well as their condition number lets.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from campaign import some

from eomgen.base.errors import SceneError
from eomgen.dynamics.start.singularity import check_nonsingular, relative_pivots
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.pipeline import compile_program, python_module
from eomgen.run.integrate import integrate
from eomgen.run.module import load_module
from eomgen.scene.reader import parse_scene
from eomgen.study.diagnosis import locks, problem_of
from eomgen.study.verification.truth import Truth

WORSE = 30
"""Units of rounding times the condition number: what an error may be."""
ROUNDING = np.finfo(float).eps / 2


def pins(*links: tuple[float, float, float], far: float = 1.0) -> str:
    """Links on pins, one on the other: mass, inertia, and pin to centre of mass; the next pin is
    `far` beyond it.
    """
    text = 'name = "pins"\n[[effects]]\ntype = "gravity"\ng = 9.81\n'
    for i, (mass, inertia, length) in enumerate(links):
        parent = f'parent = "b{i - 1}"\nr_parent = [{far}, 0]' if i else 'parent = "world"'
        text += (
            f'[[bodies]]\nname = "b{i}"\nmass = {mass!r}\ninertia_com = {inertia!r}\n'
            f'[[joints]]\nname = "j{i}"\ntype = "revolute"\n{parent}\nchild = "b{i}"\n'
            f"r_child = [{-length!r}, 0]\n"
        )
    return text


@pytest.mark.parametrize(
    ("text", "body", "velocity"),
    [
        (pins((1.0, 0.1, 1.0), (0.0, 0.0, 1.0)), "b1", "j1_angle_dot"),
        (pins((1.0, 0.1, 1.0), (1.0, 0.0, 0.0)), "b1", "j1_angle_dot"),
        (pins((0.0, 0.0, 1.0), (0.0, 0.0, 1.0), (0.0, 0.0, 1.0)), "b2", "j2_angle_dot"),
        (pins((0.0, 0.0, 0.5), (1.0, 0.0, 0.0), far=-0.5), "b1", "j1_angle_dot"),
    ],
    ids=["no mass", "no length", "nothing at all", "two pins in one place"],
)
def test_singular_models_are_refused(text: str, body: str, velocity: str) -> None:
    """In one line, with the body, the motion and what to change."""
    with pytest.raises(SceneError) as caught:
        check_nonsingular(elaborate(parse_scene(text)))
    assert str(caught.value) == (
        f"body '{body}': nothing resists '{velocity}', neither its mass or inertia nor what it "
        "carries; give it some, or a joint that does not move so"
    )


def test_long_arms_are_no_singularity() -> None:
    """What a kilogram and a kilogram metre squared resist at 1e9 m, is 1e-18 of what they weigh."""
    text = """
name = "far"
bodies = [{ name = "b", mass = 1.0, inertia_com = INERTIA }]
joints = [
    { name = "j", type = "planar", parent = "world", child = "b", r_child = [1e9, 0] },
]
"""
    check_nonsingular(elaborate(parse_scene(text.replace("INERTIA", "1.0"))))
    with pytest.raises(SceneError, match="nothing resists"):
        check_nonsingular(elaborate(parse_scene(text.replace("INERTIA", "0.0"))))
    in_space = text.replace("INERTIA", "[1.0, 1.0, 1.0]").replace("[1e9, 0]", "[1e9, 1e9, 0]")
    model = elaborate(parse_scene(in_space + "dimensions = 3\n"))
    check_nonsingular(model)
    poses = np.random.default_rng(1).uniform(-3, 3, (50, len(model.coordinates)))
    assert (relative_pivots(model, poses)[0] == 1).all()  # rounding is no lock


SMALL = some([1e-12], [1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14])
NEARLY = {
    "tiny inertia at the end": lambda e: pins((1.0, 0.1, 1.0), (1.0, e, 0.0)),
    "tiny inertia in the middle": lambda e: pins((1.0, 0.1, 1.0), (e, e, 0.0), (1.0, 0.1, 1.0)),
    "massless body in the middle": lambda e: pins((1.0, e, 1.0), (0.0, 0.0, 0.5), (1.0, e, 1.0)),
    "hardly any length": lambda e: pins((1.0, 0.1, 1.0), (1.0, 0.0, e)),
    "point masses": lambda e: pins((1.0, 0.0, 1.0), (e, 0.0, 1.0), (1.0, 0.0, 1.0)),
}


@pytest.mark.parametrize("small", SMALL)
@pytest.mark.parametrize("scene", some([*NEARLY][::2], [*NEARLY]))
@pytest.mark.every(2)
def test_nearly_singular_models_are_solved_to_their_condition(scene: str, small: float) -> None:
    """Against 60 digits, at random poses, straight and all but straight ones."""
    model = replace(elaborate(parse_scene(NEARLY[scene](small))), outputs=("mass_matrix",))
    module = load_module(python_module(compile_program(model, jacobian=False).system), "nearly")
    noise, count = np.random.default_rng(7), len(model.coordinates)
    q = [noise.uniform(-3, 3, count) for _ in range(3)]
    q += [np.zeros(count), np.full(count, 1e-7)]
    y = np.hstack([q, noise.normal(size=(len(q), count))])
    true = Truth(model)(np.zeros(len(y)), y)
    for k, state in enumerate(y):
        found = module.derivative(0.0, state)[count:]
        error = float(max(abs(found - true[:, k])) / max(abs(true[:, k])))
        condition = float(np.linalg.cond(module.mass_matrix(0.0, state)))
        assert error < WORSE * ROUNDING * condition, (k, error, condition)


def cardan(initial: str) -> Model:
    """A point mass on a universal joint, a metre below: in line with the first axis at 90°."""
    return elaborate(
        parse_scene(f"""
name = "cardan"
dimensions = 3
bodies = [{{ name = "b", mass = 1.0, inertia_com = [0, 0, 0] }}]
joints = [{{ name = "j", type = "universal", parent = "world", child = "b", r_child = [0, 0, 1] }}]
initial = {{ {initial} }}
[[effects]]
type = "gravity"
g = 9.81
""")
    )


LOCK = "next to nothing resists 'j_angle_1_dot' of joint 'j', gimbal lock: a turn about its axis"


@pytest.mark.parametrize("method", ["DOP853", "rk4"])
def test_a_universal_joint_crosses_gimbal_lock(method: str) -> None:
    """Swung right through it: energy is kept, nothing is nan, and the crossing is named."""
    model = cardan("q = { j_angle_2 = 1.0 }, v = { j_angle_2_dot = 9.0 }")
    module = load_module(python_module(compile_program(model, jacobian=False).system), "cardan")
    step = {"dt": 1e-3} if method == "rk4" else {}
    run = integrate(problem_of(module, model=model), method, 1.0, samples=1001, **step)
    assert run.finished and np.isfinite(run.y).all()
    assert (np.abs(np.cos(run.y[:, 1])) < 0.01).any()
    energy = run.y[:, 3] ** 2 / 2 - 9.81 * np.cos(run.y[:, 1])
    assert np.ptp(energy) < 1e-6
    (line,) = locks(model, run)
    assert LOCK in line
    away = integrate(problem_of(module, model=model), method, 0.01, **step)
    assert locks(model, away) == []


def test_a_start_in_gimbal_lock_stops_with_the_reason() -> None:
    """There a turn about the first axis has no acceleration, and its rate falls at 1e11/s."""
    model = cardan("q = { j_angle_2_deg = 90.0 }, v = { j_angle_1_dot = 1.0 }")
    module = load_module(python_module(compile_program(model, jacobian=False).system), "locked")
    run = integrate(problem_of(module, model=model), "RK45", 1.0)
    assert not run.finished and math.isfinite(run.y[-1].sum())
    assert LOCK in run.message and "take a joint of type 'ball'" in run.message
