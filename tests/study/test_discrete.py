"""Linear systems from one sample to the next."""

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.linalg import expm
from scipy.signal import cont2discrete

import eomgen
import eomgen.entries
from eomgen.base.errors import RunError

UP = {"theta_deg": 180.0}
HOLD = {"name": "hold", "period": 0.1, "inputs": {"push": "-x"}}


def test_inputs_are_held_and_noise_adds_up() -> None:
    linear = eomgen.linearise("cart_pole", state=UP)
    density = np.diag([0.0, 0.0, 1.0, 2.0])
    found = linear.discrete(0.05, density)
    A, B, *_ = cont2discrete((linear.A, linear.B, np.eye(4), np.zeros((4, 1))), 0.05)
    np.testing.assert_allclose(found.A, A, atol=1e-14)
    np.testing.assert_allclose(found.B, B, atol=1e-14)

    def added(s: float) -> np.ndarray:
        ahead = expm(s * linear.A)
        return np.asarray(ahead @ density @ ahead.T)

    np.testing.assert_allclose(found.Q, quad_vec(added, 0, 0.05)[0], atol=1e-15)
    assert not linear.discrete(0.05).Q.any()
    for period in (0.0, -1.0, np.nan):
        with pytest.raises(RunError, match=r"period: \S+ is not a positive time; give one in s"):
            linear.discrete(period)
    with pytest.raises(RunError, match=r"noise: has shape \(3, 3\), not \(4, 4\)"):
        linear.discrete(0.1, np.eye(3))


def test_samples_are_those_of_the_linear_system() -> None:
    """A small deviation under a held force, from one sample to the next."""
    found = eomgen.linearise("cart_pole", state=UP).discrete(0.1)
    state = {"x": 1e-6, "theta": np.pi - 2e-6, "x_dot": 1e-6, "theta_dot": 3e-6}
    given = {"inputs": {"push": 1e-5}, "rtol": 1e-13, "atol": 1e-18}
    run = eomgen.simulate("cart_pole", state=state, t_end=0.1, samples=2, **given)
    expected = found.A @ [1e-6, -2e-6, 1e-6, 3e-6] + found.B @ [1e-5]
    np.testing.assert_allclose(run.y[-1] - [0, np.pi, 0, 0], expected, atol=2e-15)


def test_controllers_that_sample_are_left_out() -> None:
    """Of the scene with one the inputs are left; `state_space` may be of samples."""
    scene = eomgen.read("cart_pole")
    made = eomgen.entries.SampledController(**HOLD)
    held = scene.replaced(effects=(*scene.effects, made))
    linear, same = (eomgen.linearise(each, state=UP) for each in (held, scene))
    assert np.array_equal(linear.A, same.A) and np.array_equal(linear.B, same.B)
    assert linear.input_names == ("push",)
    pytest.importorskip("control")
    plant = eomgen.state_space(held, state=UP, period=0.1)
    assert plant.dt == 0.1 and np.array_equal(plant.A, same.discrete(0.1).A)
