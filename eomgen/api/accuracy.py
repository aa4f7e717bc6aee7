"""Work-precision measurements and rounding errors: `accuracy`, `arithmetic`."""

import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from eomgen import store
from eomgen.api.generating import compiled
from eomgen.api.given import (
    Source,
    Values,
    check_states,
    check_time,
    model_of,
    named,
    overridden,
    read,
    values_of,
)
from eomgen.api.inputs import Inputs, in_formulas
from eomgen.api.public import public
from eomgen.api.reporter import SILENT, Reporter
from eomgen.base.errors import RunError
from eomgen.model.elaborate import in_order
from eomgen.model.model import Model
from eomgen.run.module import GeneratedModule, as_powers
from eomgen.scene.schema import SHOWN, Form, Route, Simulation
from eomgen.study.diagnosis import problem_of

if TYPE_CHECKING:
    from eomgen.run.problem import FloatArray
    from eomgen.study.accuracy.ladder import Ladder, Rung, Work
    from eomgen.study.accuracy.reference import Reference
    from eomgen.study.accuracy.work_precision import Bench
    from eomgen.study.cost.arithmetic import Arithmetic

MOST_STATES = 100_000
RUN_TIME, ALL_TIME = 3.0, 300.0
"""Longest time of one run, and time after which no run is started, s."""

Notice = Callable[[int, float, "Rung"], None]
"""Called before each run: number of runs so far, the time they took, s, and the next run."""


@dataclass(frozen=True, eq=False)
class Accuracy:
    """Time and error of runs of one motion by several methods.

    works       the runs, by method and from coarse to fine: setting, error, time, counts
    reference   the solution that errors are measured against, with its own error
    costs       time of one derivative and of one Jacobian, s
    generation  time to generate the module, s
    t_end       end time, s
    made        number of runs made now; the others are from the table
    left_out    methods whose finer runs were not made, for lack of time
    """

    works: "tuple[Work, ...]"
    reference: "Reference"
    costs: tuple[float, float]
    generation: float
    t_end: float
    made: int
    left_out: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Measurement:
    """A result with the bench that measured it, and the methods."""

    found: Accuracy
    bench: "Bench"
    methods: Sequence[str]


@dataclass(frozen=True)
class MeasurementPlan:
    """Checked arguments of `accuracy`, which describes them."""

    model: Model
    simulation: Simulation
    methods: Sequence[str]
    parameters: Mapping[str, float]
    inputs: Mapping[str, float]
    t_end: float
    quick: bool
    run_time: float
    time: float


@public
def accuracy(
    source: Source,
    *,
    methods: Sequence[str] | None = None,
    quick: bool = False,
    t_end: float | None = None,
    run_time: float = RUN_TIME,
    time: float = ALL_TIME,
    parameters: Values | None = None,
    inputs: Inputs | None = None,
    form: Form | None = None,
    route: Route | None = None,
    table: str | PathLike[str] | None = None,
    fresh: bool = False,
) -> Accuracy:
    """Measure time and error of runs of a scene, by each method at each tolerance or step.

    methods     names of integrators; None: all
    quick       only every second tolerance or step
    t_end       end time, s; None: the scene's own
    run_time    longest time of one run, s
    time        time after which no run is started, s
    parameters  values that replace those of the scene, by name
    inputs      by name constant values, or formulas of t, the motion and parameters; or the path
                of a table, as for `simulate`. Others have their defaults
    form        state form; None: the scene's own
    route       to the equations; None: the scene's own
    table       a CSV file to which runs are written and, unless `fresh`, from which earlier runs
                are taken

    Raises `SceneError`, or `RunError` for an invalid argument, or if the error of the reference is
    too large to compare methods.
    """
    scene, constants = in_formulas(read(source), inputs)
    plan = plan_measurement(
        overridden(model_of(scene, source), form=form, route=route),
        scene.simulation,
        methods=None if methods is None else ",".join(methods),
        quick=quick,
        t_end=t_end,
        run_time=run_time,
        time=time,
        parameters=parameters,
        inputs=constants,
    )
    return measure(plan, table=None if table is None else Path(table), fresh=fresh).found


def plan_measurement(
    model: Model,
    simulation: Simulation,
    *,
    methods: str | None = None,
    quick: bool = False,
    t_end: float | None = None,
    run_time: float = RUN_TIME,
    time: float = ALL_TIME,
    parameters: Values | None = None,
    inputs: Values | None = None,
    reporter: Reporter = SILENT,
) -> MeasurementPlan:
    """Check the arguments of `accuracy`. Raises `RunError` for an invalid one."""
    from eomgen.study.accuracy.ladder import methods_named

    for name, value in (("run_time", run_time), ("time", time)):
        check_time(value, reporter.argument(name))
    _check_moves(model)
    chosen = methods_named(methods)
    parameters, inputs = values_of(model, parameters, inputs, reporter)
    end = simulation.t_end if t_end is None else t_end
    check_time(end, reporter.argument("t_end"))
    model = replace(model, outputs=in_order((*SHOWN, "effect_powers")))
    return MeasurementPlan(
        model, simulation, chosen, parameters, inputs, end, quick, run_time, time
    )


def measure(
    plan: MeasurementPlan,
    *,
    table: Path | None = None,
    fresh: bool = False,
    force: bool = False,
    name: str = "",
    notice: Notice = lambda count, spent, rung: None,
    reporter: Reporter = SILENT,
) -> Measurement:
    """Measure as planned; `name` is the name of the scene in messages."""
    from eomgen import pipeline  # imported now, so that its import does not count as generation
    from eomgen.study.accuracy import records
    from eomgen.study.accuracy.reference import reference
    from eomgen.study.accuracy.work_precision import call_times, left_out

    model, t_end = plan.model, plan.t_end
    name = name or model.name
    values = (plan.parameters or None, plan.inputs or None)
    begin = clock.perf_counter()
    module, functions = compiled(model, reporter=reporter)
    generation = clock.perf_counter() - begin if module.derived else None
    given = (dict(plan.parameters), dict(plan.inputs))
    key = records.key(module.source, *given, t_end, plan.simulation.rest_speed)
    done: Mapping[Rung, Work] = {}
    if table is not None and not fresh:
        done, earlier = records.load(table, key)
        generation = earlier if generation is None else generation
    if generation is None:
        with reporter.waiting(f"timing the generation of {name} …"):
            begin = clock.perf_counter()
            pipeline.generate(model)
            generation = clock.perf_counter() - begin
    with reporter.located(), reporter.progress(f"reference of {name}") as progress:
        folder = _reference_folder(reporter)
        truth = reference(
            model,
            functions,
            *values,
            t_end,
            progress=progress,
            folder=folder,
            rest_speed=plan.simulation.rest_speed,
        )
        bench = _bench(plan, functions, truth)
        _check_reference(bench)
        costs = call_times(bench.problem, truth)
    ladder = _ladder(bench, plan)
    same = _columns(bench, costs, plan)

    def keep(works: "Mapping[Rung, Work]") -> None:
        if table is not None:
            every = works.values()
            records.save(table, key, every, generation=generation, same=same, force=force)

    works = dict(done)
    made = _climb(bench, ladder, plan, works, keep, notice)
    keep(works)
    shown = records.ordered(work for work in works.values() if work.rung.method in plan.methods)
    missing = tuple(left_out(ladder, plan.methods, works))
    found = Accuracy(tuple(shown), truth, costs, generation, t_end, made, missing)
    return Measurement(found, bench, plan.methods)


def _columns(
    bench: "Bench", costs: tuple[float, float], plan: MeasurementPlan
) -> dict[str, object]:
    """The columns of the table that are the same in each row."""
    given = {**plan.parameters, **plan.inputs}
    return {
        "t_end_s": plan.t_end,
        "given": " ".join(f"{name}={value!r}" for name, value in given.items()),
        "reference_error": bench.reference.error,
        "derivative_s": costs[0],
        "jacobian_s": costs[1],
    }


def _reference_folder(reporter: Reporter) -> Path | None:
    """The folder of stored references, or None; notes why it cannot be used."""
    entries = store.entries_of("references")
    if entries and (trouble := entries.trouble()):
        reporter.note(f"the store {entries.folder} is not used: {trouble}")
        return None
    return entries.folder if entries else None


def _bench(
    plan: MeasurementPlan,
    module: GeneratedModule,
    truth: "Reference",
) -> "Bench":
    """The bench that measures runs of the plan's model against the reference."""
    from eomgen.native.accelerator import Accelerator
    from eomgen.show.balance import keeps_energy
    from eomgen.show.observe import joint_drift
    from eomgen.study.accuracy.work_precision import Bench

    parameters, inputs = plan.parameters, plan.inputs
    own = plan.model.with_parameters(parameters)
    p = own.defaults
    values = (parameters or None, inputs or None)

    def kinetic(t: "FloatArray", y: "FloatArray") -> "FloatArray":
        return np.asarray(module.kinetic_energy(t, y.T, p))

    def energy(t: "FloatArray", y: "FloatArray") -> "FloatArray":
        return np.asarray(kinetic(t, y) + module.potential_energy(t, y.T, p))

    def gap(t: "FloatArray", y: "FloatArray") -> "FloatArray":
        poses = np.moveaxis(module.body_poses(t, y.T, p), -1, 0)
        return np.asarray(np.max(joint_drift(own, poses), axis=1, initial=0.0))

    t, y = truth.t, truth.y
    potential = energy(t, y) - kinetic(t, y)
    scale = float(np.max(kinetic(t, y)) + np.ptp(potential)) or 1.0
    keeps = keeps_energy(own, inputs)
    problem = problem_of(module, *values, own)
    return Bench(
        problem=replace(
            problem, series=Accelerator(plan.model, module, *values).of(problem).series
        ),
        reference=truth,
        rest_speed=plan.simulation.rest_speed,
        kinetic=kinetic,
        energy=energy if keeps else None,
        energy_scale=scale,
        powers=None if keeps else as_powers(module, *values),
        gap=gap if own.form == "redundant" else None,
    )


def _check_reference(bench: "Bench") -> None:
    """Raise `RunError` if the error of the reference exceeds that of a wrong run."""
    from eomgen.study.accuracy.measure import WRONG

    if not bench.floors[0] < WRONG:
        raise RunError(
            f"its motion is known only to {bench.reference.error:.1g} of its scale, which is too "
            "little to compare methods (a chaotic motion, or many impacts); take a shorter --t-end"
        )


def _ladder(bench: "Bench", plan: MeasurementPlan) -> "Ladder":
    from eomgen.study.accuracy.ladder import Ladder, atol_scale, first_steps

    truth, noise = bench.reference, bench.problem.noise
    return Ladder(
        t_end=plan.t_end,
        first=first_steps(bench.problem, truth.t, truth.y, truth.scale),
        atol_scale=atol_scale(truth.y, truth.scale),
        quick=plan.quick,
        run_time=plan.run_time,
        noise=float(max(noise(plan.t_end))) if noise else 0.0,
    )


def _climb(
    bench: "Bench",
    ladder: "Ladder",
    plan: MeasurementPlan,
    works: "dict[Rung, Work]",
    keep: "Callable[[Mapping[Rung, Work]], None]",
    notice: Notice,
) -> int:
    """Make the missing runs, write each to the table at once, and return their number."""
    from eomgen.study.accuracy.work_precision import sweep

    begin, made = clock.perf_counter(), 0

    def reported(rung: "Rung") -> None:
        notice(len(works), clock.perf_counter() - begin, rung)

    for work in sweep(bench, ladder, plan.methods, works, begin + plan.time, reported):
        works[work.rung] = work
        made += 1
        keep(works)
    return made


@public
def arithmetic(
    source: Source,
    *,
    states: int | None = None,
    seed: int = 0,
    single: bool = False,
    parameters: Values | None = None,
) -> "Arithmetic":
    """Measure the error of v̇ by each route against 60 digits, in units in the last place.

    states      number of states of each kind; None: as many as are quick
    seed        of the random states
    single      also in float32
    parameters  values that replace those of the scene, by name

    Raises `SceneError`, or `RunError` for an invalid argument.
    """
    scene = read(source)
    model = model_of(scene, source)
    check_arithmetic(states, seed)
    model = model.with_parameters(named(parameters, model.defaults, "parameters", "parameter"))
    return arithmetic_of(model, scene.simulation, states=states, seed=seed, single=single)


def _check_moves(model: Model) -> None:
    """Raise `RunError` for a model without velocities, whose motion is given by the time."""
    if not model.velocities:
        raise RunError(
            f"{model.name}: all coordinates are driven, so that no method makes an error; leave "
            "one free"
        )


def check_arithmetic(states: int | None, seed: int, reporter: Reporter = SILENT) -> None:
    """Raise `RunError` for an invalid argument of `arithmetic`."""
    check_states(states, seed, MOST_STATES, reporter)


def arithmetic_of(
    model: Model,
    simulation: Simulation,
    *,
    states: int | None = None,
    seed: int = 0,
    single: bool = False,
    name: str = "",
    reporter: Reporter = SILENT,
) -> "Arithmetic":
    """The result of `arithmetic` for a model; `name` is the name of the scene in it."""
    _check_moves(model)
    from eomgen.study.cost.arithmetic import arithmetic as measured

    name = name or model.name
    with reporter.located(), reporter.progress(f"arithmetic of {name}") as progress:
        found = measured(
            model, simulation, states=states, seed=seed, single=single, progress=progress
        )
    return replace(found, name=name)
