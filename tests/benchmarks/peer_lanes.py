"""Many states at once: kernels in vector registers beside those of others, and ensembles."""

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any
from unittest.mock import patch

import numpy as np
from paired import COLUMNS, compared, paired, row, spread

import eomgen
from eomgen.model.model import Model
from eomgen.native.lanes import Lanes, columns_of, sources
from eomgen.program.kernel import kernel
from eomgen.run.integrators.fixed_step import Grid
from eomgen.run.module import load_module
from eomgen.scalars.floats import FloatScalars
from eomgen.store import generated_code, interfaced_program_of

Case = tuple[str, Model, Callable[[], object], np.ndarray]
"""A mechanism's name, its model, Pinocchio's call, and states as columns."""
MOST_OF_JAX = 700
"""Largest number of operations for which JAX compiles a straight line in reasonable time."""


def lanes(model: Model, y: np.ndarray) -> tuple[Callable[[], object], np.ndarray, float, int]:
    """A call of our kernel for columns of states, what it finds, the time to compile, the width."""
    start = time.perf_counter()
    ours = Lanes({**sources(*interfaced_program_of(model)), "again.h": f"/* {time.time()} */"})
    seconds = time.perf_counter() - start
    module = load_module(generated_code(model).module, model.name)
    k, _, _ = ours.prepare(np.array([[*module.PARAMETERS.values()]]))
    u = np.zeros((len(module.INPUTS), 1))
    found, sound = ours.output("derivative", 0.0, y, k, u)
    assert sound.all()
    call, arrays = ours.function("derivative"), (y, k, u, found)
    arguments = (*columns_of(*arrays[:3]), found.ctypes.data)

    def compute(arrays: object = arrays) -> None:  # as Pinocchio's call, into arrays that are there
        call(COLUMNS, 0.0, *arguments)

    return compute, found, seconds, ours.lanes


def jax_columns(model: Model, y: np.ndarray) -> tuple[Callable[[], object], np.ndarray]:
    """The same program by JAX on one thread of the processor, in float64, compiled."""
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    one = kernel(interfaced_program_of(model)[0], "derivative")
    module = load_module(generated_code(model).module, model.name)
    known = one.known_values(dict(module.PARAMETERS), FloatScalars())
    states = module.STATES

    def slopes(columns: Any) -> Any:
        given = dict(zip(states, columns, strict=True))
        rates = one.moving(
            known, [given[name] for name in one.inputs], [getattr(jnp, f) for f in one.functions]
        )
        return jnp.stack([jnp.broadcast_to(jnp.asarray(rate), columns[0].shape) for rate in rates])

    with jax.default_device(jax.devices("cpu")[0]):
        made, given = jax.jit(slopes), jnp.asarray(y)
        found = np.asarray(made(given))
    return lambda: made(given).block_until_ready(), found


def jax_recursion(model: Model, y: np.ndarray) -> tuple[Callable[[], object], np.ndarray]:
    """The articulated-body algorithm of the planar chain of `paired`, written by hand with small
    matrices, one link after another, and mapped over columns by `vmap`.
    """
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    mass, half, inertia, count = 0.1, 0.1, 3.3333333333333335e-4, len(y) // 2
    first = mass * half
    body = jnp.array([[inertia + first * half, 0, first], [0, mass, 0], [first, 0, mass]])
    axis, push = jnp.array([1.0, 0.0, 0.0]), jnp.array([0.0, 0.0, 9.81])

    def slopes(state: Any) -> Any:  # motions are (angular, x, y), in axes of the link at its joint
        q, v = state[:count], state[count:]
        c, s, one, zero = jnp.cos(q), jnp.sin(q), jnp.ones(()), jnp.zeros(())
        up, bias, force, rate = [], [], [], jnp.zeros(3)
        for i in range(count):
            arm = 2 * half if i else 0.0
            rows = [[one, zero, zero], [s[i] * arm, c[i], s[i]], [c[i] * arm, -s[i], c[i]]]
            up.append(jnp.array(rows))
            rate = up[i] @ rate + axis * v[i]
            bias.append(jnp.array([zero, rate[2] * v[i], -rate[1] * v[i]]))
            h = body @ rate
            turn = [rate[1] * h[2] - rate[2] * h[1], -rate[0] * h[2], rate[0] * h[1]]
            force.append(jnp.array(turn))
        felt, load, solved = body, force[-1], []
        for i in reversed(range(count)):
            lever = felt[:, 0]
            solved.append((lever, lever[0], -load[0]))
            seen = felt - jnp.outer(lever, lever) / lever[0]
            down = load + seen @ bias[i] - lever * (load[0] / lever[0])
            if i:
                felt = body + up[i].T @ seen @ up[i]
                load = force[i - 1] + up[i].T @ down
        found, moved = [], push
        for i, (lever, weight, rest) in enumerate(reversed(solved)):
            moved = up[i] @ moved + bias[i]
            found.append((rest - lever @ moved) / weight)
            moved = moved + axis * found[-1]
        return jnp.concatenate([v, jnp.stack(found)])

    with jax.default_device(jax.devices("cpu")[0]):
        made = jax.jit(jax.vmap(slopes, in_axes=1, out_axes=1))
        given = jnp.asarray(y)
        found = np.asarray(made(given))
    return lambda: made(given).block_until_ready(), found


def casadi_columns(model: Model, y: np.ndarray) -> tuple[Callable[[], object], np.ndarray]:
    """The same program by CasADi's virtual machine (SX), mapped over columns."""
    import casadi as ca

    one = kernel(interfaced_program_of(model)[0], "derivative")
    module = load_module(generated_code(model).module, model.name)
    known = one.known_values(dict(module.PARAMETERS), FloatScalars())
    state = ca.SX.sym("y", len(module.STATES))
    given = {name: state[i] for i, name in enumerate(module.STATES)}
    rates = one.moving(
        known, [given[name] for name in one.inputs], [getattr(ca, f) for f in one.functions]
    )
    function = ca.Function("f", [state], [ca.vertcat(*rates)]).map(y.shape[1])
    argument = ca.DM(y)
    return lambda: function(argument), np.array(function(argument))


def table(
    cases: Sequence[tuple[str, Model, Callable[[], object], np.ndarray]], rounds: int
) -> None:
    """Print times a state: ours, of Pinocchio by the call that a case has, and of the others."""
    names = ("mechanism", "lanes, µs", "Pinocchio, µs", "ratio")
    peers = {
        "JAX, program": jax_columns,
        "JAX, recursion": jax_recursion,
        "CasADi": casadi_columns,
    }
    row(*names, *(word for peer in peers for word in (f"{peer}, µs", "ratio")), "compile, s")
    row(*["---"] * (5 + 2 * len(peers)))
    for name, model, pinocchio, y in cases:
        ours, found, seconds, width = lanes(model, y)
        calls: dict[str, Callable[[], object]] = {"ours": ours, "Pinocchio": pinocchio}
        module = load_module(generated_code(model).module, model.name)
        for peer, make in peers.items():
            if "JAX" in peer and module.COST["derivative"]["total"] > MOST_OF_JAX:
                continue
            try:
                calls[peer], theirs = make(model, y)
            except ImportError:
                continue
            assert np.abs(theirs - found).max() < 1e-9 * np.abs(found).max()
        times = dict(zip(calls, paired(rounds, *calls.values(), warm=True).T, strict=True))
        words = [f"{np.min(times['ours']) / COLUMNS * 1e6:.3g}"]
        for peer in ("Pinocchio", *peers):
            if peer in times:
                words.append(f"{np.min(times[peer]) / COLUMNS * 1e6:.3g}")
                words.append(compared(times["ours"], times[peer]))
            else:
                words += ["", ""]
        row(f"{name}, {width} lanes", *words, f"{seconds:.2g}")


def ensembles(models: Sequence[tuple[str, Model]], cores: int, rounds: int) -> None:
    """Print derivatives a second of ensembles by the classical Runge-Kutta method."""
    row("ensemble", "one core, 1/s", f"{cores} cores, 1/s", "ratio")
    row(*["---"] * 4)
    count, steps = 4096, 250
    for name, model in models:
        ours = Lanes(sources(*interfaced_program_of(model)))
        module = load_module(generated_code(model).module, model.name)
        k, start, _ = ours.prepare(np.array([[*module.PARAMETERS.values()]]))
        rng = np.random.default_rng(2)
        u = np.zeros((len(module.INPUTS), 1))
        parts = [
            start + 1e-3 * rng.uniform(-1.0, 1.0, (len(start), count // (4 * cores)))
            for _ in range(4 * cores)
        ]

        def part(y: np.ndarray, k: Any = k, u: Any = u, ours: Any = ours) -> None:
            _, sound = ours.rk4(y, k, u, Grid(0.0, steps * 1e-3, 1e-3, steps))
            assert sound.all()

        with ThreadPoolExecutor(cores) as pool:
            times = paired(
                rounds,
                lambda part=part, parts=parts: [part(y) for y in parts],
                lambda part=part, parts=parts, pool=pool: list(pool.map(part, parts)),
            )
        made = 4 * steps * sum(y.shape[1] for y in parts)
        one, all_of = (made / np.median(column) for column in times.T)
        row(name, f"{one:.3g}", f"{all_of:.3g}", spread(times[:, 0] / times[:, 1]))


def adaptive_ensembles(cores: int, rounds: int) -> None:
    """Print times of ensembles of double pendulums of 5 s by DOP853, a relative tolerance of 1e-9:
    members in lanes, and one by one in compiled steps. Both by `eomgen.ensemble`, checks included.
    """
    count = 4096
    rng = np.random.default_rng(2)
    vary = {name: rng.uniform(-1.0, 1.0, count) for name in ("theta_1", "theta_2")}
    names = "in lanes, s", "one by one, s"
    row("processes or threads", *names, "one by one / lanes")
    row(*["---"] * 4)
    for workers in sorted({1, cores}):

        def lanes(workers: int = workers) -> Any:
            return eomgen.ensemble(
                "double_pendulum",
                vary,
                t_end=5.0,
                integrator="DOP853",
                rtol=1e-9,
                backend="c",
                workers=workers,
            )

        def alone(lanes: Callable[[], Any] = lanes) -> Any:
            with patch("eomgen.api.sweeping._run_together", return_value=False):
                return lanes()

        apart = np.abs(lanes().final - alone().final).max(axis=1)
        assert np.median(apart) < 1e-8  # some are chaotic: their errors grow
        times = paired(rounds, lanes, alone)
        least = (f"{seconds:.3g}" for seconds in times.min(axis=0))
        row(str(workers), *least, compared(times[:, 0], times[:, 1]))


if __name__ == "__main__":
    adaptive_ensembles(os.cpu_count() or 1, 7)
