"""Radau with the generated Jacobian beside Radau with finite differences, on the stiff scenes.

    python tests/campaigns/stiff_scenes.py

prints CPU times, least of several, and evaluations, in which each column of a Jacobian by
differences counts as one.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from types import ModuleType

import numpy as np
from scipy.integrate import Radau

from eomgen.pipeline import compile_scene
from eomgen.run.module import as_problem, load_module
from eomgen.scene.reader import read_scene

STIFF = {
    "stiff_beam": 1.0,
    "quadruped": 0.5,
    "walker_motors": 0.2,
    "ragdoll": 0.5,
    "human_figure": 0.5,
    "light_cart_pole": 1.0,
}
"""Scenes, and how much of each is run, s: the beam's frequencies, rubber feet and stiff motors, the
stops and contacts of a figure that falls, and the spikes."""


@dataclass(frozen=True)
class Run:
    """What a run took, and where it came to."""

    seconds: float
    steps: int
    evaluations: int
    jacobians: int
    decompositions: int
    y: np.ndarray


@cache
def module(scene: str) -> ModuleType:
    """A scene's module."""
    return load_module(compile_scene(read_scene(scene)), f"stiff_{scene}")


def run(scene: str, rtol: float, *, exact: bool) -> Run:
    """SciPy's Radau as `integrate` steps it; with the generated Jacobian, or left without."""
    problem = as_problem(module(scene))
    count = 0

    def derivative(t: float, y: np.ndarray) -> np.ndarray:
        nonlocal count
        count += 1
        return problem.derivative(t, y)

    began = time.process_time()
    solver = Radau(
        derivative,
        0.0,
        problem.initial.copy(),
        STIFF[scene],
        rtol=rtol,
        atol=rtol / 10,
        jac=problem.jacobian if exact else None,
    )
    steps = 0
    with np.errstate(over="ignore"):  # SciPy's differences widen a step until something changes
        while solver.status == "running":
            solver.step()
            solver.y = problem.unit(solver.y)
            steps += 1
    assert solver.status == "finished"
    seconds = time.process_time() - began
    return Run(seconds, steps, count, solver.njev, solver.nlu, solver.y)


def seconds_a_call(f: Callable[[float, np.ndarray], np.ndarray], y: np.ndarray) -> float:
    """CPU time, the least of some."""
    found = []
    for _ in range(9):
        began = time.process_time()
        for _ in range(5):
            f(0.1, y)
        found.append((time.process_time() - began) / 5)
    return min(found)


def _print_table(rounds: int = 4) -> None:
    print("scene            derivative  Jacobian       by differences")
    for scene in STIFF:
        made = module(scene)
        y = made.initial_state()
        one, all_of_them = (seconds_a_call(f, y) for f in (made.derivative, made.jacobian))
        print(
            f"{scene:15s} {one * 1e6:8.1f} us {all_of_them * 1e6:8.1f} us  "
            f"{len(y) * one * 1e6:9.1f} us, {len(y) * one / all_of_them:4.1f} times"
        )
    print("scene, rtol: steps | generated: evaluations, Jacobians, s | differences | ratios")
    for scene in STIFF:
        for rtol in (1e-3, 1e-6, 1e-9):
            own, other = (run(scene, rtol, exact=exact) for exact in (True, False))
            best = [own.seconds, other.seconds]
            for k in range(0 if own.seconds > 5 else rounds):
                for i in (k % 2, 1 - k % 2):  # neither is always the first
                    best[i] = min(best[i], run(scene, rtol, exact=i == 0).seconds)
            print(
                f"{scene:15s} {rtol:.0e}: {own.steps:6d} | {own.evaluations:6d} {own.jacobians:4d} "
                f"{best[0]:7.3f} | {other.evaluations:6d} {other.jacobians:4d} {best[1]:7.3f} | "
                f"evaluations {other.evaluations / own.evaluations:5.2f}, "
                f"time {best[1] / best[0]:5.2f}",
                flush=True,
            )


if __name__ == "__main__":
    _print_table()
