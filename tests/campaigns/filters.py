"""Consistency of Kalman filters that balance `cart_pole` by noisy samples, with seeded noise.

    python tests/campaigns/filters.py [RUNS [lqg|ekf]]

Two controllers sample at 50 Hz: place and angle with noise, and a gust that is held between samples
pushes the cart. `lqg` is a regulator with the stationary filter of the linear system, as formulas,
run as a sweep from states of the filter's own covariance. `ekf` is an extended Kalman filter in
Python, which starts 0.1 rad off and predicts by the nonlinear equations. An innovation ν with
covariance S is consistent if ν' S⁻¹ ν is within its 95 % band, of χ² with two degrees of freedom,
95 % of the time; and so is its mean over the runs, at each sample.
"""

import sys
from typing import Any

import numpy as np
from scipy.linalg import solve_discrete_are
from scipy.stats import chi2

import eomgen

PERIOD, SAMPLES = 0.02, 100
PLACE, TILT, GUST = 2e-3, 3e-3, 0.5
"""Standard deviations: m, rad, N."""
SPREAD = np.diag([0.02, 0.1, 0.05, 0.1]) ** 2
"""Covariance of the start of the extended filter: m, rad, and their rates."""
C = np.eye(4)[:2]
R = np.diag([PLACE, TILT]) ** 2
SENSORS = {
    "place": {"value": "x", "noise": PLACE},
    "tilt": {"value": "theta - pi", "noise": TILT},
    "gust": {"value": "0", "noise": GUST},
}
STATES = ("x", "theta", "x_dot", "theta_dot")
UP = np.array([0.0, np.pi, 0.0, 0.0])


def main() -> None:
    """Run both, and say how consistent they are."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 500
    good = True
    for name in sys.argv[2:] or ("lqg", "ekf"):
        found = {"lqg": lqg, "ekf": ekf}[name](runs)
        within, mean, bands = consistency(found)
        print(
            f"{name}: {runs} runs of {found.shape[1]} samples: {within:.1%} of the normalised "
            f"innovations within their 95 % band, mean {mean:.3f} of 1; means over the runs within "
            f"theirs at {bands:.1%} of the samples",
            flush=True,
        )
        good &= 0.94 <= within <= 0.96 and bands >= 0.9
    sys.exit(not good)


def consistency(found: np.ndarray) -> tuple[float, float, float]:
    """Of ν' S⁻¹ ν (runs, samples): the part within the band, the mean over that of χ², and the part
    of samples whose mean over the runs is within its band.
    """
    low, high = chi2.ppf([0.025, 0.975], 2)
    least, most = chi2.ppf([0.025, 0.975], 2 * len(found)) / len(found)
    means = found.mean(axis=0)
    within = float(((found >= low) & (found <= high)).mean())
    return within, float(found.mean() / 2), float(((means >= least) & (means <= most)).mean())


def design() -> tuple[Any, np.ndarray, np.ndarray, np.ndarray]:
    """The linear system at the samples, gains of regulator and filter, and the covariance of its
    predictions.
    """
    system = eomgen.linearise("cart_pole", state={"theta_deg": 180.0}).discrete(PERIOD)
    A, B = system.A, system.B
    P = solve_discrete_are(A, B, np.diag([4.0, 10.0, 1.0, 1.0]), [[0.1]])
    K = np.linalg.solve(0.1 + B.T @ P @ B, B.T @ P @ A)
    S = solve_discrete_are(A.T, C.T, GUST**2 * B @ B.T, R)
    return system, K, S @ C.T @ np.linalg.inv(C @ S @ C.T + R), S


def combined(row: np.ndarray, names: tuple[str, ...]) -> str:
    """A formula of the sum of names times factors."""
    return " + ".join(
        f"({factor!r})*{name}" for factor, name in zip(row.tolist(), names, strict=True)
    )


def lqg_controller() -> dict[str, Any]:
    """The regulator with its filter, as formulas of readings and predicted states p1 to p4."""
    system, K, L, _ = design()
    rest = np.eye(4) - L @ C
    own, read = tuple(f"p{i}" for i in range(1, 5)), ("place", "tilt")
    push = np.hstack([-K @ rest, -K @ L])[0]
    after = (system.A - system.B @ K) @ np.hstack([rest, L])
    states = {n: {"next": combined(row, (*own, *read))} for n, row in zip(own, after, strict=True)}
    states |= {f"off_{n}": {"next": f"{n} - {p}"} for n, p in zip(read, own, strict=False)}
    inputs = {"push": f"{combined(push, (*own, *read))} + gust"}
    given = {"name": "lqg", "period": PERIOD, "sensors": SENSORS}
    return {**given, "states": states, "inputs": inputs}


def lqg(runs: int) -> np.ndarray:
    """Its normalised innovations (runs, samples)."""
    _, _, _, S = design()
    starts = np.random.default_rng(7).multivariate_normal(UP, S, runs)
    vary = {"lqg_seed": np.arange(1.0, runs + 1)}
    vary |= dict(zip(STATES, starts.T, strict=True))
    swept = eomgen.ensemble(
        *("cart_pole", vary),
        controllers=[lqg_controller()],
        t_end=SAMPLES * PERIOD,
        samples=SAMPLES + 1,
    )
    assert swept.rows is not None
    off = swept.rows[:, :, [swept.states.index(f"off_{name}") for name in ("place", "tilt")]]
    return np.einsum("rki,ij,rkj->rk", off, np.linalg.inv(C @ S @ C.T + R), off)


class Extended:
    """An extended Kalman filter with the regulator, and the gust that it does not know."""

    def __init__(self) -> None:
        self.module = eomgen.load(eomgen.generate("cart_pole", outputs=["input_jacobian"]))
        self.system, self.K, _, _ = design()

    def __call__(self, t: float, sensed: Any, state: Any) -> Any:
        x, P = state["mean"], state["covariance"]
        S = C @ P @ C.T + R
        off = np.array([sensed["place"], sensed["tilt"] + np.pi]) - x[:2]
        gain = P @ C.T @ np.linalg.inv(S)
        x, P = x + gain @ off, (np.eye(4) - gain @ C) @ P
        u = float(-self.K[0] @ (x - UP))
        ahead = self.predicted(x, u)
        slopes = np.array([self.predicted(x + d, u) - ahead for d in 1e-6 * np.eye(4)]).T / 1e-6
        along = (self.predicted(x, u + 1e-4) - ahead) / 1e-4
        P = slopes @ P @ slopes.T + GUST**2 * np.outer(along, along)
        held = {"push": u + sensed["gust"]}
        return held, {"mean": ahead, "covariance": P, "nis": off @ np.linalg.solve(S, off)}

    def predicted(self, x: np.ndarray, u: float) -> np.ndarray:
        """The state after a period, by two steps of order 4."""
        h = PERIOD / 2
        for _ in range(2):
            k = [self.module.derivative(0.0, x, None, [u])]
            for factor in (h / 2, h / 2, h):
                k.append(self.module.derivative(0.0, x + factor * k[-1], None, [u]))
            x = x + h / 6 * (k[0] + 2 * k[1] + 2 * k[2] + k[3])
        return x


def ekf(runs: int) -> np.ndarray:
    """Its normalised innovations (runs, samples)."""
    function, found = Extended(), []
    starts = np.random.default_rng(8).multivariate_normal(UP, SPREAD, runs)
    for number, start in enumerate(starts, 1):
        controller = eomgen.Controller(
            function=function,
            period=PERIOD,
            inputs=["push"],
            sensors=SENSORS,
            states={"mean": UP, "covariance": SPREAD, "nis": 0.0},
            seed=number,
        )
        run = eomgen.simulate(
            "cart_pole",
            controllers=[controller],
            state=dict(zip(STATES, start.tolist(), strict=True)),
            t_end=SAMPLES * PERIOD,
            samples=SAMPLES + 1,
        )
        found.append(run["nis"])
    return np.array(found)


if __name__ == "__main__":
    main()
