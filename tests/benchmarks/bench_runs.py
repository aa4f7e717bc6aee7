"""Whole runs by DOP853 over 10 s: steps in compiled C against steps in Python, to the same bits.

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

SCENES = ("two_body", "double_pendulum", "chain", "human_figure")


@pytest.mark.parametrize("backend", ["c", "numpy"])
@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("scene", SCENES)
def test_run(benchmark: BenchmarkFixture, scene: str, rtol: float, backend: str) -> None:
    module: Any = eomgen.load(eomgen.generate(scene))
    problem = as_problem(module)
    if backend == "c":
        accelerator = Accelerator(check(read(scene)), module, None, None)
        accelerator.compile()
        problem = accelerator.of(problem)
    benchmark.group = f"{scene}, rtol {rtol:g}"
    rounds = {"rounds": 20 if backend == "c" else 1 if scene == "human_figure" else 5}
    run = benchmark.pedantic(
        integrate, (problem, "DOP853", 10.0), {"rtol": rtol, "samples": 2}, **rounds
    )
    assert run.finished
