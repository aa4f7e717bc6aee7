"""Random trees, joints and states over 24 decades of everything: right, or refused."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
import pytest
import scaled_trees
from campaign import some
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scaled_trees import Refused, apart, drawn, found, size_of, state, truth

from eomgen.errors import SceneError

BOUND, TIMES = 1e-10, 1e3
"""Of v̇ relative to its largest component, or that of ω v; and of what half a unit in the last place
of all data changes it by."""


def tried(seed: int, dimensions: int, decades: Sequence[float], special: bool) -> str:
    """What came of a case: 'right', 'refused', or, in words, an error that is too large."""
    try:
        tree = drawn(seed, dimensions, decades)
    except SceneError:
        return "refused"
    q, v = state(tree, seed, special)
    r = np.random.default_rng(seed)
    u = {i.name: float(r.uniform(-9, 9)) for i in tree.inputs}
    try:
        true, allowed = truth(tree, q, v, u)
        off = apart(found(tree, q, v, u), true, size_of(true, tree, v))
    except (Refused, ZeroDivisionError):
        return "refused"
    bound = BOUND + TIMES * allowed
    return "right" if off <= bound else f"off by {off:.1e}, allowed {bound:.1e}"


@settings(
    max_examples=some(150, 100_000),
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[*HealthCheck],
)
@given(
    seed=st.integers(0, 2**32 - 1),
    dimensions=st.sampled_from((2, 3)),
    decades=st.lists(st.floats(-12, 12), min_size=1, max_size=30),
    special=st.booleans(),
)
def test_right_or_refused(seed: int, dimensions: int, decades: list[float], special: bool) -> None:
    """No error beyond its bound goes unsaid. `campaigns.silent_errors` tries 1e5 cases."""
    outcome = tried(seed, dimensions, decades, special)

    assert outcome in ("right", "refused"), outcome


def test_most_are_right() -> None:
    """Refusing everything would be no answer."""
    outcomes = Counter(tried(seed, 2 + seed % 2, [0.0], bool(seed % 3)) for seed in range(20))
    assert outcomes == {"right": 20}


def test_it_can_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    """Articulated bodies alone are silently wrong."""
    monkeypatch.setattr(scaled_trees, "taken", lambda model: "aba")
    r = np.random.default_rng(1)
    cases = ((seed, 2, r.uniform(-12, 12, 30).tolist(), False) for seed in range(60))
    assert any(tried(*case).startswith("off") for case in cases)
