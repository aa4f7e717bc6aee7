"""The forward error of the accelerations from each route, against a solution in 60 digits.

It compares every route that the model admits and `numpy.linalg.solve(M, F - V - G)` with the
module's own terms, at seeded random states and at states of the scene's run: operations, time,
and forward error of v̇ in units in the last place (see `ulps`). Inputs are 0, and rigid contacts
exert no force.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from eomgen.base.displays import Displayed
from eomgen.base.errors import RunError
from eomgen.dynamics.start.singularity import check_nonsingular
from eomgen.model.model import Model
from eomgen.pipeline import compile_program
from eomgen.run.problem import FloatArray
from eomgen.run.progress import Progress
from eomgen.scalars.extended import DIGITS
from eomgen.scene.schema import Simulation
from eomgen.study.cost.single import in_single, kernel_in_single
from eomgen.study.timing import least_seconds
from eomgen.study.verification.routes import Made, compiled, loaded, velocities
from eomgen.study.verification.samples import Sample, agreement, condition_numbers, judging_states
from eomgen.study.verification.states import number_of_states
from eomgen.study.verification.truth import Exact, Truth
from eomgen.study.verification.ulps import BITS, component_errors, vector_errors
from eomgen.tables.routes import ROUTES

BASELINE = "linalg.solve"
TERMS = ("mass_matrix", "bias_force", "applied_force")
STATES, FEW_STATES = 100, 20
"""Default number of states of each kind; the smaller one for large models."""
AGREED = 40
"""Digits to which the two solutions in 60 digits must agree."""
BATCH = 1000
"""Number of states in one call when timing arrays of states."""


@dataclass(frozen=True, eq=False)
class Errors:
    """The errors of one route at the states of a sample, in ulps of its own precision.

    ulps        (n,) of v̇ as a whole, nan where the result is not finite
    components  of all components of v̇ together, each in its own ulps
    """

    ulps: FloatArray
    components: FloatArray

    @property
    def failed(self) -> int:
        """Number of states without a finite result."""
        return int(np.sum(np.isnan(self.ulps)))

    @property
    def median(self) -> float:
        """The median over the states with a result; nan if there is none."""
        return float(np.nanmedian(self.ulps)) if self.failed < len(self.ulps) else np.nan

    @property
    def worst(self) -> float:
        """The greatest over the states with a result; nan if there is none."""
        return float(np.nanmax(self.ulps)) if self.failed < len(self.ulps) else np.nan

    @property
    def at(self) -> int | None:
        """The index of the state with the greatest error; None if there is no result."""
        return int(np.nanargmax(self.ulps)) if self.failed < len(self.ulps) else None

    @property
    def component(self) -> float:
        """The median over the components; nan if there is none."""
        return float(np.median(self.components)) if self.components.size else np.nan


@dataclass(frozen=True)
class Solver:
    """A solver of M v̇ + h = F: a route of the program, or `BASELINE`.

    operations     of a call; None if the model does not admit it: `words` say why
    seconds        of a call for one state
    batch_seconds  for one of `BATCH` states that are computed at once
    errors         for each sample
    words          why it is not admitted, or what went wrong
    """

    name: str
    precision: str
    operations: int | None
    seconds: float | None
    batch_seconds: float | None
    errors: tuple[Errors, ...]
    words: str = ""


@dataclass(frozen=True, repr=False)
class Arithmetic(Displayed):
    """The results. `taken` is the route of the model; `agreed` is the least number of digits to
    which the two solutions in 60 digits agree.
    """

    shown = ("taken", "agreed", "samples", "solvers")

    name: str
    taken: str
    states: tuple[str, ...]
    samples: tuple[Sample, ...]
    solvers: tuple[Solver, ...]
    agreed: float


def arithmetic(
    model: Model,
    wanted: Simulation,
    *,
    states: int | None = None,
    seed: int = 0,
    single: bool = False,
    progress: Progress = lambda fraction: None,
) -> Arithmetic:
    """Compare all solvers at `states` seeded states and as many states of the scene's run,
    which is made as `wanted`. With `single`, compare them in float32, too, at the same states
    rounded to float32.

    A model in momentum form is replaced by its velocity form, and loops are closed by projection: v̇
    of all joints is compared.

    Raises `SceneError` or `RunError` if no route gives an acceleration at the initial state, or if
    60 digits are not enough for a reference.
    """
    model = replace(model, form="velocity", outputs=(), loops_kept="projected")
    check_nonsingular(model)
    taken = compile_program(model, jacobian=False).system
    others, missing = compiled(model, but=taken.route)
    there = {taken.route: loaded(taken), **others}
    solvers = {route: there[route] for route in ROUTES if route in there}
    terms = loaded(
        compile_program(replace(model, route="aba", outputs=TERMS), jacobian=False).system
    )
    progress(0.2)
    truth = Truth(model)
    count = number_of_states(model, states, STATES, FEW_STATES)
    samples, truths = judging_states(
        truth,
        wanted,
        solvers[taken.route].module,
        count,
        seed,
        lambda part: progress(0.2 + 0.4 * part),
    )
    agreed = _agreed(truth, samples, truths)
    samples = [replace(s, condition=condition_numbers(terms.module, s)) for s in samples]
    found = [
        Solver(route, "float64", None, None, None, (), words) for route, words in missing.items()
    ]
    every = {**solvers, BASELINE: terms}
    progress(0.7)
    pairs = list(zip(samples, truths, strict=True))
    found += [_judged(name, made, "float64", pairs) for name, made in every.items()]
    if single:
        progress(0.8)
        found += _in_single(every, truth, samples)
    progress(0.9)
    return Arithmetic(
        model.name,
        taken.route,
        solvers[taken.route].module.STATES,
        tuple(samples),
        tuple(_timed(found, every, samples[0].y)),
        agreed,
    )


def _in_single(every: Mapping[str, Made], truth: Truth, samples: Sequence[Sample]) -> list[Solver]:
    """The solvers in float32, at the samples rounded to float32."""
    rounded = [replace(s, t=_rounded(s.t), y=_rounded(s.y)) for s in samples]
    pairs = [(s, truth(s.t, s.y)) for s in rounded]
    return [_judged(name, made, "float32", pairs) for name, made in every.items()]


def _agreed(truth: Truth, samples: Sequence[Sample], truths: Sequence[Exact]) -> float:
    """The least number of digits to which two solutions agree. Raises `RunError` if too few."""
    agreed = min(agreement(truth, *pair) for pair in zip(samples, truths, strict=True))
    if agreed < AGREED:
        raise RunError(
            f"the mass matrix is so close to singular that two solutions in {DIGITS} digits agree "
            f"to {agreed:.0f} only, too few to judge by; make masses and lengths less uneven"
        )
    return agreed


def solve_operations(n: int) -> int:
    """Operations of a dense solve with one right-hand side by Gaussian elimination with partial
    pivoting, as in LAPACK's gesv: products, sums and divisions, but no comparisons. About ⅔ n³.
    """
    factor = n * (n - 1) // 2 + n * (n - 1) * (2 * n - 1) // 3
    return factor + 2 * n * (n - 1) + n


def _rounded(values: FloatArray) -> FloatArray:
    return values.astype(np.float32).astype(np.float64)


def _judged(name: str, made: Made, precision: str, pairs: Sequence[tuple[Sample, Exact]]) -> Solver:
    """A solver with its errors, without times."""
    model, bits = made.system.model, BITS[precision]
    units = [c.unit for c in model.velocities]
    compute = _doubles if precision == "float64" else _singles
    errors, whys = [], []
    for sample, true in pairs:
        found, why = compute(name, made, sample)
        known = np.array([x is not None for x in true[0]])
        found, true = found[:, known], true[:, known]
        whys += why
        errors.append(
            Errors(vector_errors(found, true, units, bits), component_errors(found, true, bits))
        )
    failed, words = sum(e.failed for e in errors), ""
    if failed:
        of, why_not = sum(len(e.ulps) for e in errors), next(iter(whys), "not finite")
        words = f"no number at {failed} of {of} states: {why_not}"
    return Solver(name, precision, _operations(name, made), None, None, tuple(errors), words)


def _operations(name: str, made: Made) -> int:
    cost, n = made.module.COST, len(made.system.model.velocities)
    if name != BASELINE:
        return cost["derivative"]["total"]
    return sum(cost[term]["total"] for term in TERMS) + n + solve_operations(n)


def _doubles(name: str, made: Made, sample: Sample) -> tuple[FloatArray, list[str]]:
    """v̇ (nv, n) from the generated code, nan where it fails, and the reasons."""
    at, module = velocities(made), made.module
    found = np.full((at.stop - at.start, len(sample.y)), np.nan)
    whys = []
    for k, (t, y) in enumerate(zip(sample.t, sample.y, strict=True)):
        try:
            if name == BASELINE:
                found[:, k] = _solved(module, t, y)
            else:
                found[:, k] = module.derivative(t, y)[at]
        except (ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
            whys.append(str(error))
    return found, whys


def _solved(module: Any, t: float, y: FloatArray) -> Any:
    """v̇ from M v̇ = F - V - G by `numpy.linalg.solve`, for one state or for columns of states."""
    matrix = module.mass_matrix(t, y)
    right = module.applied_force(t, y) - module.bias_force(t, y)
    return _dense(matrix, right)


def _dense(matrix: Any, right: Any) -> Any:
    if right.ndim == 1:
        return np.linalg.solve(matrix, right)
    return np.linalg.solve(np.moveaxis(matrix, -1, 0), right.T[..., None])[..., 0].T


def _singles(name: str, made: Made, sample: Sample) -> tuple[Any, list[str]]:
    """The same in float32, rounding each operation of the generated code."""
    if name != BASELINE:
        return in_single(made.system, "derivative", sample.t, sample.y)[velocities(made)], []
    matrix, bias, applied = (in_single(made.system, term, sample.t, sample.y) for term in TERMS)
    right, whys = applied - bias, []
    found = np.full(right.shape, np.nan, dtype=np.float32)
    for k in range(len(sample.y)):
        try:
            found[:, k] = np.linalg.solve(matrix[..., k], right[:, k])
        except np.linalg.LinAlgError as error:
            whys.append(str(error))
    return found, whys


def _timed(found: Sequence[Solver], made: Mapping[str, Made], states: FloatArray) -> list[Solver]:
    """The same with the least times of calls, which take turns."""
    many = np.resize(states, (BATCH, states.shape[1])).T.copy()
    timed, calls, slots = list(found), [], []
    with np.errstate(all="ignore"):
        for i, solver in enumerate(found):
            if solver.operations is None:
                continue
            call = _call(solver, made[solver.name])
            start = made[solver.name].module.initial_state()
            for key, y in (("seconds", start), ("batch_seconds", many)):
                given = y if solver.precision == "float64" else y.astype(np.float32)
                with suppress(ArithmeticError, ValueError, np.linalg.LinAlgError):
                    call(given)
                    calls.append(partial(call, given))
                    slots.append((i, key))
        for (i, key), least in zip(slots, least_seconds(calls), strict=True):
            part = least / BATCH if key == "batch_seconds" else least
            timed[i] = replace(timed[i], **{key: part})  # type: ignore[arg-type]
    return timed


def _call(solver: Solver, made: Made) -> Callable[[Any], Any]:
    """A function that computes v̇ of one state, or of columns of states, at t = 0."""
    module = made.module
    if solver.precision == "float64":
        if solver.name == BASELINE:
            return lambda y: _solved(module, 0.0, y)
        return lambda y: module.derivative(0.0, y)
    if solver.name != BASELINE:
        return kernel_in_single(module, "derivative")
    matrix, bias, applied = (kernel_in_single(module, term) for term in TERMS)
    n = len(made.system.model.velocities)
    return lambda y: _dense(matrix(y).reshape((n, n, *y.shape[1:])), applied(y) - bias(y))
