"""Coordinates of inertias: each of them is a body, and a search in them does not get stuck."""

import numpy as np
import pytest

import eomgen
from eomgen.fitting.inertias import Inertia

FULL = Inertia(0, (1, 2, 3, 4, 5, 6))


@pytest.mark.parametrize(
    "inertia", [FULL, Inertia(None, (0, 1, 2)), Inertia(0, (1,)), Inertia(3, (0, 1, 2))]
)
def test_coordinates_are_bodies(inertia: Inertia) -> None:
    """And bodies have coordinates; derivatives are those by differences."""
    rng = np.random.default_rng(1)
    count = len(inertia.members)
    for _ in range(20):
        own = rng.normal(0.0, 2.0, count)
        values, slopes = inertia.outward(own)
        whole = np.zeros(count)
        whole[inertia.members] = values
        again = inertia.inward(whole)
        assert again is not None and np.allclose(again, own, rtol=1e-6, atol=1e-6)
        step = 1e-6
        for i, unit in enumerate(step * np.eye(count)):
            ahead, behind = (inertia.outward(own + sign * unit)[0] for sign in (1, -1))
            found = (ahead - behind) / (2 * step)
            assert np.allclose(slopes[:, i], found, rtol=1e-5, atol=1e-7 * np.abs(values).max())
    flat = np.array([1.0, 1.0, 1.0, 2.1, 0.0, 0.0, 0.0])
    assert FULL.inward(flat) is None, "zz larger than xx and yy together"
    assert FULL.inward(-flat) is None


def test_a_search_slides_along_what_bodies_can_have() -> None:
    """A thin plate: the nearest moments to noisy measurements are no body's. In coordinates of
    bodies the search ends at a body, with a smaller sum of squares than where a search in moments
    runs into the wall.
    """
    truth = {"I_1": 1.25e-4, "I_2": 3.3e-4, "I_3": 4.549e-4}
    run = eomgen.simulate("tumbling_body", t_end=3.0, parameters=truth, samples=61, rtol=1e-10)
    sums = {}
    for seed in range(3):
        rng = np.random.default_rng(seed)
        rates = {
            n: run[n] + rng.normal(0, 0.05, len(run.t)) for n in ("nut_wx", "nut_wy", "nut_wz")
        }
        options = {"priors": {"I_1": (1.25e-4, 1e-6)}, "noise": dict.fromkeys(rates, 0.05)}
        begin = {"I_1": 1.5e-4, "I_2": 3.3e-4, "I_3": 4.2e-4}
        for bounds in (None, {"I_1": (0.0, 1.0)}):  # with bounds moments themselves are sought
            found = eomgen.fit(
                "tumbling_body",
                {"t": run.t, **rates},
                list(truth),
                parameters=begin,
                bounds=bounds,
                **options,
            )
            one, two, three = found.values.values()
            assert one + two >= three * (1 - 1e-6)
            prior = ((one - 1.25e-4) / 1e-6) ** 2
            squares = sum(float(np.sum(r[0] ** 2)) for r in found.residuals.values())
            sums[seed, bounds is None] = squares / 0.05**2 + prior
    assert all(sums[seed, True] <= sums[seed, False] * (1 + 1e-6) for seed in range(3))
    assert any(sums[seed, True] < sums[seed, False] * 0.99 for seed in range(3))
