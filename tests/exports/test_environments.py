"""Environments of Gymnasium: its own check, the run that they are, seeds, lanes, mistakes."""

from typing import Any

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import eomgen
from eomgen.scene.built_in import BUILT_IN

pytestmark = pytest.mark.apart

GIVEN: dict[str, Any] = {
    "actions": {"push": (-1.0, 1.0)},
    "start": {"theta": ("uniform", 3.0, 3.3)},
    "ended": "abs(theta - pi) > 0.5",
    "t_end": 2.0,
}
REWARD = "1 - push**2"
LOOP = (
    (BUILT_IN / "four_bar.toml")
    .read_text("utf-8")
    .replace("stall*(1 - theta_dot/no_load)", "input")
)


@pytest.mark.filterwarnings("ignore:.*Box observation space (minimum|maximum) value")
def test_gymnasium_accepts_it() -> None:
    """Spaces, seeds, what reset and step return."""
    check_env(eomgen.environment("cart_pole", REWARD, **GIVEN), skip_render_check=True)


def test_an_episode_is_the_run() -> None:
    """With a constant action it is `simulate` by rk4, whose steps are the parts of its steps."""
    env = eomgen.environment("cart_pole", "t", actions=GIVEN["actions"], dt=0.02, parts=2)
    first, _ = env.reset(seed=0)
    for _ in range(25):
        seen, reward, failed, cut, info = env.step(np.array([0.5]))
    assert (failed, cut, info["diverged"]) == (False, False, False)
    assert reward == info["t"] == 0.5
    run = eomgen.simulate(
        "cart_pole", t_end=0.5, integrator="rk4", dt=0.01, inputs={"push": 0.5}, backend="numpy"
    )
    assert np.array_equal(first, run.y[0])
    assert np.allclose(seen, run.y[-1], rtol=1e-13, atol=1e-15)


def test_lanes_are_environments_of_their_own() -> None:
    """Each lane steps as one environment from its start; those that failed begin anew."""
    many = eomgen.environment("cart_pole", REWARD, lanes=8, **GIVEN)
    seen, _ = many.reset(seed=5)
    again, _ = many.reset(seed=5)
    assert np.array_equal(seen, again)
    assert len(set(seen[:, 1])) == 8
    one = eomgen.environment("cart_pole", REWARD, **GIVEN)
    one.reset(seed=1)
    one.lanes.y[:, 0] = seen[3]
    before = np.zeros(8, dtype=bool)
    began = 0
    for i in range(60):
        actions = np.full((8, 1), np.sin(0.3 * i))
        seen, reward, failed, cut, _ = many.step(actions)
        if not before[3] and not began:
            alone = one.step(actions[3])
            assert np.allclose(alone[0], seen[3], rtol=1e-12)
            assert (alone[2], alone[3]) == (failed[3], cut[3])
        assert np.all(np.abs(seen[before, 1] - np.pi) < 0.2)
        assert not reward[before].any()
        began += int(before[3])
        before = failed | cut
    assert began


def test_loops_that_are_projected_stay_closed() -> None:
    """Starts are drawn onto the constraints, and every step ends there."""
    task: dict[str, Any] = {"actions": {"drive": (-5.0, 5.0)}, "lanes": 3}
    many = eomgen.environment(LOOP, "1", start={"theta": ("uniform", 0.6, 0.8)}, **task)
    seen, _ = many.reset(seed=0)
    rows = [seen, *(many.step(np.full((3, 1), 2.0))[0] for _ in range(20))]
    module = many.lanes.task.module
    gaps = [np.abs(module.constraint_residuals(0.0, row.T)).max() for row in rows]
    assert max(gaps) < 1e-12 and np.abs(rows[-1] - rows[0]).max() > 0.01


def test_what_diverges_ends_its_episode() -> None:
    """It keeps its last finite state."""
    env = eomgen.environment("cart_pole", REWARD, actions=GIVEN["actions"], dt=5.0, parts=1)
    env.reset(seed=0)
    env.lanes.y[2:] = 1e200
    seen, _, failed, _, info = env.step(np.array([1.0]))
    assert failed and info["diverged"]
    assert np.isfinite(seen).all()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"actions": {"pusch": (0, 1)}}, r"actions: no input 'pusch' \(did you mean 'push'\?\)"),
        ({"actions": {"push": (1, 1)}}, "give two numbers, the smaller first"),
        ({"actions": {}}, "name at least one input"),
        ({"reward": "thetta"}, r"reward: no state, input or parameter 'thetta' \(did you mean"),
        ({"ended": "theta >"}, "ended: 'theta >' "),
        ({"start": {"phi": ("uniform", 0, 1)}}, "start: no state 'phi'"),
        ({"dt": 0.0}, "dt: 0 s is not between"),
        ({"lanes": 0}, "give positive numbers"),
    ],
)
def test_mistakes_are_a_line(change: dict[str, Any], said: str) -> None:
    """Each names the argument, and what to do."""
    given = {"source": "cart_pole", "reward": REWARD, **GIVEN, **change}
    with pytest.raises(eomgen.RunError, match=said) as caught:
        eomgen.environment(given.pop("source"), given.pop("reward"), **given)
    assert len(caught.value.lines) == 1
