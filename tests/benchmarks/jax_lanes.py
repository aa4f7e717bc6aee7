"""Modules of the backend jax on the device that JAX has: compilation, derivatives, and many runs.

    python tests/benchmarks/jax_lanes.py
    python tests/benchmarks/jax_lanes.py --scenes two_body human_figure --lanes 1000 100000 1000000
    python tests/benchmarks/jax_lanes.py --kernels --lanes 1000 100000

Runs by the classical Runge-Kutta method: states a second, where a step of a run is one state, four
derivatives. JAX runs them in float64 and float32, C in lanes on one core of the processor
(`eomgen.native.lanes`), where there is a compiler. With `--mjx` the last column is MJX in float32,
for the chain, with the same rods; on a processor its compilation takes minutes.

With `--kernels`: seconds to trace and compile the derivative and its gradient, and times a state.
"""

import argparse
import time
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import eomgen
from eomgen.api.given import check, read
from eomgen.base.errors import RunError
from eomgen.run.integrators.fixed_step import Grid
from eomgen.store import interfaced_program_of

DT = 1e-3
ROUNDS = 3
MOST_IN_C = 4096
"""Runs in C, whose time is proportional to their number."""


def least(call: Callable[[], Any]) -> tuple[float, float]:
    """The time of the first call, with compilation, and the least of further calls, s."""
    times = []
    for _ in range(1 + ROUNDS):
        start = time.perf_counter()
        jax.block_until_ready(call())
        times.append(time.perf_counter() - start)
    return times[0], min(times[1:])


def rollout(module: Any, steps: int) -> Callable[[Any], Any]:
    """Columns of states after some steps from given ones."""

    def step(y: Any, _: None) -> tuple[Any, None]:
        h = jnp.asarray(DT, y.dtype)
        k1 = module.derivative(0.0, y)
        k2 = module.derivative(0.0, y + h / 2 * k1)
        k3 = module.derivative(0.0, y + h / 2 * k2)
        k4 = module.derivative(0.0, y + h * k3)
        return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), None

    return jax.jit(lambda y: jax.lax.scan(step, y, None, steps)[0])


def in_c(scene: str, y: np.ndarray, steps: int) -> tuple[float, np.ndarray] | None:
    """Seconds of our lanes on one core, and the states at the end; None without a compiler."""
    from eomgen.native.lanes import Lanes, sources

    try:
        ours = Lanes(sources(*interfaced_program_of(check(read(scene)))))
    except RunError:
        return None
    module = eomgen.load(eomgen.generate(scene))
    k, _, _ = ours.prepare(np.array([[*module.PARAMETERS.values()]]))
    u = np.array([[*module.INPUTS.values()]]).reshape(-1, 1)
    rows = []

    def call() -> None:
        rows[:] = [ours.rk4(y, k, u, Grid(0.0, steps * DT, DT, steps))[0][-1]]

    return least(call)[1], rows[0]


def by_mjx(lanes: int, steps: int) -> float | None:
    """Seconds of MJX for the chain of ten rods; None if it cannot be imported."""
    try:
        import mujoco
        from mujoco import mjx
    except ImportError:
        return None
    rod = (
        '<body pos="{} 0 0"><joint type="hinge" axis="0 0 1"/><inertial pos="0.1 0 0" mass="0.1" '
        'diaginertia="3.3333e-4 3.3333e-4 3.3333e-4"/>'
    )
    rods = "".join(rod.format(0.2 if i else 0) for i in range(10))
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option gravity="0 -9.81 0" integrator="RK4" timestep="{DT}"/>'
        f"<worldbody>{rods}{'</body>' * 10}</worldbody></mujoco>"
    )
    there = mjx.put_model(model)
    angles = jnp.asarray(np.random.default_rng(1).uniform(-1.0, 1.0, (lanes, 10)), jnp.float32)

    @jax.jit
    def run(angles: Any) -> Any:
        data = jax.vmap(lambda q: mjx.make_data(model).replace(qpos=q))(angles)
        step = jax.vmap(lambda data: mjx.step(there, data))
        return jax.lax.scan(lambda data, _: (step(data), None), data, None, steps)[0].qpos

    return least(lambda: run(angles))[1]


def row(*cells: object) -> None:
    print("| " + " | ".join(map(str, cells)) + " |", flush=True)


def states(module: Any, lanes: int) -> np.ndarray:
    """Columns of states near the initial one."""
    start = np.asarray(module.initial_state(), float)[:, None]
    y = start + 1e-2 * np.random.default_rng(1).uniform(-1.0, 1.0, (len(start), lanes))
    for parts in map(list, module.QUATERNIONS):
        y[parts] /= np.linalg.norm(y[parts], axis=0)
    return y


def runs(scene: str, lanes: int, steps: int, mjx: bool) -> None:
    """Print a row of the table of runs."""
    module = eomgen.load(eomgen.generate(scene, backend="jax"))
    y = states(module, lanes)
    compiled = in_c(scene, y[:, :MOST_IN_C], steps)
    cells = []
    for kind in ("float64", "float32"):
        run, given = rollout(module, steps), jnp.asarray(y, kind)
        first, seconds = least(lambda run=run, given=given: run(given))
        cells += [f"{lanes * steps / seconds:.3g}", f"{first - seconds:.2g}"]
        if compiled and kind == "float64":
            found, wanted = np.asarray(run(given))[:, :MOST_IN_C], compiled[1]
            assert np.abs(found - wanted).max() < 1e-10 * np.abs(wanted).max(), scene
    cells.append(f"{min(lanes, MOST_IN_C) * steps / compiled[0]:.3g}" if compiled else "")
    if mjx:
        jax.config.update("jax_enable_x64", False)
        seconds = by_mjx(lanes, steps) if scene == "chain" else None
        jax.config.update("jax_enable_x64", True)
        cells.append(f"{lanes * steps / seconds:.3g}" if seconds else "")
    row(scene, f"{lanes:,}", *cells)


def kernels(scene: str, lanes: list[int]) -> None:
    """Print a row for each function of a scene: of one state, and of columns."""
    module = eomgen.load(eomgen.generate(scene, backend="jax"))

    def derivative(y: Any) -> Any:
        return module.derivative(0.0, y)

    def squares(y: Any) -> Any:
        return jnp.sum(derivative(y) ** 2)

    functions = {
        "derivative": (derivative, (True, False)),
        "derivative by vmap": (jax.vmap(derivative, in_axes=1, out_axes=1), (False,)),
        "gradient": (jax.grad(squares), (True, False)),
        "Jacobian": (jax.jacfwd(derivative), (True,)),
    }
    for name, (function, taken) in functions.items():
        cells = []
        for count in [1, *lanes]:
            if (alone := count == 1) not in taken:
                cells += ["", ""]
                continue
            y = jnp.asarray(states(module, count)[:, 0] if alone else states(module, count))
            made = jax.jit(function)
            first, seconds = least(lambda made=made, y=y: made(y))
            cells += [f"{first - seconds:.2g}", f"{seconds / count * 1e6:.3g}"]
        row(scene, name, *cells)


def main() -> None:
    parser = argparse.ArgumentParser(description="Modules of the backend jax")
    parser.add_argument("--scenes", nargs="+", default=["two_body", "chain", "human_figure"])
    parser.add_argument("--lanes", nargs="+", type=int, default=[1000, 10_000])
    parser.add_argument("--steps", type=int, default=10)
    parser.add_argument("--kernels", action="store_true")
    parser.add_argument("--mjx", action="store_true")
    given = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    print(f"{jax.devices()[0].device_kind}, JAX {jax.__version__}\n")
    if given.kernels:
        row("scene", "function", *(f"{n:,}: {w}" for n in (1, *given.lanes) for w in ("s", "µs")))
        row(*["---"] * (4 + 2 * len(given.lanes)))
        for scene in given.scenes:
            kernels(scene, given.lanes)
        return
    names = ["float64", "compile, s", "float32", "compile, s", "C, one core"]
    names += ["MJX, float32"] * given.mjx
    row("scene", "runs", *names)
    row(*["---"] * (2 + len(names)))
    for scene in given.scenes:
        for lanes in given.lanes:
            runs(scene, lanes, given.steps, given.mjx)


if __name__ == "__main__":
    main()
