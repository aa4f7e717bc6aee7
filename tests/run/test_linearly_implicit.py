"""Steps that are linearly implicit in stiff forces."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import eomgen
from eomgen.base.errors import RunError
from eomgen.dynamics.dynamics import Dynamics
from eomgen.dynamics.resisting import resisted
from eomgen.dynamics.start.diagnostics import values_at
from eomgen.dynamics.tree.composite import full
from eomgen.dynamics.tree.loads import generalised
from eomgen.scalars.floats import FloatScalars

FIGURE = """
name = "figure"
dimensions = 3

[[bodies]]
name = "trunk"
mass = 2.0
inertia_com = [0.1, 0.2, 0.15, 0.0, 0.0, 0.0]
[[bodies]]
name = "left"
mass = 0.5
inertia_com = [0.01, 0.02, 0.02, 0.0, 0.0, 0.0]
[[bodies]]
name = "right"
mass = 0.4
inertia_com = [0.02, 0.01, 0.02, 0.0, 0.0, 0.0]
[[bodies]]
name = "hand"
mass = 0.1
inertia_com = [0.001, 0.001, 0.002, 0.0, 0.0, 0.0]

[[joints]]
name = "base"
type = "free"
parent = "world"
child = "trunk"
[[joints]]
name = "hip"
type = "ball"
parent = "trunk"
child = "left"
r_parent = [0.2, 0.0, -0.1]
r_child = [-0.1, 0.0, 0.2]
[[joints]]
name = "other"
type = "universal"
parent = "trunk"
child = "right"
r_parent = [-0.2, 0.0, -0.1]
r_child = [0.1, 0.0, 0.2]
coordinates = ["a", "b"]
[[joints]]
name = "wrist"
type = "revolute"
parent = "right"
child = "hand"
axis = [0.0, 1.0, 0.0]
r_parent = [0.0, 0.0, -0.2]
r_child = [0.0, 0.0, 0.1]
coordinate = "c"

[[effects]]
type = "gravity"
g = 9.81
[[effects]]
type = "contact"
name = "floor"
law = "hunt_crossley"
bodies = ["left", "right", "hand"]
radius = 0.1
stiffness = 5e5
dissipation = 0.3
friction = 0.7
slip_speed = 0.01
[[effects]]
type = "contact"
name = "pair"
against = "each_other"
law = "spring_damper"
bodies = ["left", "right", "hand"]
radius = 0.2
stiffness = 1e5
damping = 300.0
friction = 0.5
slip_speed = 0.01
[[effects]]
type = "spring"
name = "rope"
body_1 = "world"
at_1 = [0.0, 1.0, 1.0]
body_2 = "hand"
stiffness = 1e4
damping = 20.0
rest_length = 0.5
tension_only = true
[[effects]]
type = "joint_spring"
name = "soft"
joint = "hip"
stiffness = 300.0
damping = 2.0
[[effects]]
type = "joint_stop"
name = "limit"
joint = "hip"
high = 0.4
stiffness = 1e4
damping = 10.0
[[effects]]
type = "joint_friction"
name = "bearing"
joint = "other"
viscous = 0.1
coulomb = 0.5
speed = 0.01
[[effects]]
type = "pd"
name = "servo"
joint = "wrist"
target = 0.3
stiffness = 2e3
damping = 5.0
limit = 50.0
"""
"""Every kind of stiff effect on a tree, between branches of it, and to the ground."""

BLOCK = """
name = "block"
[[bodies]]
name = "block"
mass = 1.0
inertia_com = 0.02
[[joints]]
name = "free"
type = "free"
parent = "world"
child = "block"
coordinates = ["x", "y", "angle"]
[[effects]]
type = "gravity"
g = 9.81
[[effects]]
type = "contact"
name = "floor"
law = "spring_damper"
body = "block"
corners = [0.2, 0.1]
stiffness = 1e9
damping = 1e4
friction = 0.5
slip_speed = 1e-3
[initial]
q = { y = 0.3, angle = 0.3 }
v = { x_dot = 1.0 }
[simulation]
dt = 5e-3
t_end = 2.0
"""
"""Frequencies of 30,000 rad/s and more, for steps of 5 ms."""


def dynamics_at(model: Any, seed: int) -> Dynamics:
    """A model at a random state near its initial one."""
    rng = np.random.default_rng(seed)
    start = np.array([*model.initial_q, *model.initial_v])
    y = start + rng.normal(size=len(start)) * 0.2
    return Dynamics(model, values_at(model, 0.0, y.tolist(), {}, {}), FloatScalars())


def test_the_matrix_is_that_of_all_resistances() -> None:
    """M plus the rows of each resistance, as dense matrices."""
    model, h, acting = eomgen.check(FIGURE), 5e-3, 0
    for seed in range(3):
        d = dynamics_at(model, seed)
        matrix = np.array(full(d.mass_entries, d.nv, d.scalars)).reshape(d.nv, d.nv)
        right = np.array(d.applied_force) - d.bias()
        for effect in model.effects:
            for each in effect.resistances(d, h):
                row = np.array(generalised(d, each.loads))[: d.nv]
                change = each.change
                if change is None:
                    change = -h * each.stiffness * (row @ d.v)
                matrix += h * (each.damping + h * each.stiffness) * np.outer(row, row)
                right += change * row
                acting += each.stiffness > 0
        assert np.linalg.eigvalsh(matrix)[0] > 1e-4
        np.testing.assert_allclose(resisted(d, h), np.linalg.solve(matrix, right), rtol=1e-9)
    assert acting > 15


def test_without_stiff_effects_it_is_symplectic_euler() -> None:
    """On a tree with a ball joint, to rounding."""
    scene = eomgen.check("tumbling_body").name
    ours, plain = (
        np.array(eomgen.simulate(scene, integrator=method, dt=1e-2, t_end=1.0, samples=2).y[-1])
        for method in ("linearly_implicit", "semi_implicit_euler")
    )
    np.testing.assert_allclose(ours, plain, atol=1e-12)


def errors(scene: str, steps: Sequence[float], t_end: float) -> list[float]:
    """Greatest errors at the end, beside DOP853."""
    exact = np.array(eomgen.simulate(scene, t_end=t_end, rtol=1e-11, atol=1e-12, samples=2).y[-1])
    found = []
    for dt in steps:
        given: dict[str, Any] = {"integrator": "linearly_implicit", "dt": dt, "t_end": t_end}
        found.append(float(np.abs(np.array(eomgen.simulate(scene, **given).y[-1]) - exact).max()))
    return found


def test_the_order_is_1() -> None:
    """While a corner of a block touches, slides and opens again."""
    soft = BLOCK.replace("1e9", "1e3").replace("1e4", "20.0").replace("y = 0.3", "y = 0.14")
    soft = soft.replace("slip_speed = 1e-3", "slip_speed = 0.1")
    found = errors(soft, (5e-4, 2.5e-4, 1.25e-4), 0.1)
    assert found[-1] < 3e-3
    assert all(1.8 < a / b < 2.2 for a, b in pairwise(found))


def test_contacts_of_any_stiffness_are_stable() -> None:
    """A block falls, tips over, slides and lies: its energy, without what the contact stores, never
    exceeds that at the start, and it comes to rest. Steps of explicit methods are too long.
    """
    for stiffness, damping in ((1e5, 3e2), (1e7, 1e3), (1e9, 1e4)):
        scene = BLOCK.replace("1e9", str(stiffness)).replace("1e4", str(damping))
        y = np.asarray(eomgen.simulate(scene, integrator="linearly_implicit").y)
        energy = 0.5 * (y[:, 3:] ** 2 @ (1.0, 1.0, 0.02)) + 9.81 * y[:, 1]
        assert energy.max() <= energy[0]
        assert np.diff(energy).max() < 1e-3 * energy[0]
        assert np.abs(y[-1][3:]).max() < 1e-9
        assert 0.1 - y[-1][1] < 1.01 * 9.81 / stiffness + 1e-7
    with pytest.raises(RunError):
        run = eomgen.simulate(BLOCK, integrator="semi_implicit_euler")
        raise RunError(run.message) if not run.finished else AssertionError


def test_rigid_contacts_are_refused() -> None:
    """With the key to change, in runs and in steppers."""
    rigid = BLOCK.replace('"spring_damper"', '"impact"').replace("damping = 1e4\n", "")
    rigid = rigid.replace("stiffness = 1e9", "restitution = 0.0")
    with pytest.raises(RunError, match=r"'floor_block_1' is rigid; give it law"):
        eomgen.simulate(rigid, integrator="linearly_implicit")
    with pytest.raises(RunError, match="is rigid"):
        eomgen.stepper(rigid, dt=1e-3, method="linearly_implicit")
