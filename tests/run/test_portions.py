"""Steps that a place makes several at once."""

from typing import Any

import numpy as np
import pytest

import eomgen
from eomgen.engine.adaptive_steps import adaptive_steps
from eomgen.run.integrate import integrate
from eomgen.run.integrators import fixed_step, in_python
from eomgen.run.problem import Problem
from eomgen.run.tally import Tally


def pendulum(fails_at: float = np.inf) -> Problem:
    """A pendulum whose derivative has no value from a time on."""

    def derivative(t: float, y: Any) -> Any:
        if t >= fails_at:
            raise ZeroDivisionError("nothing there")
        return np.array([y[1], -np.sin(y[0])])

    def jacobian(t: float, y: Any) -> Any:
        return np.array([[0.0, 1.0], [-np.cos(y[0]), 0.0]])

    return Problem("pendulum", ("q", "v"), (0,), derivative, jacobian, np.array([1.0, 0.0]))


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The numbers of steps that Python has made at once."""
    made: list[int] = []
    usual = fixed_step.equal_steps

    def noted(*given: Any) -> int:
        why = usual(*given)
        made.append(given[-1].made)
        return why

    def noted_adaptive(*given: Any) -> int:
        why = adaptive_steps(*given)
        made.append(given[-1].made)
        return why

    monkeypatch.setattr(fixed_step, "equal_steps", noted)
    monkeypatch.setattr(in_python, "adaptive_steps", noted_adaptive)
    return made


def test_singular_positions_are_looked_for_by_portions(made: list[int]) -> None:
    """Where loops are closed in closed form: the margins of many steps are computed together."""
    run = eomgen.simulate("four_bar", integrator="rk4", dt=1e-3, t_end=0.1, backend="numpy")
    assert run.finished and max(made) > 10


@pytest.mark.parametrize("method", ["rk4", "gauss_4"])
def test_python_makes_the_steps_of_the_engine(method: str, made: list[int]) -> None:
    """Many at once, where nothing has to look at each: the first and the last alone."""
    run = integrate(pendulum(), method, 6.005, dt=0.01)
    assert run.finished and sum(made) == run.counts["steps"] == 601
    assert max(made) == fixed_step.AHEAD // 2 and made[-1] == 1


@pytest.mark.parametrize("method", ["DOP853", "Rodas5P", "RK45"])
def test_adaptive_steps_are_made_by_the_engine(method: str, made: list[int]) -> None:
    """Also several at once, where nothing has to look at each."""
    run = integrate(pendulum(), method, 30.0, rtol=1e-8)
    assert run.finished and sum(made) == run.counts["steps"] and max(made) == in_python.AHEAD


@pytest.mark.parametrize("method", ["rk4", "gauss_4", "DOP853", "Rodas5P"])
def test_steps_before_an_error_are_kept(method: str) -> None:
    """They are kept, and counted, as in a run whose every step is looked at."""
    how: dict[str, Any] = {"dt": 0.01} if "4" in method else {"rtol": 1e-12, "samples": 101}
    seen: list[tuple[float, int, int]] = []

    def check(tally: Tally, t: float) -> None:
        seen.append((t, tally.derivatives, tally.jacobians))

    many = integrate(pendulum(0.505), method, 2.0, **how)
    each = integrate(pendulum(0.505), method, 2.0, **how, tally=Tally(check))
    assert many.outcome == each.outcome and "nothing there" in many.message
    near = 1e-9 if "4" in method else 0.1
    assert many.t.tolist() == each.t.tolist() and abs(many.t[-1] - 0.5) < near
    assert many.y.tobytes() == each.y.tobytes() and many.counts == each.counts
    assert len(seen) == many.counts["steps"] > 5
    if "dt" in how:
        spread = np.ptp(np.diff([d for _, d, _ in seen]))
        assert len(seen) == 50 and spread <= (method == "gauss_4") * 8
    assert many.counts["derivatives"] > seen[-1][1]  # with those of the step that failed
