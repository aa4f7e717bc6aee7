"""What accuracy costs in time, and how exact the arithmetic is: `accuracy`, `arithmetic`."""

import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from eomgen.api.generating import compiled
from eomgen.api.given import Source, Values, check, check_time, named, overridden, read
from eomgen.api.reporter import SILENT, Reporter
from eomgen.entries import Entries
from eomgen.errors import RunError
from eomgen.model.elaborate import in_order
from eomgen.model.model import Model
from eomgen.run.module import GeneratedModule, as_powers
from eomgen.scene.schema import SHOWN, Form, Route, Simulation
from eomgen.store import folder
from eomgen.study.diagnosis import problem_of

if TYPE_CHECKING:
    from eomgen.run.problem import FloatArray
    from eomgen.study.accuracy.ladder import Ladder, Rung, Work
    from eomgen.study.accuracy.reference import Reference
    from eomgen.study.accuracy.work_precision import Bench
    from eomgen.study.cost.arithmetic import Arithmetic

MOST_STATES = 100_000
RUN_TIME, ALL_TIME = 3.0, 300.0
"""Longest time of one run, and time after which none is begun, s."""

Notice = Callable[[int, float, "Rung"], None]
"""Told before each run: how many there are, how long all took, s, and which is next."""


@dataclass(frozen=True, eq=False)
class Accuracy:
    """What runs of a motion cost by every method, and how exact they are.

    works       the runs, by method and from coarse to fine: setting, error, time, counts
    reference   what their errors are told by, with its own error
    costs       of one derivative and one Jacobian, s
    generation  how long it took to generate the module, s
    t_end       of the motion, s
    made        how many of the runs were made now
    left_out    methods whose finer runs there was no time for
    """

    works: "tuple[Work, ...]"
    reference: "Reference"
    costs: tuple[float, float]
    generation: float
    t_end: float
    made: int
    left_out: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Measured:
    """What was measured, by what, and by which methods."""

    found: Accuracy
    bench: "Bench"
    methods: Sequence[str]


@dataclass(frozen=True)
class Measuring:
    """What is to be measured, checked: see `accuracy`."""

    model: Model
    wanted: Simulation
    methods: Sequence[str]
    parameters: Mapping[str, float]
    inputs: Mapping[str, float]
    t_end: float
    quick: bool
    run_time: float
    time: float


def accuracy(
    source: Source,
    *,
    methods: Sequence[str] | None = None,
    quick: bool = False,
    t_end: float | None = None,
    run_time: float = RUN_TIME,
    time: float = ALL_TIME,
    parameters: Values | None = None,
    inputs: Values | None = None,
    form: Form | None = None,
    route: Route | None = None,
    table: str | PathLike[str] | None = None,
    fresh: bool = False,
) -> Accuracy:
    """What runs of a scene cost by every method at every tolerance or step, and their errors.

    methods         these integrators alone; None: all
    quick           every second tolerance or step alone
    t_end           end time, s; None: the scene's own
    run_time, time  the longest time of one run, and time after which none is begun, s
    table           a CSV file that runs are kept in and, unless `fresh`, taken from

    Raises `SceneError`, or `RunError` for an argument that cannot be served, and where the motion
    is known too little to compare methods by.
    """
    scene = read(source)
    plan = to_measure(
        overridden(check(scene), form=form, route=route),
        scene.simulation,
        methods=None if methods is None else ",".join(methods),
        quick=quick,
        t_end=t_end,
        run_time=run_time,
        time=time,
        parameters=parameters,
        inputs=inputs,
    )
    return measured(plan, table=None if table is None else Path(table), fresh=fresh).found


def to_measure(
    model: Model,
    wanted: Simulation,
    *,
    methods: str | None = None,
    quick: bool = False,
    t_end: float | None = None,
    run_time: float = RUN_TIME,
    time: float = ALL_TIME,
    parameters: Values | None = None,
    inputs: Values | None = None,
    reporter: Reporter = SILENT,
) -> Measuring:
    """What is to be measured of a model. Raises `RunError` for what cannot be served."""
    from eomgen.study.accuracy.ladder import methods_named

    for name, value in (("run_time", run_time), ("time", time)):
        check_time(value, reporter.argument(name))
    chosen = methods_named(methods)
    given = named(parameters, model.defaults, reporter.argument("parameters"), "parameter")
    pushes = named(inputs, [i.name for i in model.inputs], reporter.argument("inputs"), "input")
    end = wanted.t_end if t_end is None else t_end
    check_time(end, reporter.argument("t_end"))
    model = replace(model, outputs=in_order((*SHOWN, "effect_powers")))
    return Measuring(model, wanted, chosen, given, pushes, end, quick, run_time, time)


def measured(
    plan: Measuring,
    *,
    table: Path | None = None,
    fresh: bool = False,
    force: bool = False,
    name: str = "",
    notice: Notice = lambda count, spent, rung: None,
    reporter: Reporter = SILENT,
) -> Measured:
    """What `accuracy` returns, and by what it was measured; `name` is what the scene is called."""
    from eomgen import pipeline  # here, so that loading SymPy is not counted as deriving
    from eomgen.study.accuracy import records
    from eomgen.study.accuracy.reference import reference
    from eomgen.study.accuracy.work_precision import call_times, left_out

    model, t_end, called = plan.model, plan.t_end, name or plan.model.name
    values = (plan.parameters or None, plan.inputs or None)
    begin = clock.perf_counter()
    module, functions = compiled(model, reporter=reporter)
    generation = clock.perf_counter() - begin if module.derived else None
    key = records.key(module.source, *_named(plan), t_end, plan.wanted.rest_speed)
    done: Mapping[Rung, Work] = {}
    if table is not None and not fresh:
        done, earlier = records.load(table, key)
        generation = earlier if generation is None else generation
    if generation is None:
        with reporter.waiting(f"timing the generation of {called} …"):
            begin = clock.perf_counter()
            pipeline.generate(model)
            generation = clock.perf_counter() - begin
    with reporter.located(), reporter.progress(f"reference of {called}") as progress:
        kept = _references(reporter)
        truth = reference(
            model,
            functions,
            *values,
            t_end,
            progress=progress,
            folder=kept,
            rest_speed=plan.wanted.rest_speed,
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
    return Measured(found, bench, plan.methods)


def _named(plan: Measuring) -> tuple[dict[str, float], dict[str, float]]:
    return dict(plan.parameters), dict(plan.inputs)


def _columns(bench: "Bench", costs: tuple[float, float], plan: Measuring) -> dict[str, object]:
    """Columns of the table that are the same in every row: what its runs were measured by."""
    given = {**plan.parameters, **plan.inputs}
    return {
        "t_end_s": plan.t_end,
        "given": " ".join(f"{name}={value!r}" for name, value in given.items()),
        "reference_error": bench.reference.error,
        "derivative_s": costs[0],
        "jacobian_s": costs[1],
    }


def _references(reporter: Reporter) -> Path | None:
    """Where references are kept; what is wrong with it is said."""
    kept = folder("references")
    if kept and (trouble := Entries(kept).trouble()):
        reporter.note(f"the store {kept} is not used: {trouble}")
    return kept


def _bench(
    plan: Measuring,
    module: GeneratedModule,
    truth: "Reference",
) -> "Bench":
    """What runs of a model are measured by."""
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
    return Bench(
        problem=problem_of(module, *values, own),
        reference=truth,
        rest_speed=plan.wanted.rest_speed,
        kinetic=kinetic,
        energy=energy if keeps else None,
        energy_scale=scale,
        powers=None if keeps else as_powers(module, *values),
        gap=gap if own.form == "redundant" else None,
    )


def _check_reference(bench: "Bench") -> None:
    """Raise `RunError` where the reference does not even tell right from wrong."""
    from eomgen.study.accuracy.measure import WRONG

    if not bench.floors[0] < WRONG:
        raise RunError(
            f"its motion is known to {bench.reference.error:.1g} of its own scale only, too little "
            "to compare methods by (a chaotic motion, or many impacts); take a shorter --t-end"
        )


def _ladder(bench: "Bench", plan: Measuring) -> "Ladder":
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
    plan: Measuring,
    works: "dict[Rung, Work]",
    keep: "Callable[[Mapping[Rung, Work]], None]",
    notice: Notice,
) -> int:
    """Make the runs that are missing, each kept as soon as it is made; return how many."""
    from eomgen.study.accuracy.work_precision import sweep

    begin, made = clock.perf_counter(), 0

    def reported(rung: "Rung") -> None:
        notice(len(works), clock.perf_counter() - begin, rung)

    for work in sweep(bench, ladder, plan.methods, works, begin + plan.time, reported):
        works[work.rung] = work
        made += 1
        keep(works)
    return made


def arithmetic(
    source: Source,
    *,
    states: int | None = None,
    seed: int = 0,
    single: bool = False,
    parameters: Values | None = None,
) -> "Arithmetic":
    """How exact v̇ is by every route, in units in the last place, against 60 digits.

    states  how many of each kind; None: as many as are quick
    seed    of the random ones
    single  in float32, too

    Raises `RunError` for an argument that cannot be served.
    """
    scene = read(source)
    model = check(scene)
    check_arithmetic(states, seed)
    given = named(parameters, model.defaults, "parameters", "parameter")
    own = model.with_parameters(given)
    return arithmetic_of(own, scene.simulation, states=states, seed=seed, single=single)


def check_arithmetic(states: int | None, seed: int, reporter: Reporter = SILENT) -> None:
    """Raise `RunError` for what cannot be served."""
    if states is not None and not 1 <= states <= MOST_STATES:
        asked = reporter.argument("states")
        raise RunError(f"{asked}: {states} is not a number from 1 to {MOST_STATES}")
    if seed < 0:
        raise RunError(f"{reporter.argument('seed')}: {seed} is negative; give 0, 1, 2, …")


def arithmetic_of(
    model: Model,
    wanted: Simulation,
    *,
    states: int | None = None,
    seed: int = 0,
    single: bool = False,
    name: str = "",
    reporter: Reporter = SILENT,
) -> "Arithmetic":
    """What `arithmetic` returns of a model; `name` is what it is called there."""
    from eomgen.study.cost.arithmetic import arithmetic as judged

    called = name or model.name
    with reporter.located(), reporter.progress(f"arithmetic of {called}") as progress:
        found = judged(model, wanted, states=states, seed=seed, single=single, progress=progress)
    return replace(found, name=called)
