"""Inverse kinematics: `kinematics`, `place` and `reach`."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

import eomgen

TWO_HANDS = """
name = "two_hands"
dimensions = 3
{}
[[joints]]
name = "base"
type = "free"
parent = "world"
child = "trunk"
[[joints]]
name = "neck"
type = "ball"
parent = "trunk"
child = "head"
r_parent = [0, 0, 0.3]
r_child = [0, 0, -0.2]
[[joints]]
name = "left"
type = "revolute"
parent = "trunk"
child = "arm"
axis = [0, 1, 0]
r_parent = [0, 0.3, 0.1]
r_child = [0, 0, 0.3]
limits = [-1.0, 0.5]
[[points]]
name = "nose"
body = "head"
at = [0.2, 0, 0]
[[points]]
name = "hand"
body = "arm"
at = [0, 0, -0.3]
""".format(
    "".join(
        f'[[bodies]]\nname = "{name}"\nmass = 1.0\ninertia_com = [0.1, 0.1, 0.1]\n'
        for name in ("trunk", "head", "arm")
    )
)


@pytest.fixture(scope="module")
def puma() -> Any:
    """The arm with a spherical wrist."""
    return eomgen.kinematics("puma560")


def test_poses_are_reached(puma: Any) -> None:
    """Each of random poses of the wrist, in few starts, to its tolerance."""
    rng = np.random.default_rng(4)
    for _ in range(10):
        wanted = puma.place("wrist", rng.uniform(-2.0, 2.0, 6))
        found = puma.reach({"wrist": wanted}, tolerance=1e-11)
        assert found.converged and found.error <= 1e-11 and found.starts < 20
        assert_allclose(puma.place("wrist", found.q), wanted, atol=3e-11)
        assert [*found.coordinates.values()] == found.q.tolist()
    for part in (wanted[:, 3], wanted[:, :3]):
        assert puma.reach({"wrist": part}).converged


def test_what_cannot_be_reached_is_said(puma: Any) -> None:
    """The place found is nearer than those of random coordinates."""
    far, rng = np.array([5.0, 1.0, 0.5]), np.random.default_rng(1)
    found = puma.reach({"wrist": far}, starts=3)
    assert not found.converged and found.error > 1.0

    def distance(q: np.ndarray) -> float:
        return float(np.linalg.norm(puma.place("wrist", q)[:, 3] - far))

    assert distance(found.q) < min(distance(q) for q in rng.uniform(-3.0, 3.0, (300, 6)))


def test_several_points_of_a_free_body_within_limits() -> None:
    """Quaternions stay of length 1; a coordinate stays on its limit where it would leave it."""
    robot = eomgen.kinematics(TWO_HANDS)
    q = robot._random(np.random.default_rng(1))
    wanted = {name: robot.place(name, q) for name in robot.points}
    found = robot.reach(wanted)
    assert found.converged and -1.0 <= found.coordinates["left_angle"] <= 0.5
    for name, pose in wanted.items():
        assert_allclose(robot.place(name, found.q), pose, atol=1e-8)
    q = np.where([n == "left_angle" for n in robot.names], 0.9, q)
    beyond = {name: robot.place(name, q) for name in robot.points}
    held = robot.reach(beyond, starts=2)
    assert not held.converged and held.coordinates["left_angle"] == 0.5


def test_planes_and_loops() -> None:
    """x, y and angle; constraints are met."""
    plane = eomgen.kinematics("cart_pole")
    wanted = plane.place("tip", [0.7, 0.4])
    found = plane.reach({"tip": wanted[:2]}, start={"theta": 0.1})
    assert found.converged and math.isclose(found.q[0], 0.7) and math.isclose(found.q[1], 0.4)


@pytest.mark.parametrize(
    ("targets", "message"),
    [
        ({"nose": [0, 0, 0]}, "targets: no point 'nose'; points: wrist"),
        ({"wrist": [0, 0]}, r"targets: that of 'wrist' has shape \(2,\); give \(3,\), "),
        ({"wrist": [0, 0, math.nan]}, "has a number that is not finite"),
        ({"wrist": 2 * np.eye(3)}, "has no rotation matrix"),
    ],
)
def test_mistakes_are_said(puma: Any, targets: Any, message: str) -> None:
    """In one line."""
    with pytest.raises(eomgen.RunError, match=message):
        puma.reach(targets)
    with pytest.raises(eomgen.RunError, match="start: "):
        puma.reach({}, start={"elbow": 1.0})
