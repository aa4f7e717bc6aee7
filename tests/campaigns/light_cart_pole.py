"""The scene `light_cart_pole`: its exact motion, and the published ladder of errors.

    python tests/campaigns/light_cart_pole.py

prints the whole ladder beside what was published: github.com/Noah-Parsons/light-cartpole-benchmark
at 07054c27 (MIT), proposed to the IFToMM library.
"""

from collections.abc import Callable
from functools import cache
from statistics import median
from types import ModuleType
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from eomgen.model.elaborate import elaborate
from eomgen.pipeline import generate
from eomgen.run.module import load_module
from eomgen.scene.reader import read_scene

Derivative = Callable[[float, np.ndarray], np.ndarray]

M, m, L, g = 1e-6, 1.0, 1.0, 9.81
T_END = 10.0
TIMES = np.linspace(0.0, T_END, 1001)
LEVEL = np.pi / 2
ULP = np.spacing(1.0)
"""Distance of the doubles about the first angle."""

LADDER = {  # rtol: error, evaluations where published
    "1e-4": (0.007289, 10352),
    "1e-5": (0.001468, None),
    "1e-6": (0.0001077, 15923),
    "1e-7": (3.193e-05, None),
    "1e-8": (1.451e-07, 25574),
    "1e-9": (2.519e-08, None),
    "1e-10": (2.021e-09, 43154),
    "1e-11": (1.994e-10, None),
    "1e-12": (1.222e-10, 53240),
    "1e-13": (9.119e-12, 70214),
}
"""Of DOP853 with atol = rtol / 100, as the counts of evaluations show."""
DEFAULT = {"RK45": 2.29, "DOP853": 0.086, "LSODA": 2.21, "BDF": 3.85, "Radau": 0.134}
"""Errors of SciPy's methods at their default tolerances."""
FLOOR = {"1e-12": 9.4e-10, "1e-13": 3.05e-9}
"""Errors of DOP853 where M is solved by LU."""

# The exact motion. By its energy theta'^2 = 2 g (M + m) cos / (L (M + m sin^2)), and the centre of
# mass keeps its place sideways. The integrand of t over theta ends in a root where the pole is
# level, and turns within sqrt(M / m) of the lowest point: two substitutions smooth these.

NODES, WEIGHTS = np.polynomial.legendre.leggauss(80)
NODES, WEIGHTS = (NODES + 1) / 2, WEIGHTS / 2
FIRST, SECOND = np.sqrt(np.pi / 4), np.arcsinh(np.sin(np.pi / 4) / np.sqrt(M / m))
"""Where both parts meet, at 45 degrees."""


def from_level(u: Any) -> np.ndarray:
    """Time from the pole's being level to theta = pi/2 - u ** 2, s."""
    u = np.asarray(u)[..., None]
    fall = (u * NODES) ** 2
    squared = L * (M + m * np.cos(fall) ** 2) / (2 * g * (M + m) * np.sinc(fall / np.pi))
    return (2 * u * np.sqrt(squared)) @ WEIGHTS


def from_lowest(z: Any) -> np.ndarray:
    """Time from the lowest point to sin(theta) = sqrt(M / m) sinh(z), s."""
    z = np.asarray(z)[..., None]
    sine = np.sqrt(M / m) * np.sinh(z * NODES)
    weight = z * np.cosh(z * NODES) ** 2 * M * np.sqrt(L / (2 * g * m * (M + m)))
    return (weight * (1 - sine**2) ** -0.75) @ WEIGHTS


QUARTER = float(from_level(FIRST) + from_lowest(SECOND))
"""Time from level to the lowest point, s."""
CROSSINGS = QUARTER * np.arange(1, 23, 2)
"""When it is there, s."""


def inverted(f: Callable[[Any], np.ndarray], values: np.ndarray, end: float) -> np.ndarray:
    """Where f, rising from 0 on, has these values; by halving 0 to `end`."""
    low, high = np.zeros_like(values), np.full_like(values, end)
    for _ in range(54):
        middle = (low + high) / 2
        below = f(middle) < values
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return (low + high) / 2


def exact(t: np.ndarray) -> np.ndarray:
    """x and theta at times, (2, n)."""
    half = np.floor(t / (2 * QUARTER))
    away = t - (2 * half + 1) * QUARTER
    near = np.abs(away) <= from_lowest(SECOND)
    theta = np.empty_like(t)
    theta[near] = np.arcsin(
        np.sqrt(M / m) * np.sinh(inverted(from_lowest, np.abs(away[near]), SECOND))
    )
    theta[~near] = LEVEL - inverted(from_level, QUARTER - np.abs(away[~near]), FIRST) ** 2
    theta *= np.where((away < 0) == (half % 2 == 0), 1.0, -1.0)
    return np.array([m * L * (1 - np.sin(theta)) / (M + m), theta])


TRUE = exact(TIMES)


def error(y: np.ndarray) -> float:
    """The benchmark's: root mean square over 1001 rows of x / L and theta together."""
    away = (y[:2] - TRUE) / np.array([[L], [1.0]])
    return float(np.sqrt(np.mean(np.sum(away**2, axis=0))))


@cache
def module() -> ModuleType:
    """The scene's, in closed form."""
    return load_module(generate(elaborate(read_scene("light_cart_pole"))).module, "light_cart_pole")


def by_lu(_t: float, y: np.ndarray) -> np.ndarray:
    """The derivative with M solved by LAPACK's LU."""
    _, theta, _, rate = y
    cos, sin = np.cos(theta), np.sin(theta)
    mass = np.array([[M + m, m * L * cos], [m * L * cos, m * L * L]])
    force = np.array([m * L * rate**2 * sin, -m * g * L * sin])
    return np.concatenate((y[2:], np.linalg.solve(mass, force)))


def run(
    method: str = "DOP853",
    rtol: str | None = None,
    *,
    derivative: Derivative | None = None,
    ulps: int = 0,
    **options: Any,
) -> Any:
    """SciPy's own run, at its default tolerances if `rtol` is None.

    It begins `ulps` doubles below the level: what changes with them is left to rounding.
    """
    if rtol is not None:
        options |= {"rtol": float(rtol), "atol": float(rtol) / 100}
    start = [0.0, LEVEL - ulps * ULP, 0.0, 0.0]
    return solve_ivp(
        derivative or module().derivative, (0.0, T_END), start, method, t_eval=TIMES, **options
    )


def errors(starts: int, *given: Any, **options: Any) -> tuple[list[float], list[int]]:
    """Errors and evaluations of runs from starts one double after the other."""
    runs = [run(*given, ulps=k, **options) for k in range(starts)]
    assert all(found.success for found in runs)
    return [error(found.y) for found in runs], [found.nfev for found in runs]


def _print_table(starts: int = 5) -> None:
    print(f"medians of {starts} starts, in brackets least and greatest; then what was published")
    cases: list[tuple[str, tuple[Any, ...], dict[str, Any], tuple[float, int | None]]] = [
        (f"DOP853 {rtol}", ("DOP853", rtol), {}, published) for rtol, published in LADDER.items()
    ]
    cases += [(f"{name} by default", (name,), {}, (e, None)) for name, e in DEFAULT.items()]
    cases += [
        (f"DOP853 {rtol}, M by LU", ("DOP853", rtol), {"derivative": by_lu}, (e, None))
        for rtol, e in FLOOR.items()
    ]
    for name, given, options, (e, count) in cases:
        found, calls = errors(starts, *given, **options)
        print(
            f"{name:22s} {median(found):.3e} ({min(found):.2e} to {max(found):.2e})"
            f" {median(calls):6.0f}   {e:.3e} {count or '':>6}",
            flush=True,
        )


if __name__ == "__main__":
    _print_table()
