"""Compiled C against NumPy: the derivative of one state, and of 1000 states as columns.

    pytest tests/benchmarks/bench_native.py

Each pair stands in a group of its own; its ratio is the figure to quote.
"""

from typing import Any

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

import eomgen
from eomgen.study.verification.states import random_state

SCENES = ("two_body", "chain", "human_figure")
WAYS = ("c", "numpy")


@pytest.mark.parametrize("count", [1, 1000])
@pytest.mark.parametrize("backend", WAYS)
@pytest.mark.parametrize("scene", SCENES)
def test_derivative(benchmark: BenchmarkFixture, scene: str, backend: str, count: int) -> None:
    """One call, and one call of 1000 columns."""
    module: Any = eomgen.load(eomgen.generate(scene, backend=backend))
    rng = np.random.default_rng(1)
    y = np.array([random_state(module, rng) for _ in range(count)]).T.copy()
    benchmark.group = f"{scene}, {count}"
    result = benchmark(module.derivative, 0.0, y[:, 0].copy() if count == 1 else y)
    assert np.isfinite(result).all()
