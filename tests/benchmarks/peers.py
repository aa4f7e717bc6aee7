"""Compiled derivatives and runs beside those of others, in one process, as paired measurements.

    pip install -e '.[bench]' && python tests/benchmarks/peers.py [--rounds N] [--only TABLE ...]

A derivative: the kernel of `eomgen.native` over 2000 columns, one state after another and several
states in vector registers with the same bits, beside Pinocchio's `abaInParallel` with one thread
and C code that CasADi makes of the same algorithm; and derivatives that wait for one another.
Planar chains of 2 to 100 links are the same mechanism for all (accelerations are compared first);
for the human figure Pinocchio has its own sample humanoid, of 34 degrees of freedom where the
figure has 41.

The same for several states at once in vector registers, beside Pinocchio and beside the same
program by JAX and by CasADi; and ensembles of runs by the classical Runge-Kutta method, on one core
and on all of them.

Runs at true errors of 1e-6, 1e-9 and 1e-12: our Taylor series and DOP853 in C, beside heyoka's
Taylor series fed with the same program, and SciPy's DOP853 over the NumPy module. For each the
loosest of a ladder of tolerances whose end is that near to a reference in extended precision.
Compilation comes first and is reported separately. The same beside MuJoCo, and beside Pinocchio
and SymPy's lambdify in SciPy.

Each call for a derivative is made twice, and the second is timed: the calls before it would else
decide what is in the caches. Printed of derivatives are the least times and the ratios of these, of
runs medians; and of the ratios of paired rounds the quartiles.
"""

import argparse
import ctypes
import os
import platform
import subprocess
import time
from collections.abc import Callable
from functools import cache, partial
from importlib.metadata import version
from importlib.util import find_spec
from typing import Any

import numpy as np
import peer_casadi
import peer_engines
import peer_lanes
import pinocchio as pin
from paired import COLUMNS, chain, chain_of_pinocchio, compared, paired, row, spread
from scipy.integrate import DOP853

from eomgen.codegen.backends import c
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.native.accelerator import Accelerator
from eomgen.native.functions import restricted
from eomgen.native.library import compiled_library
from eomgen.native.module import Kernels
from eomgen.native.taylor import MAIN as MAIN_OF_TAYLOR
from eomgen.native.taylor import sources as sources_of_taylor
from eomgen.program.kernel import kernel
from eomgen.run.integrate import integrate
from eomgen.run.module import as_problem, load_module
from eomgen.scalars.floats import FloatScalars
from eomgen.scene.reader import read_scene
from eomgen.store import generated_code, interfaced_program_of, key_of
from eomgen.study.accuracy.measure import error
from eomgen.study.accuracy.reference import reference

PEERS = ("heyoka", "mujoco", "jax", "casadi")
ERRORS = (1e-6, 1e-9, 1e-12)
TIMED = """
#include "checked.c"

/* Derivatives of states, one row of y each, as they are computed for a single state. */
int each(long count, const double *y, const double *k, const double *u, double *out) {
    int all = 1;
    for (long j = 0; j < count; j++) {
        all &= checked_derivative(0.0, y + j * STATES, k, u, 0, out + j * STATES);
    }
    return all;
}

/* Derivatives of which each waits for the one before. */
void dependent(long count, double *y, const double *k, const double *u, double *out) {
    for (long j = 0; j < count; j++) {
        NAME_derivative(0.0, y, k, u, out);
        for (int i = 0; i < STATES; i++) y[i] += 1e-30 * out[i];
    }
}
"""
LADDER = [10.0**-k for k in np.arange(4, 16.1, 0.5)]


def library(model: Model, vectors: bool) -> tuple[Any, float]:
    """The library of a model's derivative, and the time to compile it."""
    program, interface = restricted(*interfaced_program_of(model), ("derivative",))
    texts = {**c.library(program, interface, vectors=vectors)}
    name = interface.name
    texts["timed.c"] = TIMED.replace("NAME", name).replace("STATES", str(len(interface.states)))
    start = time.perf_counter()
    about = f"bench {key_of(model)} {time.time()}"
    made = compiled_library(about, lambda: texts, "timed.c")
    return made, time.perf_counter() - start


def mechanisms() -> list[tuple[str, Model, Any]]:
    """Names of mechanisms, their models, and those of Pinocchio."""
    cases = [(f"chain of {n}", chain(n), chain_of_pinocchio(n)) for n in (2, 10, 30, 100)]
    figure, humanoid = elaborate(read_scene("human_figure")), pin.buildSampleModelHumanoidRandom()
    return [*cases, ("human_figure (41), sample humanoid (34)", figure, humanoid)]


def derivatives(rounds: int) -> None:
    """Print the table of derivatives."""
    names = ("one state", "columns", "one after another", "Pinocchio", "Pinocchio, CasADi, C")
    ratios = ("one state", "columns", "one state, CasADi", "columns, CasADi")
    row("mechanism", "operations", *(f"{name}, µs" for name in names), *ratios, "compile, s")
    row(*["---"] * 12)
    rng = np.random.default_rng(1)
    for name, model, peer in mechanisms():
        module = load_module(generated_code(model).module, model.name)
        y = rng.uniform(-1.0, 1.0, (len(module.STATES), COLUMNS))
        (one, seconds), (many, together) = library(model, False), library(model, True)
        vectors, rates = compiled_columns(module, many, y)
        (ours, rows), (waiting, _) = (of_rows(module, one, y, f) for f in ("each", "dependent"))
        theirs, found, given = columns_of_pinocchio(peer, y, rng)
        written, again, _ = peer_casadi.columns(peer, *given)
        times = paired(rounds, ours, vectors, waiting, theirs, *written, warm=True)
        assert np.allclose(rates, rows.T, rtol=1e-9, atol=1e-9 * np.abs(rates).max())
        assert np.abs(again - found).max() < 1e-9 * np.abs(found).max()
        if is_same(peer, y):
            worst = np.abs(rates[peer.nq :] - found).max() / np.abs(found).max()
            assert worst < 1e-6, worst
        times = np.column_stack([times[:, :4], times[:, 4:][:, best(times[:, 4:])]])
        row(
            name,
            module.COST["derivative"]["total"],
            *(f"{x:.3g}" for x in np.min(times, axis=0) / COLUMNS * 1e6),
            *(compared(times[:, i], times[:, 3 + k]) for k in (0, 1) for i in (0, 1)),
            f"{seconds:.2g}, {together:.2g}",
        )


def best(times: np.ndarray) -> int:
    """The column of the least time."""
    return int(np.argmin(np.min(times, axis=0)))


def of_rows(
    module: Any, made: Any, y: np.ndarray, name: str
) -> tuple[Callable[[], None], np.ndarray]:
    """A call of a function of `TIMED`, and where it puts the derivatives, a row for each state."""
    constants, inputs = Kernels(module, made).held(None), np.zeros(max(1, len(module.INPUTS)))
    states, call = y.T.copy(), made[name]
    out = np.empty_like(states)
    call.argtypes = [ctypes.c_long, *[ctypes.c_void_p] * 4]
    given = (states.ctypes.data, constants, inputs.ctypes.data, out.ctypes.data)

    def compute(kept: Any = (states, inputs, out)) -> None:
        assert call(COLUMNS, *given) or name != "each"

    return compute, out


def vectors(rounds: int) -> None:
    """Print the tables of many states at once."""
    rng = np.random.default_rng(1)
    cases = []
    for name, model, peer in mechanisms():
        module = load_module(generated_code(model).module, model.name)
        y = rng.uniform(-1.0, 1.0, (len(module.STATES), COLUMNS))
        cases.append((name, model, columns_of_pinocchio(peer, y, rng)[0], y))
    peer_lanes.table(cases, rounds)
    print()
    built_in = ("two_body", "double_pendulum", "tumbling_body", "human_figure")
    models = [(name, elaborate(read_scene(name))) for name in built_in]
    peer_lanes.ensembles(models, os.cpu_count() or 1, max(5, rounds // 3))
    peer_lanes.adaptive_ensembles(os.cpu_count() or 1, max(5, rounds // 3))


def is_same(peer: Any, y: np.ndarray) -> bool:
    """Whether Pinocchio's model has the states of ours, in their order."""
    return bool(peer.nq == peer.nv and 2 * peer.nv == len(y))


def compiled_columns(module: Any, made: Any, y: np.ndarray) -> tuple[Callable[[], None], Any]:
    """A call of our kernel for columns of states, and where it puts the derivatives."""
    out = np.empty_like(y)
    constants, inputs = Kernels(module, made).held(None), np.zeros(max(1, len(module.INPUTS)))
    call, pointer = made.columns_derivative, ctypes.c_void_p
    call.argtypes = (ctypes.c_long, ctypes.c_double, *[pointer] * 3, ctypes.c_int, pointer)
    given = (y.ctypes.data, constants, inputs.ctypes.data, 0)

    def compute(kept: Any = inputs) -> None:
        assert call(y.shape[1], 0.0, *given, out.ctypes.data)

    return compute, out


def columns_of_pinocchio(
    peer: Any, y: np.ndarray, rng: np.random.Generator
) -> tuple[Callable[[], None], Any, tuple[Any, Any, Any]]:
    """A call of Pinocchio for as many states, the same if it has these; its accelerations; and what
    it is given.
    """
    low, high = -np.ones(peer.nq), np.ones(peer.nq)
    q = np.array([pin.randomConfiguration(peer, low, high) for _ in range(COLUMNS)]).T
    v, tau = rng.uniform(-1.0, 1.0, (2, peer.nv, COLUMNS))
    if is_same(peer, y):
        q, v, tau = y[: peer.nq], y[peer.nq :], np.zeros_like(tau)
    q, v, tau = (np.asfortranarray(array) for array in (q, v, tau))
    pool, found = pin.ModelPool(peer, 1), np.zeros((peer.nv, COLUMNS), order="F")
    return lambda: pin.abaInParallel(1, pool, q, v, tau, found), found, (q, v, tau)


def taylor(model: Model, module: Any) -> tuple[Callable[[float], Any], float]:
    """heyoka's integrator of a program for a tolerance, and the time to make the first one, s."""
    import heyoka as hy

    one = kernel(interfaced_program_of(model)[0], "derivative")
    variables = dict(zip(module.STATES, hy.make_vars(*module.STATES), strict=True))
    known = one.known_values(dict(module.PARAMETERS), FloatScalars())
    rates = one.moving(
        known, [variables[name] for name in one.inputs], [getattr(hy, f) for f in one.functions]
    )
    system = [(variables[name], rate) for name, rate in zip(module.STATES, rates, strict=True)]

    @cache
    def made(tolerance: float) -> Any:
        return hy.taylor_adaptive(system, list(module.initial_state()), tol=tolerance)

    start = time.perf_counter()
    made(LADDER[0])
    return made, time.perf_counter() - start


class Case:
    """A motion, and its end by each method for a tolerance."""

    def __init__(self, name: str, model: Model, t_end: float) -> None:
        module = load_module(generated_code(model).module, model.name)
        self.name, self.model, self.t_end = name, model, t_end
        self.start = module.initial_state()
        self.plain = as_problem(module)
        accelerator = Accelerator(model, module, None, None)
        accelerator.compile()
        self.problem = accelerator.of(self.plain)
        texts = sources_of_taylor(*interfaced_program_of(model))
        start = time.perf_counter()
        compiled_library(f"bench {key_of(model)} {time.time()}", lambda: texts, MAIN_OF_TAYLOR)
        self.own_seconds = time.perf_counter() - start
        self.true = reference(model, module, t_end=t_end)
        self.taylor, self.seconds = taylor(model, module)

    def by_c(self, tolerance: float) -> Any:
        bounds = {"rtol": tolerance, "atol": 0.1 * tolerance}
        return integrate(self.problem, "DOP853", self.t_end, samples=2, **bounds).y[-1]

    def by_taylor(self, tolerance: float) -> Any:
        bounds = {"rtol": tolerance, "atol": 0.1 * tolerance}
        return integrate(self.problem, "taylor", self.t_end, samples=2, **bounds).y[-1]

    def by_heyoka(self, tolerance: float) -> Any:
        integrator = self.taylor(tolerance)
        integrator.time, integrator.state[:] = 0.0, self.start
        integrator.propagate_until(self.t_end)
        return integrator.state.copy()

    def by_scipy(self, tolerance: float) -> Any:
        bounds = {"rtol": max(tolerance, 2.3e-14), "atol": 0.1 * tolerance}
        solver = DOP853(self.plain.derivative, 0.0, self.start, self.t_end, **bounds)
        while solver.status == "running":
            solver.step()
        return solver.y

    def loosest(self, method: Callable[[float], Any], most: float) -> Callable[[], Any] | None:
        """The run of a method by its loosest tolerance with an error below `most`, if any."""
        for tolerance in LADDER:
            if error(method(tolerance), self.true.y[-1], self.true.scale) < most:
                return partial(method, tolerance)
        return None


def runs(rounds: int) -> None:
    """Print the table of runs."""
    names = ("taylor", "DOP853 in C", "heyoka", "NumPy, SciPy's DOP853")
    row("motion", "true error", *names, *(f"{name} / taylor" for name in names[1:]))
    row(*["---"] * 9)
    for case in (
        Case("double_pendulum, 10 s", elaborate(read_scene("double_pendulum")), 10.0),
        Case("chain of 10, 1 s", chain(10), 1.0),
        Case("chain of 10, 10 s", chain(10), 10.0),
    ):
        for most in ERRORS:
            methods = (case.by_taylor, case.by_c, case.by_heyoka, case.by_scipy)
            calls = [case.loosest(method, most) for method in methods]
            columns = iter(paired(rounds, *(call for call in calls if call), warm=True).T)
            times = [next(columns) if call else None for call in calls]
            row(
                case.name,
                f"{most:g}",
                *("not reached" if x is None else f"{1e3 * np.median(x):.3g} ms" for x in times),
                *("" if x is None or times[0] is None else spread(x / times[0]) for x in times[1:]),
            )
        own, other = case.own_seconds, case.seconds
        row(f"compilation: taylor {own:.2g} s, heyoka {other:.2g} s", *[""] * 8)


def calls(rounds: int) -> None:
    """Print the table of whole calls of `integrate` beside heyoka's, each at its loosest tolerance
    with this error: least times, and their ratios with the quartiles of paired rounds.
    """
    row("motion", "true error", "taylor", "DOP853 in C", "heyoka", "taylor / heyoka", "DOP853 / it")
    row(*["---"] * 7)
    for case in (
        Case("double_pendulum, 10 s", elaborate(read_scene("double_pendulum")), 10.0),
        Case("chain of 10, 1 s", chain(10), 1.0),
    ):
        for most in ERRORS[:2]:
            found = (case.loosest(by, most) for by in (case.by_taylor, case.by_c, case.by_heyoka))
            times = paired(rounds, *(call for call in found if call), warm=True)
            ours, other = times[:, :-1], times[:, -1]
            row(
                case.name,
                f"{most:g}",
                *(f"{1e3 * x:.3g} ms" for x in np.min(times, axis=0)),
                *(compared(other, x) for x in ours.T),
            )


def engines(rounds: int) -> None:
    """Print the table of runs beside MuJoCo, and Pinocchio and lambdify in SciPy."""
    row("motion", "true error", "peer", "its time", "peer / C, DOP853")
    row(*["---"] * 5)
    pendulum = Case("double_pendulum, 10 s", elaborate(read_scene("double_pendulum")), 10.0)
    peer_engines.engines(pendulum, 2, 1.0, 0.5, 1 / 12)
    hanging = Case("chain of 10, 1 s", chain(10), 1.0)
    peer_engines.engines(hanging, 10, 0.1, 0.1, 3.3333333333333335e-4)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    tables = {
        "derivatives": derivatives,
        "vectors": vectors,
        "runs": runs,
        "calls": calls,
        "engines": engines,
    }
    parser.add_argument("--rounds", type=int, default=30)
    parser.add_argument("--only", nargs="+", choices=tables, default=tables, metavar="TABLE")
    given = parser.parse_args()
    compiler = subprocess.run(["cc", "--version"], capture_output=True, text=True).stdout
    print(
        f"{os.cpu_count()} cores, {platform.machine()}; {compiler.splitlines()[0]}; Python "
        f"{platform.python_version()}, NumPy {np.__version__}, SciPy {version('scipy')}, "
        f"Pinocchio {pin.__version__}"
        + "".join(f", {name} {version(name)}" for name in PEERS if find_spec(name))
    )
    for name in given.only:
        print()
        tables[name](given.rounds)


if __name__ == "__main__":
    main()
