"""Deviations that keep constraints: linearisation of what rolls, against the nonlinear equations.

Constraints of positions restrict displacements, all constraints restrict velocities.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from whipple import TABLE

import eomgen
from eomgen.api.given import check
from eomgen.api.linearising import linearisable, linearised_at
from eomgen.api.options import PointOptions
from eomgen.tables.outputs import SAVED

SLED = """
name = "sled"
bodies = [{ name = "s", mass = 1.0, inertia_com = 0.1 }]
joints = [{ name = "f", type = "free", child = "s", coordinates = ["x", "y", "phi"] }]
constraints = [{ type = "knife_edge", name = "k", body = "s", at = [-0.3, 0], across = [0, 1] }]
effects = [{ type = "external_force", name = "lat", body = "s", force = [0, "-5*y"] }]
initial = { v = { x_dot = 2.0 } }
"""
WHEEL = """
name = "wheel"
bodies = [{ name = "w", mass = 2.0, inertia_com = 0.1, com = [0.1, 0.05] }]
joints = [{ name = "f", type = "free", child = "w", coordinates = ["x", "y", "phi"] }]
constraints = [{ type = "rolling", name = "k", body = "w", radius = 0.3, at = [-0.1, -0.05] }]
effects = [
    { type = "gravity", g = 9.81 },
    { type = "external_force", name = "tug", body = "w", force = ["-5*x + phi**2", 0] },
]
initial = { v = { phi_dot = 2.0 } }
"""
COIN = """
name = "coin"
dimensions = 3
bodies = [{ name = "c", mass = 2.0, inertia_com = [0.22, 0.22, 0.43] }]
joints = [{ name = "f", type = "free", child = "c" }]
effects = [
    { type = "gravity", g = 9.81 },
    { type = "external_force", name = "tug", body = "c", force = ["-c_x", "-2*c_y", 0] },
]
constraints = [{ type = "rolling", name = "table", body = "c", radius = 0.5, axis = [0, 0, 1] }]
initial.q = { c_qw = 0.8, c_qx = 0.6, c_x = 0.3, c_y = -0.2 }
initial.v = { c_wy = 1.0, c_wz = -3.0 }
"""
PURSUIT = """
name = "pursuit"
bodies = [{ name = "p", mass = 1.5 }, { name = "r", mass = 1.0, inertia_com = 0.2 }]
effects = [{ type = "external_force", name = "back", body = "p", force = ["-3*x", "-y"] }]
initial = { q = { x = 0.7, y = 0.3, turn = 0.4 }, v = { x_dot = 1.0, turn_dot = 0.5 } }
joints = [
    { name = "f", type = "particle", parent = "world", child = "p", coordinates = ["x", "y"] },
    { name = "g", type = "revolute", parent = "world", child = "r", coordinate = "turn" },
]
constraints = [
    { type = "equation", name = "chase", \
velocity = "y_dot*cos(turn + y) - x_dot*sin(turn + y) + 0.2*x" },
]
"""
ROLLING = {  # scenes, and outputs, of which few depend on neither place nor heading
    "bicycle": ("bicycle", ["y", "steer", "body_poses"]),
    "rattleback": ("rattleback", ["stone_y", "body_poses", "kinetic_energy"]),
    "sled": (SLED, ["y", "phi", "y_dot", "body_poses", "constraint_forces"]),
    "wheel": (WHEEL, ["x", "y_dot", "body_poses", "joint_forces", "constraint_forces"]),
    "coin": (COIN, ["c_x", "c_z", "body_poses", "momentum", "constraint_forces"]),
    "pursuit": (PURSUIT, ["y", "turn_dot", "kinetic_energy", "constraint_forces"]),
}


def file_of(scene: str, folder: Path) -> str:
    """A built-in scene's name, or a file with a text."""
    if "\n" not in scene:
        return scene
    path = folder / "scene.toml"
    path.write_text(scene)
    return str(path)


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Of the conjugate of a quaternion and another."""
    w, x = a[0], -a[1:]
    return np.array([w * b[0] - x @ b[1:], *(w * b[1:] + b[0] * x + np.cross(x, b[1:]))])


def deviations(module: Any, base: np.ndarray, y: np.ndarray, plain: float) -> np.ndarray:
    """y seen from `base`: `plain` times the differences, and small rotations in body axes."""
    found, at = [], 0
    for quaternion in (*module.QUATERNIONS, None):
        stop = quaternion[0] if quaternion else len(y)
        found.append(y[at:stop] - plain * base[at:stop])
        if quaternion:
            found.append(2 * product(base[list(quaternion)], y[list(quaternion)])[1:])
            at = stop + 4
    return np.concatenate(found)


class Beside:
    """States that meet all constraints and whose deviations `kept` from `base` are given."""

    def __init__(self, module: Any, base: np.ndarray, kept: list[int]) -> None:
        self._module, self._base, self._kept = module, base, kept
        self._slopes = slopes_of(lambda x: self._off(base + x), len(base), 1e-4)

    def _off(self, y: np.ndarray) -> np.ndarray:
        units = [np.sum(y[list(indices)] ** 2) - 1 for indices in self._module.QUATERNIONS]
        rows = self._module.constraint_residuals(0.0, y), self._module.constraint_rates(0.0, y)
        return np.concatenate(
            [*rows, units, deviations(self._module, self._base, y, 1.0)[self._kept]]
        )

    def at(self, wanted: np.ndarray) -> np.ndarray:
        """By Newton's method with the slopes of the base."""
        y, right = self._base.copy(), np.zeros(len(self._slopes))
        right[len(right) - len(wanted) :] = wanted
        for _ in range(12):
            off = self._off(y) - right
            if np.abs(off).max() < 1e-14:
                break
            y = y - np.linalg.lstsq(self._slopes, off, rcond=1e-11)[0]
        assert np.abs(off).max() < 1e-12
        return y


def slopes_of(function: Callable[[np.ndarray], np.ndarray], count: int, h: float) -> np.ndarray:
    """Derivatives of a function of small numbers at 0, by differences of fourth order."""
    columns = [
        sum(c * (function(k * h * way) - function(-k * h * way)) for k, c in enumerate(FOURTH, 1))
        for way in np.eye(count)
    ]
    return np.array(columns).T / h


FOURTH = (2 / 3, -1 / 12)


@pytest.mark.every(4)
@pytest.mark.parametrize("name", ROLLING)
def test_what_rolls_against_states_that_meet_the_constraints(name: str, tmp_path: Path) -> None:
    """A and C, about a moving state: by differences of rates and outputs at states beside it, which
    Newton's method puts on the constraints. As many displacements as positions are free, and as
    many velocities as motions.
    """
    text, outputs = ROLLING[name]
    scene = file_of(text, tmp_path)
    shown = eomgen.state_space(scene, at="initial", outputs=outputs)
    heads = tuple(x for x in outputs if x in SAVED)
    model = replace(linearisable(check(scene)), outputs=heads)
    module: Any = linearised_at(model, PointOptions(scene, at="initial")).module
    rows, rolling = len(module.CONSTRAINTS), len(module.VELOCITY_CONSTRAINTS)
    nq = len(module.POSITIONS)
    nv = len(module.STATES) - nq
    assert rolling and shown.nstates == (nv - rows + rolling) + (nv - rows)
    names = [name for name in module.STATES if name[-3:] not in ("_qx", "_qy", "_qz")]
    for k, indices in enumerate(module.QUATERNIONS):
        names[indices[0] - k : indices[0] - k + 1] = [
            f"{module.STATES[indices[0]][:-2]}r{axis}" for axis in "xyz"
        ]
    kept = [names.index(name) for name in shown.state_labels]
    base = module.initial_state()
    rates, beside = module.derivative(0.0, base), Beside(module, base, kept)

    def seen(x: np.ndarray) -> np.ndarray:
        """Rates and outputs at the state with these deviations."""
        y = beside.at(x)
        moving = deviations(module, base, module.derivative(0.0, y), 0.0)
        for k, indices in enumerate(module.QUATERNIONS):  # seen from the motion itself
            own = product(rates[list(indices)], y[list(indices)])[1:]
            moving[indices[0] - k :][:3] += 2 * own
        values = [
            y[[module.STATES.index(x)]] if x in module.STATES else getattr(module, x)(0.0, y)
            for x in outputs
        ]
        return np.concatenate([moving[kept], *map(np.ravel, values)])

    slopes = slopes_of(seen, len(kept), 2e-4)
    for matrix, expected in ((shown.A, slopes[: len(kept)]), (shown.C, slopes[len(kept) :])):
        assert matrix == pytest.approx(expected, rel=1e-7, abs=1e-7 * np.abs(matrix).max())


def test_a_sled_that_is_drawn_back_sideways(tmp_path: Path) -> None:
    """By hand: with the edge a behind the centre and a deviation y, the torque about the edge is
    -5 y a, so (I + m a²) φ'' = -5 a y - m a v φ', and y' = v φ + a φ'.
    """
    found = eomgen.linearise(file_of(SLED, tmp_path), at="initial")
    a, v, inertia = 0.3, 2.0, 0.1 + 0.3**2
    by_hand = [[0, v, a], [0, 0, 1], [-5 * a / inertia, 0, -a * v / inertia]]
    rates = np.sort_complex(np.linalg.eigvals(found.reduced().A))
    expected = np.sort_complex([*np.linalg.eigvals(by_hand), 0, 0])
    np.testing.assert_allclose(rates, expected, atol=1e-12)
    assert expected[0].real == pytest.approx(-3.68, abs=1e-3)
    assert found.stability == "unstable"


def test_the_bicycle_keeps_its_lane_apart_from_its_lean() -> None:
    """Its modes at 5 m/s are those of the benchmark, and six zeros: place, heading, both wheels
    and speed. Its place along y is a state of its own, which no lean displaces.
    """
    v = {"x_dot": 5.0, "y_dot": 0.0, "lean_dot": 0.0, "yaw_dot": 0.0, "steer_dot": 0.0}
    v |= {"rear_roll_dot": 5 / 0.3, "front_roll_dot": 5 / 0.35}
    found = eomgen.state_space("bicycle", at="initial", state=v, outputs=ROLLING["bicycle"][1])
    own = [[state == name for state in found.state_labels] for name in ("y", "steer")]
    np.testing.assert_array_equal(found.C[:2], own)
    rates = np.linalg.eigvals(found.A)
    expected = np.sort_complex([*TABLE[5], *[0] * 6])
    np.testing.assert_allclose(np.sort_complex(rates), expected, atol=1e-5)
