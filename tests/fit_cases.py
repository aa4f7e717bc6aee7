"""Experiments with known truth: what is fitted, and what would have been measured without noise."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

import eomgen

FloatArray = NDArray[np.float64]
SWING = """
name = "swing"
parameters = { m = 0.5, l = 0.6, b = 0.01 }
initial = { q = { theta_deg = 60 } }
[[bodies]]
name = "rod"
mass = "m"
inertia_com = "m*l**2/12"
[[joints]]
name = "pivot"
type = "revolute"
parent = "world"
child = "rod"
r_child = [0, "l/2"]
coordinate = "theta"
[[points]]
name = "tip"
body = "rod"
at = [0, "-l/2"]
[[effects]]
type = "gravity"
g = 9.81
[[effects]]
type = "joint_friction"
name = "bearing"
joint = "pivot"
viscous = "b"
"""
SLED = """
name = "sled"
parameters = { m = 2.0, k = 30.0, c = 0.5, cubic = 20.0 }
initial = { q = { x = 0.5 } }
[[bodies]]
name = "sled"
mass = "m"
inertia_com = 0
[[joints]]
name = "rail"
type = "prismatic"
axis = [1, 0]
parent = "world"
child = "sled"
coordinate = "x"
[[effects]]
type = "motor"
name = "law"
joint = "rail"
torque = "-k*x - cubic*x**3 - c*x_dot"
[[effects]]
type = "motor"
name = "push"
joint = "rail"
torque = "input"
"""


@dataclass(frozen=True)
class Case:
    """An experiment, or several.

    truth   the values that are fitted, by name: parameters, and states of all experiments
    noise   standard deviation of the noise of each measured column
    begin   the values where the search begins, relative to the true ones
    inputs  by name the frequencies, rad/s, of sums of sines of amplitude `push`
    states  the initial state of each experiment
    prior   whether the first value has one
    lost    the part of samples that are missing
    """

    source: str
    truth: Mapping[str, float]
    noise: Mapping[str, float]
    t_end: float = 2.0
    samples: int = 60
    begin: float = 1.15
    inputs: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    states: tuple[Mapping[str, float], ...] = ({},)
    prior: float = 0.0
    lost: float = 0.0
    push: float = 1.0

    @property
    def times(self) -> FloatArray:
        """When is measured, s."""
        return np.linspace(0.0, self.t_end, self.samples)

    @property
    def parameters(self) -> dict[str, float]:
        """The true values of parameters."""
        known = {p.name for p in eomgen.check(self.source).parameters}
        return {name: x for name, x in self.truth.items() if name in known}

    @property
    def given(self) -> dict[str, FloatArray]:
        """The inputs at these times."""
        t = self.times
        return {
            name: self.push * sum(np.sin(w * t) for w in ws) for name, ws in self.inputs.items()
        }

    @cache  # noqa: B019
    def exact(self) -> list[dict[str, FloatArray]]:
        """What is measured without noise, for each experiment."""
        found = []
        outputs = tuple({name.partition(".")[0] for name in self.noise if "." in name})
        for state in self.states:
            parameters = self.parameters
            own = {n: x for n, x in self.truth.items() if n not in parameters} | dict(state)
            extra: Any = {"inputs": Table({"t": self.times, **self.given})} if self.inputs else {}
            run = eomgen.simulate(
                self.source,
                t_end=self.t_end,
                samples=self.samples,
                parameters=parameters,
                state=own,
                save=outputs,
                rtol=1e-10,
                **extra,
            )
            rows = [int(np.argmin(abs(run.t - t))) for t in self.times]
            assert np.allclose(run.t[rows], self.times)
            table = run.to_dataframe()
            found.append({n: np.array(table[n.replace(".", "_")])[rows] for n in self.noise})
        return found

    def __hash__(self) -> int:
        return id(self)

    def draw(self, seed: int) -> tuple[list[dict[str, Any]], dict[str, Any]]:
        """The data with noise, and the options of `fit`."""
        rng = np.random.default_rng(seed)
        data = []
        for exact in self.exact():
            columns = {n: x + rng.normal(0.0, self.noise[n], len(x)) for n, x in exact.items()}
            for values in columns.values():
                values[rng.random(len(values)) < self.lost] = np.nan
            data.append({"t": self.times, **columns, **self.given})
        options: dict[str, Any] = {
            "parameters": {name: x * self.begin for name, x in self.parameters.items()},
        }
        if len(data) == 1:
            options["state"] = dict(self.states[0])
        if self.prior:
            name, x = next(iter(self.truth.items()))
            options["priors"] = {name: (rng.normal(x, self.prior * abs(x)), self.prior * abs(x))}
        return data, options

    def true(self, name: str) -> float:
        """The true value of what is fitted, in one of the experiments."""
        plain, _, number = name.partition("[")
        if plain in self.truth:
            return self.truth[plain]
        return self.states[int(number.rstrip("]") or 0)][plain]

    @property
    def names(self) -> list[str]:
        """What is fitted."""
        several = self.states[0] if len(self.states) > 1 else {}
        return [*self.truth, *several]


class Table:
    """Columns by name, as a DataFrame has them."""

    def __init__(self, columns: Mapping[str, Any]) -> None:
        self.columns, self._values = list(columns), columns

    def __getitem__(self, name: str) -> Any:
        return self._values[name]


CASES = {
    "swing": Case(SWING, {"b": 0.035, "l": 0.6, "theta": 1.05}, {"theta": 0.01}, 4.0),
    "sled": Case(
        SLED,
        {"m": 2.0, "k": 30.0, "c": 0.8, "cubic": 25.0},
        {"x": 0.005, "x_dot": 0.02},
        3.0,
        inputs={"push": (3.0, 7.0, 11.0)},
    ),
    "cart_pole": Case(
        "cart_pole",
        {"m_cart": 1.0, "m_pole": 0.2, "I_pole": 0.006},
        {"x": 0.002, "theta": 0.01},
        inputs={"push": (4.0, 9.0)},
        begin=1.03,
        lost=0.3,
    ),
    "acrobot": Case(
        "acrobot",
        {"m_2": 1.0, "I_1": 0.2, "I_2": 1.0},
        {"theta_1": 0.005, "theta_2": 0.01},
        inputs={"tau": (3.0, 8.0)},
        begin=1.05,
    ),
    "two_swings": Case(
        "double_pendulum",
        {"l_1": 1.0, "l_2": 0.8},
        {"theta_1": 0.01, "theta_2": 0.01},
        1.5,
        states=({"theta_1": 0.5, "theta_2": -0.2}, {"theta_1": 0.2, "theta_2": 0.6}),
    ),
    "two_body": Case(
        "two_body",
        {"I_A": 0.06, "l_A": 0.4, "theta_dot": 3.0},
        {"x_A": 0.005, "y_A": 0.005, "theta": 0.01, "phi": 0.01},
        1.0,
    ),
    "spinning_top": Case(
        "spinning_top",
        {"I_1": 1.6e-4, "I_3": 2.5e-4},
        {"point_positions.peg.x": 0.001, "point_positions.peg.y": 0.001},
        1.0,
        begin=1.02,
    ),
    "furuta": Case(
        "furuta_pendulum",
        {"l_pendulum": 0.34, "m_pendulum": 0.125, "m_arm": 0.25},
        {"theta": 0.005, "phi": 0.01},
        inputs={"tau": (5.0, 13.0)},
        push=0.1,
        begin=1.05,
    ),
    "tumbling": Case(
        "tumbling_body",
        {"I_1": 1.6e-4, "I_2": 3.6e-4, "nut_wy": 6.0},
        {"point_positions.stem.x": 0.001, "point_positions.stem.z": 0.001},
        2.0,
        begin=1.02,
    ),
    "prior": Case(SWING, {"m": 0.5, "b": 0.035}, {"theta": 0.01}, 4.0, prior=0.05),
}
"""The experiments by name."""
