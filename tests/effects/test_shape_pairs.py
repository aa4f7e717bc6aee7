"""Shapes that touch each other: distances and normals beside MuJoCo's."""

import numpy as np
import pytest
from shape_pairs import PAIRS, differences, model_of, nearest, random_pose, touches_at


@pytest.mark.parametrize("pair", PAIRS, ids="-".join)
def test_distances_and_normals_are_mujocos(pair: tuple[str, str]) -> None:
    """To rounding, wherever they do not touch: of two boxes where edges cross, too."""
    found = differences(*pair, seed=1, count=40)
    assert abs(found).max(axis=0)[0] < 1e-12
    assert found[:, 1].max() < 1e-9


def test_the_normal_of_boxes_is_the_slope_of_their_distance() -> None:
    """So forces along it have a potential, also where the nearest points are on edges."""
    model, rng, step = model_of("rounded box", "box"), np.random.default_rng(2), 1e-6
    for _ in range(15):
        poses = np.concatenate([random_pose(rng), random_pose(rng)])
        gap, normal = nearest(model, poses)
        if gap > 0:
            moved = [nearest(model, poses + step * way)[0] - gap for way in np.eye(14)[:3]]
            assert np.array(moved) / step == pytest.approx(normal, abs=1e-4)


@pytest.mark.parametrize("other", ["capsule", "box"])
def test_what_lies_along_another_touches_it_in_the_middle(other: str) -> None:
    """All points of a parallel capsule are as near; rounding does not choose among them."""
    model, rng = model_of("capsule", other), np.random.default_rng(0)
    flat = np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.9, 1.0, 0.0, 0.0, 0.0])
    middles = []
    for _ in range(20):
        touch = touches_at(model, flat + 1e-16 * rng.normal(size=14))[-1]
        middles.append(touch.sides[0].arm[2])
    assert np.ptp(middles) < 1e-9
    assert middles[0] == pytest.approx(0.4, abs=1e-9)
