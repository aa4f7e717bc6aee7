"""Whole runs by DOP853 over 10 s, of equal steps by rk4 and gauss_6, and by the stiff methods:
steps in compiled C against steps in Python, to the same bits.

    pytest tests/benchmarks/bench_runs.py

A run keeps two rows. Each pair stands in a group of its own; its ratio is the figure to quote.
"""

from functools import cache
from typing import Any

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from scipy.integrate import DOP853 as ScipyDOP853

import eomgen
from eomgen.api.given import check, read
from eomgen.native.accelerator import Accelerator
from eomgen.run.integrate import integrate
from eomgen.run.module import as_problem
from eomgen.run.problem import Problem

SCENES = ("two_body", "double_pendulum", "chain", "human_figure")
STIFF = {
    "stiff_beam": "stiff_beam",
    "stiff elbow": """
name = "stiff_elbow"
dimensions = 2
[[chains]]
name = "link"
count = 2
mass = 1.0
inertia_com = 0.1
r_parent = [0, 0.5]
r_child = [0, -0.5]
[[effects]]
type = "gravity"
g = 9.81
[[effects]]
type = "joint_spring"
name = "elbow"
joint = "link_joint_2"
stiffness = 1e6
damping = 1e4
[initial]
q = [1.0, 0.01]
""",
}
"""A chain with up to 1000 Hz, and a double pendulum with a stiff, damped joint spring."""
ERROR = 1e-6
"""The greatest error of any state at the end that stiff runs may have, rad or rad/s."""
LENGTHS = {"stiff_beam": 1.0, "stiff elbow": 10.0}


def prepared(scene: str, backend: str) -> Problem:
    """The problem of a scene, with compiled steps for the backend "c"."""
    scene = STIFF.get(scene, scene)
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


@pytest.mark.parametrize("backend", ["c", "numpy"])
@pytest.mark.parametrize("method", ["implicit_midpoint", "gauss_6", "leapfrog"])
@pytest.mark.parametrize("scene", ["pendulum", "double_pendulum", "chain"])
def test_implicit_equal_steps(
    benchmark: BenchmarkFixture, scene: str, method: str, backend: str
) -> None:
    if method == "leapfrog" and scene != "pendulum":
        pytest.skip("its forces depend on velocities")
    problem = prepared(scene, backend)
    benchmark.group = f"{scene}, {method}"
    options: dict[str, Any] = {"dt": 1e-3, "samples": 2}
    run = benchmark.pedantic(integrate, (problem, method, 0.5), options, rounds=3, warmup_rounds=1)
    assert run.finished


@cache
def tolerance(scene: str, method: str) -> float:
    """The loosest of three tolerances a decade with which a method is accurate enough."""
    problem, length = prepared(scene, "c"), LENGTHS[scene]
    true = integrate(problem, "Rodas5P", length, rtol=1e-11, atol=1e-13, samples=2).y[-1]
    for i in range(9, 40):
        rtol = 10 ** (-i / 3)
        run = integrate(problem, method, length, rtol=rtol, atol=rtol / 10, samples=2)
        if run.finished and np.abs(run.y[-1] - true).max() < ERROR:
            return rtol
    raise AssertionError(f"{method} is not accurate enough")


@pytest.mark.parametrize(
    ("method", "backend"),
    [
        ("Rodas5P", "c"),
        ("Rodas5P", "numpy"),
        *[(method, "c") for method in ("Radau", "BDF", "LSODA", "DOP853")],
    ],
)
@pytest.mark.parametrize("scene", STIFF)
def test_stiff(benchmark: BenchmarkFixture, scene: str, method: str, backend: str) -> None:
    """At equal true error. SciPy's methods call compiled functions."""
    rtol, problem = tolerance(scene, method), prepared(scene, backend)
    benchmark.group = f"{scene}, error below {ERROR:g}"
    benchmark.extra_info["rtol"] = rtol
    options = {"rtol": rtol, "atol": rtol / 10, "samples": 2}
    given = (problem, method, LENGTHS[scene])
    run = benchmark.pedantic(integrate, given, options, rounds=3, warmup_rounds=1)
    assert run.finished


@pytest.mark.benchmark(group="DOP853 in Python")
@pytest.mark.parametrize("solver", ["eomgen", "SciPy"])
@pytest.mark.parametrize("name", ["double_pendulum", "two_body"])
def test_dop853_in_python(benchmark: BenchmarkFixture, name: str, solver: str) -> None:
    """The loop of DOP853 over the NumPy module: ours, and SciPy's."""
    module = eomgen.load(eomgen.generate(name))
    problem, start = as_problem(module), module.initial_state()
    how = {"rtol": 1e-9, "atol": 1e-12}

    def ours() -> None:
        integrate(problem, "DOP853", 10.0, samples=2, **how)

    def scipys() -> None:
        steps = ScipyDOP853(module.derivative, 0.0, start, 10.0, **how)
        while steps.status == "running":
            steps.step()

    benchmark(ours if solver == "eomgen" else scipys)
