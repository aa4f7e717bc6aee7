"""`fit` beside SciPy's least squares with a model made by hand.

    python tests/benchmarks/fits.py [--count 10]

By hand is what users write: the equations of motion with Python's own numbers, `solve_ivp` with
DOP853 at the same rtol, inputs by `np.interp`, and `least_squares`, which takes differences for
the Jacobian. Both fit the same noisy samples from the same start. Printed are seconds of the
processor, the median of some fits, alternately; the ratio; the first fit with an empty store, which
derives and compiles; and by how much of a standard deviation the two differ.
"""

import argparse
import math
import os
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

sys.path.append(str(Path(__file__).parent.parent))

from fit_cases import CASES, FloatArray

import eomgen

RTOL = 1e-8
G = 9.81


def swing(t: float, y: FloatArray, p: dict[str, float], u: float) -> list[float]:
    """A rod on a pivot with friction."""
    theta, rate = y.tolist()
    m, length = 0.5, p["l"]
    torque = -p["b"] * rate - m * G * length / 2 * math.sin(theta)
    return [rate, torque / (m * length * length / 3)]


def sled(t: float, y: FloatArray, p: dict[str, float], u: float) -> list[float]:
    """A mass on a spring that stiffens."""
    x, v = y.tolist()
    return [v, (u - p["k"] * x - p["cubic"] * x**3 - p["c"] * v) / p["m"]]


def cart_pole(t: float, y: FloatArray, p: dict[str, float], u: float) -> list[float]:
    """A cart with a pole that hangs at theta = 0."""
    _, theta, v, w = y.tolist()
    length, m, total = LENGTH, p["m_pole"], p["m_cart"] + p["m_pole"]
    c, s = math.cos(theta), math.sin(theta)
    a, b, d = total, m * length * c, p["I_pole"] + m * length * length
    right = (u + m * length * w * w * s, -m * G * length * s)
    det = a * d - b * b
    return [v, w, (d * right[0] - b * right[1]) / det, (a * right[1] - b * right[0]) / det]


MODEL = eomgen.check("cart_pole")
LENGTH = MODEL.defaults["l"]
HAND: dict[str, tuple[Callable[..., list[float]], list[str]]] = {
    "swing": (swing, ["theta", "theta_dot"]),
    "sled": (sled, ["x", "x_dot"]),
    "cart_pole": (cart_pole, ["x", "theta", "x_dot", "theta_dot"]),
}


def by_hand(name: str, data: dict[str, Any], options: dict[str, Any]) -> FloatArray:
    """The values, as `least_squares` finds them."""
    derivative, states = HAND[name]
    case = CASES[name]
    first = dict(
        zip(states, eomgen.load(eomgen.generate(case.source)).initial_state(), strict=True)
    )
    t, measured = data["t"], list(case.noise)
    pushes = next((data[i] for i in case.inputs), np.zeros(len(t)))
    start = {**options["parameters"], **{s: data[s][0] for s in states if s in case.truth}}
    weights = {n: np.isfinite(data[n]) / case.noise[n] for n in measured}

    def residuals(values: FloatArray) -> FloatArray:
        p = dict(zip(case.truth, values, strict=True))
        y = [p.get(s, first[s]) for s in states]
        run = solve_ivp(
            lambda t, y: derivative(t, y, p, np.interp(t, data["t"], pushes)),
            (t[0], t[-1]),
            y,
            method="DOP853",
            t_eval=t,
            rtol=RTOL,
            atol=RTOL * 1e-2,
        )
        rows = (np.nan_to_num(run.y[states.index(n)] - data[n]) * weights[n] for n in measured)
        return np.concatenate([*rows])

    first_values = [start[n] for n in case.truth]
    # Differences over less than this drown in the errors of the motion.
    found = least_squares(residuals, first_values, x_scale="jac", diff_step=1e-4)
    return np.asarray(found.x)


def ours(name: str, data: dict[str, Any], options: dict[str, Any]) -> eomgen.Fit:
    """The fit here, with the same noise."""
    case = CASES[name]
    return eomgen.fit(case.source, data, case.names, noise=case.noise, rtol=RTOL, **options)


def timed(function: Callable[[], Any]) -> tuple[float, Any]:
    """Seconds of the processor, those of compilers too, and the result."""
    begun, children = time.process_time(), os.times()
    found = function()
    after = os.times()
    spent = after.children_user - children.children_user
    return time.process_time() - begun + spent, found


def main() -> None:
    """Print a line for each experiment."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=10)
    given = parser.parse_args()
    ratios = []
    for name in HAND:
        case = CASES[name]
        data, options = case.draw(1)
        with tempfile.TemporaryDirectory() as folder:
            kept = os.environ.get("EOMGEN_CACHE")
            os.environ["EOMGEN_CACHE"] = folder
            first, _ = timed(partial(ours, name, data[0], options))
            times = []
            for seed in range(given.count):
                data, options = case.draw(seed)
                a, fit = timed(partial(ours, name, data[0], options))
                b, values = timed(partial(by_hand, name, data[0], options))
                times.append((a, b))
            if kept is None:
                del os.environ["EOMGEN_CACHE"]
            else:
                os.environ["EOMGEN_CACHE"] = kept
        deviations = np.sqrt(np.diag(fit.covariance))
        off = float(np.max(np.abs(np.array([*fit.values.values()]) - values) / deviations))
        here, there = median(a for a, _ in times), median(b for _, b in times)
        ratios.append(here / there)
        print(
            f"{name:10} here {1e3 * here:7.1f} ms  by hand {1e3 * there:8.1f} ms  "
            f"ratio {here / there:.3f}  first {first:.2f} s  {off:.1e} deviations apart"
        )
    print(f"largest ratio {max(ratios):.3f}")


if __name__ == "__main__":
    main()
