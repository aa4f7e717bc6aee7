"""Steps of cart_pole with a policy between them: `eomgen.stepper` in C and in NumPy, and JAX.

    python tests/benchmarks/stepper.py
    python tests/benchmarks/stepper.py --columns

A linear policy pushes the cart of each of 4096 lanes within bounds, and one in a thousand begins
anew. Times are of the whole loop, by one thread, in turns; of JAX with policy, step and mask
compiled as one function, in float64. With `--columns`: the derivative of the module of backend c
for 4096 columns, beside the NumPy module's.
"""

import argparse
import os

os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import eomgen

LANES, DT, STEPS = 4096, 0.01, 8
GAINS = np.array([[4.0, -60.0, 7.0, -12.0]])
UPRIGHT = np.array([[0.0], [np.pi], [0.0], [0.0]])
MOST = 20.0
"""Greatest push, N."""
Loop = Callable[[np.ndarray], np.ndarray]
"""Takes the first states and returns the last."""


def turns(rounds: int, calls: dict[str, Callable[[], object]]) -> dict[str, np.ndarray]:
    """Times of calls by turns, s."""
    for call in calls.values():
        call()
    times = {name: np.empty(rounds) for name in calls}
    for i in range(rounds):
        for name, call in calls.items():
            start = time.perf_counter()
            call()
            times[name][i] = time.perf_counter() - start
    return times


def report(times: dict[str, np.ndarray], count: int, unit: str) -> None:
    """A line for each call, with its ratio to the first and the quartiles of paired rounds."""
    first = next(iter(times.values()))
    for name, found in times.items():
        low, middle, high = np.quantile(found / first, (0.25, 0.5, 0.75))
        least, usual = (x / count * 1e9 for x in (found.min(), np.median(found)))
        print(
            f"{name:22} {least:8.2f} ns a {unit} at least, {usual:.2f} in the middle "
            f"({1e9 / least:.3g} a second); {middle:.3g} times ({low:.3g} to {high:.3g})"
        )


def loop(step: eomgen.Stepper, masks: np.ndarray) -> Loop:
    """The loop as a user writes it."""

    def run(y: np.ndarray) -> np.ndarray:
        y = y.copy()
        offset = GAINS @ UPRIGHT
        for mask in masks:
            u = GAINS @ y
            u -= offset
            np.clip(u, -MOST, MOST, out=u)
            step(y, u, reset=mask, out=y)
        return y

    return run


def by_jax(masks: np.ndarray) -> Loop:
    """The same step in one compiled function, called for each step."""
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    module: Any = eomgen.load(eomgen.generate("cart_pole", backend="jax"))
    first = jnp.asarray(module.initial_state())[:, None]

    @jax.jit
    def step(y: Any, mask: Any) -> Any:
        u = jnp.clip(GAINS @ (y - UPRIGHT), -MOST, MOST)
        k1 = module.derivative(0.0, y, None, u)
        k2 = module.derivative(0.0, y + DT / 2 * k1, None, u)
        k3 = module.derivative(0.0, y + DT / 2 * k2, None, u)
        k4 = module.derivative(0.0, y + DT * k3, None, u)
        return jnp.where(mask, first, y + DT / 6 * (k1 + 2 * k2 + 2 * k3 + k4))

    given = [jnp.asarray(mask) for mask in masks]

    def run(y: np.ndarray) -> np.ndarray:
        y = jnp.asarray(y)
        for mask in given:
            y = step(y, mask)
        return np.asarray(y)

    return run


def steps(rounds: int) -> None:
    """The loop in three ways, and what a call takes beside its steps."""
    rng = np.random.default_rng(0)
    masks = rng.random((STEPS, LANES)) < 1e-3
    y = UPRIGHT + rng.uniform(-0.2, 0.2, (4, LANES))
    loops = {
        "stepper in C": loop(eomgen.stepper("cart_pole", dt=DT, lanes=LANES), masks),
        "JAX on a CPU": by_jax(masks),
        "stepper in NumPy": loop(
            eomgen.stepper("cart_pole", dt=DT, lanes=LANES, backend="numpy"), masks
        ),
    }
    found = [run(y) for run in loops.values()]
    assert np.array_equal(found[0], found[2]) and np.allclose(found[0], found[1], rtol=1e-9)
    times = turns(rounds, {name: lambda run=run: run(y) for name, run in loops.items()})
    report(times, STEPS * LANES, "step and lane")
    one = eomgen.stepper("cart_pole", dt=DT, lanes=1)
    state, push, into = one.initial(), np.zeros((1, 1)), one.initial()

    def calls() -> None:
        for _ in range(200):
            one(state, push, out=into)

    overhead = turns(rounds, {"a call for one lane": calls})["a call for one lane"] / 200 * 1e6
    print(f"a call for one lane    {overhead.min():.1f} µs at least, {np.median(overhead):.1f}")


def columns(rounds: int) -> None:
    """The derivative of the module of backend c, and of NumPy's."""
    y = np.random.default_rng(0).uniform(-3.0, 3.0, (4, LANES))
    modules: dict[str, Any] = {
        name: eomgen.load(eomgen.generate("cart_pole", backend=name)) for name in ("c", "numpy")
    }
    found = [module.derivative(0.0, y) for module in modules.values()]
    assert np.allclose(found[0], found[1], rtol=1e-14)
    calls = {f"module of {name}": lambda m=m: m.derivative(0.0, y) for name, m in modules.items()}
    report(turns(10 * rounds, calls), LANES, "state")


def main() -> int:
    """Print what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--columns", action="store_true")
    parser.add_argument("--rounds", type=int, default=100)
    asked = parser.parse_args()
    (columns if asked.columns else steps)(asked.rounds)
    return 0


if __name__ == "__main__":
    sys.exit(main())
