"""Systems for python-control: against the module, differences, and a simulation of its own."""

from typing import Any

import control
import numpy as np
import pytest

import eomgen

pytestmark = pytest.mark.apart


def test_the_state_space_of_a_cart_and_pole() -> None:
    """A and B are those of `linearise`; C and D those of the tip and of the force at the rail.

    The tip of a rod of length 2 l that hangs at angle θ is at x + 2 l sin θ.
    """
    outputs = ["theta", "point_positions.tip.x", "joint_forces.rail.fx"]
    found = eomgen.state_space("cart_pole", state={"theta_deg": 175}, outputs=outputs)
    linear = eomgen.linearise("cart_pole", state={"theta_deg": 175})
    assert np.array_equal(found.A, linear.A) and np.array_equal(found.B, linear.B)
    assert found.state_labels == list(linear.state_names) and found.input_labels == ["push"]
    assert found.output_labels == [name.replace(".", "_") for name in outputs]
    slopes = [[0, 1, 0, 0], [1, -1, 0, 0], [0, 0, 0, 0]]
    np.testing.assert_allclose(found.C, slopes, rtol=0, atol=1e-14)
    assert found.D.ravel() == pytest.approx([0, 0, -1])  # what pushes the cart pushes the rail back
    whole = eomgen.state_space("cart_pole", state={"theta_deg": 175})
    assert np.array_equal(whole.C, np.eye(4)) and not whole.D.any() and whole.name == "cart_pole"


@pytest.mark.every(2)
@pytest.mark.parametrize(
    ("scene", "outputs"),
    [
        ("spinning_top", ["body_poses", "momentum", "kinetic_energy", "tip_wx"]),
        ("four_bar", ["body_poses.coupler", "body_velocities.coupler", "phi"]),
        ("acrobot", ["centre_of_mass", "joint_forces", "theta_2"]),
    ],
)
def test_c_is_the_slope_of_the_outputs(scene: str, outputs: list[str]) -> None:
    """Along each deviation: three of a quaternion, the independent ones of a loop. The motion is
    one of their combinations.
    """
    found = eomgen.state_space(scene, at="initial", outputs=outputs)
    linear = eomgen.linearise(scene, at="initial")
    rates, *_ = np.linalg.lstsq(linear.basis, linear.rates, rcond=None)
    assert linear.basis @ rates == pytest.approx(linear.rates, rel=1e-9, abs=1e-9)
    system = eomgen.nonlinear_system(scene, outputs=outputs)
    assert system.output_labels == found.output_labels

    for row, name in zip(found.C, found.output_labels, strict=True):
        if name in found.state_labels:
            assert np.array_equal(row, [other == name for other in found.state_labels])

    # Of a loop in closed form the system has the independent coordinates only.
    own = [linear.state_names.index(name) for name in system.state_labels]

    def seen(deviation: Any) -> Any:
        return system.output(0.0, (linear.y + deviation)[own], linear.u)

    h, fourth = 1e-3, ((1, 2 / 3), (2, -1 / 12))  # differences of fourth order
    for column, way in zip(found.C.T, linear.basis.T, strict=True):
        slope = sum(c * (seen(n * h * way) - seen(-n * h * way)) / h for n, c in fourth)
        assert column == pytest.approx(slope, rel=1e-8, abs=1e-8 * np.abs(found.C).max())


def test_the_nonlinear_system_moves_as_the_scene() -> None:
    """python-control integrates it, with a parameter of its own; its linearisation is ours."""
    system = eomgen.nonlinear_system("cart_pole")
    start = {"x": 0.1, "theta": 2.0, "x_dot": 0.0, "theta_dot": 0.0}
    t = np.linspace(0.0, 1.0, 5)
    found = control.input_output_response(
        system, t, 0.5 * np.ones_like(t), [*start.values()], params={"l": 0.4},
        solve_ivp_kwargs={"rtol": 1e-10, "atol": 1e-10},
    )  # fmt: skip
    run = eomgen.simulate(
        "cart_pole", state=start, inputs={"push": 0.5}, parameters={"l": 0.4}, t_end=1.0,
        rtol=1e-10, atol=1e-10,
    )  # fmt: skip
    assert found.outputs[:, -1] == pytest.approx(run.y[-1], abs=1e-7)
    y = eomgen.linearise("cart_pole", state={"theta_deg": 180}).y
    near = system.linearize(y, [0.0])
    ours = eomgen.state_space("cart_pole", state={"theta_deg": 180})
    np.testing.assert_allclose(np.hstack([near.A, near.B]), np.hstack([ours.A, ours.B]), atol=1e-5)


@pytest.mark.parametrize(
    ("output", "said"),
    [
        ("thata", "outputs: no state or output 'thata' (did you mean 'theta'?)"),
        ("body_poses.pule", "outputs: body_poses has no component 'pule' (did you mean 'pole'?)"),
        ("forward_dynamics", "outputs: no state or output 'forward_dynamics'"),
    ],
)
def test_an_unknown_output_is_a_line(output: str, said: str) -> None:
    """By both functions."""
    for function in (eomgen.state_space, eomgen.nonlinear_system):
        with pytest.raises(eomgen.RunError) as caught:
            function("cart_pole", outputs=[output])
        assert str(caught.value).startswith(said)
