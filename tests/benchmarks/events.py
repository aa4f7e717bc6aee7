"""Runs by DOP853 whose steps are checked for contacts, stops and pulses, in C and in Python.

    python tests/benchmarks/events.py

prints the number of steps, the share of them made in C, and processor times, least of five: with
compiled steps; with steps in Python that call compiled functions; the ratio of both, median of five
by turns, with quartiles; and all in Python.
"""

import time
from typing import Any

import numpy as np

from eomgen.api.generating import compiled
from eomgen.api.given import check, read
from eomgen.api.options import RunOptions
from eomgen.api.planning import plan_run
from eomgen.native.accelerator import Accelerator
from eomgen.run.integrate import integrate
from eomgen.run.integrators.strides import Strides
from eomgen.run.problem import Problem
from eomgen.run.trajectory import Trajectory
from eomgen.study.diagnosis import problem_of

CASES = [
    ("ragdoll", 1e-7, 2.5),
    ("walker_motors", 1e-6, 4.0),
    ("chain_in_wind", 1e-8, 8.0),
    ("steering_particles", 1e-8, 7.0),
    ("stiff_beam", 1e-6, 0.5),
    ("bouncing_two_body", 1e-9, 5.0),
]
REPEATS = 5


def timed(problem: Problem, rtol: float, t_end: float) -> tuple[float, Trajectory]:
    """The processor time of a run, s, and the run."""
    begun = time.process_time()
    run = integrate(problem, "DOP853", t_end, rtol=rtol, samples=2)
    return time.process_time() - begun, run


def measure(scene: str, rtol: float, t_end: float) -> str:
    """A line of the table."""
    model = plan_run(read(scene), check(scene), RunOptions(scene)).model
    module = compiled(model)[1]
    python = problem_of(module, None, None, model)
    accelerator = Accelerator(model, module, None, None)
    accelerator.compile()
    ours, made, count = accelerator.of(python), Strides._compiled, 0

    def counted(self: Strides, *given: Any) -> Any:
        nonlocal count
        stride = made(self, *given)
        count += len(stride.ends) if stride else 0
        return stride

    times = []
    for again in range(REPEATS + 1):
        count, Strides._compiled = 0, counted  # type: ignore[assignment,method-assign]
        inside, run = timed(ours, rtol, t_end)
        Strides._compiled = lambda *_: None  # type: ignore[assignment,method-assign]
        beside, other = timed(ours, rtol, t_end)
        Strides._compiled = made  # type: ignore[method-assign]
        assert run.y.tobytes() == other.y.tobytes()
        if again:  # the first compiles functions
            times.append((inside, beside))
    low, middle, high = np.percentile([b / a for a, b in times], [25, 50, 75])
    best, steps = np.min(times, axis=0), run.counts["steps"]
    return (
        f"{scene:20} {steps:6} steps, {count / steps:4.0%} in C, {best[0]:.4f} s in C, "
        f"{best[1]:.4f} s with functions in C, {middle:.1f} ({low:.1f} to {high:.1f}), "
        f"{timed(python, rtol, t_end)[0]:.2f} s in Python"
    )


if __name__ == "__main__":
    for case in CASES:
        print(measure(*case), flush=True)
