"""Whole runs by DOP853 over 10 s, and of equal steps by rk4: steps in compiled C against
steps in Python, to the same bits.

    pytest tests/benchmarks/bench_runs.py

A run keeps two rows. Each pair stands in a group of its own; its ratio is the figure to quote.
"""

from typing import Any

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

import eomgen
from eomgen.api.given import check, read
from eomgen.native.accelerator import Accelerator
from eomgen.run.integrate import integrate
from eomgen.run.module import as_problem
from eomgen.run.problem import Problem

SCENES = ("two_body", "double_pendulum", "chain", "human_figure")


def prepared(scene: str, backend: str) -> Problem:
    """The problem of a scene, with compiled steps for the backend "c"."""
    module: Any = eomgen.load(eomgen.generate(scene))
    problem = as_problem(module)
    if backend == "numpy":
        return problem
    accelerator = Accelerator(check(read(scene)), module, None, None)
    accelerator.compile()
    return accelerator.of(problem)


@pytest.mark.parametrize("backend", ["c", "numpy"])
@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("scene", SCENES)
def test_run(benchmark: BenchmarkFixture, scene: str, rtol: float, backend: str) -> None:
    problem = prepared(scene, backend)
    benchmark.group = f"{scene}, rtol {rtol:g}"
    rounds = {"rounds": 20 if backend == "c" else 1 if scene == "human_figure" else 5}
    run = benchmark.pedantic(
        integrate, (problem, "DOP853", 10.0), {"rtol": rtol, "samples": 2}, **rounds
    )
    assert run.finished


@pytest.mark.parametrize("backend", ["c", "numpy"])
@pytest.mark.parametrize("unstable", [False, True])
@pytest.mark.parametrize("scene", SCENES)
def test_equal_steps(benchmark: BenchmarkFixture, scene: str, unstable: bool, backend: str) -> None:
    """Many steps, with the checks of stability and without."""
    problem = prepared(scene, backend)
    dt = 1e-3 if scene in ("chain", "human_figure") else 1e-4
    steps = 1_000 if scene == "human_figure" else 10_000
    benchmark.group = f"{scene}, rk4{', unchecked' * unstable}"
    options: dict[str, Any] = {"dt": dt, "samples": 2, "unstable": unstable}
    rounds = 20 if backend == "c" and unstable else 3
    run = benchmark.pedantic(integrate, (problem, "rk4", steps * dt), options, rounds=rounds)
    assert run.finished and run.counts["steps"] == steps
