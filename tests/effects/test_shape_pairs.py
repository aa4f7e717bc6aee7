"""Shapes that touch each other: distances and normals beside MuJoCo's."""

import numpy as np
import pytest
from shape_pairs import BOXES, EXACT, differences, model_of, touches_at


@pytest.mark.parametrize("pair", EXACT, ids="-".join)
def test_distances_and_normals_are_mujocos(pair: tuple[str, str]) -> None:
    """To rounding, wherever they do not touch."""
    found = differences(*pair, seed=1, count=40)
    assert abs(found).max(axis=0)[0] < 1e-12
    assert found[:, 1].max() < 1e-9


def test_boxes_see_corners_and_no_crossing_edges() -> None:
    """Corners are never nearer than MuJoCo says, and as near in every other pose or so."""
    apart = differences(*BOXES, seed=1, count=60)[:, 0]
    assert apart.min() > -1e-12
    assert (apart < 1e-12).mean() > 0.4


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
