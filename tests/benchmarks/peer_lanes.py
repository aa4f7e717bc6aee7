"""Many states at once: kernels in vector registers beside those of others, and ensembles."""

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from paired import COLUMNS, paired, row, spread

from eomgen.model.model import Model
from eomgen.native.lanes import Lanes, columns_of, sources
from eomgen.program.kernel import kernel
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
    call, arrays = ours.function("derivative"), (y, k, u, found, np.empty(COLUMNS, np.int8))
    arguments = (*columns_of(*arrays[:3]), *(array.ctypes.data for array in arrays[3:]))

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
    names = ("mechanism", "lanes, µs", "Pinocchio, µs", "ratio", "JAX, µs", "ratio", "CasADi, µs")
    row(*names, "ratio", "compile, s")
    row(*["---"] * 9)
    for name, model, pinocchio, y in cases:
        ours, found, seconds, width = lanes(model, y)
        calls: dict[str, Callable[[], object]] = {"ours": ours, "Pinocchio": pinocchio}
        module = load_module(generated_code(model).module, model.name)
        for peer, make in (("JAX", jax_columns), ("CasADi", casadi_columns)):
            if peer == "JAX" and module.COST["derivative"]["total"] > MOST_OF_JAX:
                continue
            try:
                calls[peer], theirs = make(model, y)
            except ImportError:
                continue
            assert np.abs(theirs - found).max() < 1e-9 * np.abs(found).max()
        times = dict(zip(calls, paired(rounds, *calls.values()).T, strict=True))
        words = [f"{np.median(times['ours']) / COLUMNS * 1e6:.3g}"]
        for peer in ("Pinocchio", "JAX", "CasADi"):
            if peer in times:
                words.append(f"{np.median(times[peer]) / COLUMNS * 1e6:.3g}")
                words.append(spread(times[peer] / times["ours"]))
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
            _, sound = ours.rk4(y, k, u, t_end=steps * 1e-3, dt=1e-3, every=steps)
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
