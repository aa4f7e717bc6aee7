"""Controllers that sample: what a run makes of them, against a loop by hand."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import eomgen
import eomgen.entries
from eomgen.base.errors import EomgenError
from eomgen.engine.sampling import logarithm, normal
from eomgen.model.elaborate import elaborate
from eomgen.run.sampling import _ticks
from eomgen.scene.reader import read_scene
from eomgen.scene.schema import Scene

PERIOD = 0.02
GAINS = (1.5, 2.5, -30.0, -6.0)
BALANCE = {
    "type": "sampled_controller",
    "name": "balance",
    "period": PERIOD,
    "delay": 0.03,
    "sensors": {
        "place": {"value": "x", "noise": 1e-3, "quantum": 2e-3},
        "tilt": {"value": "theta - pi", "noise": 2e-3},
    },
    "states": {"old_place": {"next": "place"}, "old_tilt": {"next": "tilt", "initial": -0.05}},
    "inputs": {
        "push": "1.5*place + 2.5*(place - old_place)/0.02 - 30*tilt - 6*(tilt - old_tilt)/0.02"
    },
}
EFFECT = dict[str, Any]


def balanced(**keys: Any) -> Scene:
    """The cart and pole with that controller."""
    scene = read_scene("cart_pole")
    controller = eomgen.entries.SampledController(**{**_without_type(BALANCE), **keys})
    return scene.replaced(effects=(*scene.effects, controller))


def _without_type(table: EFFECT) -> EFFECT:
    return {key: value for key, value in table.items() if key != "type"}


def hashed(*numbers: int) -> float:
    """A number from 0 to 1 by splitmix64, in the arithmetic of NumPy's whole numbers."""
    state = np.uint64(0)
    with np.errstate(over="ignore"):
        for number in numbers:
            state = (state ^ np.uint64(number)) + np.uint64(0x9E3779B97F4A7C15)
            state = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
            state = (state ^ (state >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
            state = state ^ (state >> np.uint64(31))
    return float(state >> np.uint64(11)) / 2.0**53


def drawn(sensor: int, sample: int) -> float:
    """A normal number of seed 1, by the polar method."""
    for attempt in range(0, 100, 2):
        a = 2 * hashed(1, sensor, sample, attempt) - 1
        b = 2 * hashed(1, sensor, sample, attempt + 1) - 1
        if 0 < a * a + b * b < 1:
            return a * math.sqrt(-2 * math.log(a * a + b * b) / (a * a + b * b))
    raise AssertionError


def by_hand(samples: int) -> np.ndarray:
    """Readings and held forces after each sample, by SciPy's steps of the scene without it."""
    module = eomgen.load(eomgen.generate("cart_pole"))
    y, before, due = module.initial_state(), np.array([0.0, -0.05]), [0.0, 0.0]
    force, found = 0.0, []

    def on(y: np.ndarray, start: float, end: float) -> np.ndarray:
        given = {"args": (None, [force]), "rtol": 1e-12, "atol": 1e-13}
        done = solve_ivp(module.derivative, (start, end), y, "DOP853", **given)
        return done.y[:, -1]

    for k in range(samples):
        place = 2e-3 * round((y[0] + 1e-3 * drawn(0, k)) / 2e-3)
        read = np.array([place, y[1] - math.pi + 2e-3 * drawn(1, k)])
        rates = (read - before) / PERIOD
        parts = np.array([read[0], rates[0], read[1], rates[1]])
        due[1], before = float(np.dot(GAINS, parts)), read
        found.append([*y, *read, force])
        y = on(y, k * PERIOD, (k + 0.5) * PERIOD)
        force, due[0] = due[0], due[1]
        y = on(y, (k + 0.5) * PERIOD, (k + 1) * PERIOD)
    return np.array(found)


def test_a_sampled_run_is_that_of_a_loop_by_hand() -> None:
    run = eomgen.simulate(balanced(), t_end=1.0, samples=51)
    names = ("x", "theta", "x_dot", "theta_dot", "place", "tilt", "push")
    assert run.finished
    found = np.column_stack([run[name] for name in names])[:50]
    np.testing.assert_allclose(found, by_hand(50), atol=1e-8)
    assert abs(run["tilt"][-20:]).max() < 0.3


def test_places_give_the_same_bits(tmp_path: Path) -> None:
    scene = balanced()
    plain = eomgen.simulate(scene, t_end=0.5, samples=26, backend="numpy")
    fast = eomgen.simulate(scene, t_end=0.5, samples=26, backend="c")
    swept = eomgen.ensemble(scene, {"balance_seed": [1.0, 2.0]}, t_end=0.5, samples=26)
    assert fast.compiled
    assert plain.y.tobytes() == fast.y.tobytes() == swept.rows[0].tobytes()
    other = eomgen.simulate(scene, t_end=0.5, samples=26, parameters={"balance_seed": 2.0})
    assert other.y.tobytes() == swept.rows[1].tobytes() != plain.y.tobytes()
    steps = {"integrator": "rk4", "dt": 1e-3}
    both = [
        eomgen.simulate(scene, t_end=0.5, samples=26, backend=b, **steps) for b in ("numpy", "c")
    ]
    assert both[0].y.tobytes() == both[1].y.tobytes()
    np.testing.assert_allclose(both[0].y, plain.y, atol=1e-7)


def test_a_run_goes_on_as_if_it_had_not_ended() -> None:
    scene, whole = balanced(), eomgen.simulate(balanced(), t_end=0.5)
    for t_end in (0.2, 0.29, 0.295):
        part = eomgen.simulate(scene, t_end=t_end)
        rest = eomgen.simulate(scene, t_end=0.5, resume=part)
        assert rest.y[-1].tobytes() == whole.y[-1].tobytes(), t_end


def test_times_are_whole_ticks() -> None:
    """Seven periods of 0.01 s are one of 0.07 s, and no sum of periods rounds."""
    fast = {**BALANCE, "name": "fast", "period": 0.01, "delay": 0, "inputs": {}, "sensors": {}}
    count = {"states": {"many": {"next": "many + 1"}, "at": {"next": "t"}}}
    slow = {"name": "slow", "period": 0.07, "states": {"sevens": {"next": "many"}}}
    scene = read_scene("cart_pole")
    made = (
        eomgen.entries.SampledController(**_without_type({**fast, **count})),
        eomgen.entries.SampledController(**slow),
    )
    scene = scene.replaced(effects=(*scene.effects, *made))
    run = eomgen.simulate(scene, t_end=2.1, samples=211)
    assert run["many"].tolist() == list(range(1, 212))
    assert run["at"].tolist() == [k / 100 for k in range(211)]
    assert run["sevens"].tolist() == [7.0 * (k // 7) for k in range(211)]
    assert _ticks(0.07, 100.0, 1.0, 0.0) == 8.0
    assert _ticks(np.nextafter(0.07, 0), 100.0, 7.0, 0.0) == 1.0


def test_noise_is_normal_and_without_a_library() -> None:
    x = np.random.default_rng(0).random(2000)
    found = [logarithm(value) for value in x]
    np.testing.assert_allclose(found, np.log(x), rtol=1e-15)
    z = np.array([normal(3.0, float(i % 3), float(i // 3)) for i in range(9000)])
    assert abs(z.mean()) < 0.03 and abs(z.std() - 1) < 0.03
    assert abs(np.corrcoef(z.reshape(-1, 3).T) - np.eye(3)).max() < 0.05
    assert abs((np.abs(z) > 1.959964).mean() - 0.05) < 0.01


def test_a_function_is_the_same_controller() -> None:
    def function(t: float, sensed: Any, state: Any) -> Any:
        place, tilt = sensed["place"], sensed["tilt"]
        d = (np.array([place, tilt]) - state["old"]) / 0.02
        return {"push": 1.5 * place + 2.5 * d[0] - 30 * tilt - 6 * d[1]}, {"old": [place, tilt]}

    keys = {key: BALANCE[key] for key in ("period", "delay", "sensors", "name")}
    made = eomgen.Controller(
        function=function, inputs=["push"], states={"old": np.array([0, -0.05])}, **keys
    )
    run = eomgen.simulate("cart_pole", controllers=[made], t_end=0.5)
    same = eomgen.simulate("cart_pole", controllers=[_without_type(BALANCE)], t_end=0.5)
    np.testing.assert_allclose(run.y[:, :8], same.y[:, :8], atol=1e-9)

    def wrong(t: float, sensed: Any, state: Any) -> Any:
        return {"pusj": 1.0, "push": 0.0}

    made = eomgen.Controller(function=wrong, inputs=["push"], period=0.1)
    with pytest.raises(EomgenError, match=r"returned input 'pusj', which is none \(did you mean"):
        eomgen.simulate("cart_pole", controllers=[made], t_end=0.5)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"period": 0}, "period: 0 is not positive; give a number > 0"),
        ({"delay": -0.1}, "delay: -0.1 is too small; give at least 0"),
        ({"delay": 9}, "effects[2].delay: 9 s is more than 100 periods of 0.02 s"),
        ({"inputs": {"pusj": "1"}}, "effects[2].inputs.pusj: no input is named 'pusj' (did you"),
        ({"inputs": {"push": "tlt"}}, "effects[2].inputs.push: unknown parameter 'tlt' (did you"),
        ({"period": 0.1234567891}, "the periods and delays of balance have no common tick"),
        ({"seed": 0.5}, "seed of balance: 0.5 is not a whole number from 0 to 2^53; give one"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(keys: EFFECT, said: str) -> None:
    with pytest.raises(EomgenError) as error:
        eomgen.simulate(balanced(**keys), t_end=0.1)
    assert said in str(error.value)
    assert len(str(error.value).splitlines()) == 1


@pytest.mark.parametrize("value", [1.0, "2*t", lambda t: t])
def test_an_input_that_is_driven_takes_no_value(value: Any) -> None:
    with pytest.raises(EomgenError, match="inputs: the controller 'balance' drives 'push'; give"):
        eomgen.simulate(balanced(), inputs={"push": value})


def test_two_controllers_do_not_drive_one_input() -> None:
    scene = balanced()
    other = eomgen.entries.SampledController(name="other", period=1.0, inputs={"push": "1"})
    with pytest.raises(EomgenError, match=r"effects\[3\].inputs.push: 'balance' drives it, too"):
        elaborate(scene.replaced(effects=(*scene.effects, other)))
