"""Work-precision measurements and rounding errors: `accuracy`, `arithmetic`."""

import time as clock
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from eomgen import store
from eomgen.api.generating import compiled
from eomgen.api.given import Values, model_of, named, overridden, read, values_of
from eomgen.api.inputs import in_formulas
from eomgen.api.options import AccuracyOptions, ArithmeticOptions
from eomgen.api.public import public
from eomgen.api.reporter import SILENT, Reporter
from eomgen.base.displays import Displayed
from eomgen.base.errors import RunError
from eomgen.base.options import taking
from eomgen.model.elaborate import in_order
from eomgen.model.model import Model
from eomgen.run.module import GeneratedModule, as_powers
from eomgen.run.progress import Progress
from eomgen.scene.schema import SHOWN, Simulation
from eomgen.study.diagnosis import problem_of

if TYPE_CHECKING:
    from eomgen.run.problem import FloatArray
    from eomgen.study.accuracy.ladder import Ladder, Work
    from eomgen.study.accuracy.reference import Reference
    from eomgen.study.accuracy.trial import Setting
    from eomgen.study.accuracy.work_precision import Bench
    from eomgen.study.cost.arithmetic import Arithmetic

Notice = Callable[[int, float, "Setting"], None]
"""Called before each run: number of runs so far, the time they took, s, and the next run."""


@dataclass(frozen=True, eq=False, repr=False)
class Accuracy(Displayed):
    """Time and error of runs of one motion by several methods.

    works       the runs, by method and from coarse to fine: setting, error, time, counts
    reference   the solution that errors are measured against, with its own error
    costs       time of one derivative and of one Jacobian, s
    generation  time to generate the module, s
    t_end       end time, s
    made        number of runs made now; the others are from the table
    left_out    methods whose finer runs were not made, for lack of time
    """

    shown = ("t_end", "methods", "works", "left_out", "reference")

    works: "tuple[Work, ...]"
    reference: "Reference"
    costs: tuple[float, float]
    generation: float
    t_end: float
    made: int
    left_out: tuple[str, ...]

    @property
    def methods(self) -> dict[str, int]:
        """How many runs were made by each method."""
        return dict(Counter(work.setting.integrator for work in self.works))


@dataclass(frozen=True, eq=False)
class Measurement:
    """A result with the bench that measured it, and the methods."""

    found: Accuracy
    bench: "Bench"
    methods: Sequence[str]


@dataclass(frozen=True)
class MeasurementPlan:
    """Checked options of `accuracy`."""

    model: Model
    simulation: Simulation
    methods: Sequence[str]
    parameters: Mapping[str, float]
    inputs: Mapping[str, float]
    t_end: float
    options: AccuracyOptions


@public
@taking(AccuracyOptions)
def accuracy(options: AccuracyOptions) -> Accuracy:
    """Measure time and error of runs of a scene, by each method at each tolerance or step.

    Raises `SceneError`, or `RunError` for an invalid argument, or if the error of the reference is
    too large to compare methods.
    """
    scene, constants = in_formulas(read(options.source), options.inputs)
    model = model_of(scene, options.source)
    model = overridden(model, form=options.form, route=options.route)
    return measure(plan_measurement(model, scene.simulation, options, constants)).found


def plan_measurement(
    model: Model,
    simulation: Simulation,
    options: AccuracyOptions,
    constants: Values | None = None,
    reporter: Reporter = SILENT,
) -> MeasurementPlan:
    """Check the options of `accuracy`; `constants` are those of inputs. Raises `RunError`."""
    from eomgen.study.accuracy.ladder import methods_named

    _check_moves(model)
    chosen = methods_named(options.methods)
    parameters, inputs = values_of(model, options.parameters, constants, reporter)
    end = simulation.t_end if options.t_end is None else options.t_end
    model = replace(model, outputs=in_order((*SHOWN, "effect_powers")))
    return MeasurementPlan(model, simulation, chosen, parameters, inputs, end, options)


def measure(
    plan: MeasurementPlan,
    *,
    force: bool = False,
    name: str = "",
    notice: Notice = lambda count, spent, setting: None,
    reporter: Reporter = SILENT,
) -> Measurement:
    """Measure as planned; `name` is the name of the scene in messages."""
    from eomgen.study.accuracy import records
    from eomgen.study.accuracy.work_precision import call_times, left_out

    table = None if plan.options.table is None else Path(plan.options.table)
    model, t_end = plan.model, plan.t_end
    name = name or model.name
    begin = clock.perf_counter()
    module, functions = compiled(model, reporter=reporter)
    generation = clock.perf_counter() - begin if module.derived else None
    given = (dict(plan.parameters), dict(plan.inputs))
    place = plan.options.backend
    key = records.key(module.source, *given, t_end, plan.simulation.rest_speed, place)
    done: Mapping[Setting, Work] = {}
    if table is not None and not plan.options.fresh:
        done, earlier = records.load(table, key)
        generation = earlier if generation is None else generation
    if generation is None:
        with reporter.waiting(f"timing the generation of {name} …"):
            generation = _generation(model)
    with reporter.located(), reporter.progress(f"reference of {name}") as progress:
        truth = _reference(plan, functions, progress, reporter)
        bench = _bench(plan, functions, truth)
        _check_reference(bench)
        costs = call_times(bench.problem, truth)
    ladder = _ladder(bench, plan)
    same = _columns(bench, costs, plan)

    def keep(works: "Mapping[Setting, Work]") -> None:
        if table is not None:
            every = works.values()
            records.save(table, key, every, generation=generation, same=same, force=force)

    works = dict(done)
    made = _climb(bench, ladder, plan, works, keep, notice)
    keep(works)
    shown = records.ordered(
        work for work in works.values() if work.setting.integrator in plan.methods
    )
    missing = tuple(left_out(ladder, plan.methods, works))
    found = Accuracy(tuple(shown), truth, costs, generation, t_end, made, missing)
    return Measurement(found, bench, plan.methods)


def _generation(model: Model) -> float:
    """The time that it takes to generate a module, s."""
    from eomgen import pipeline  # imported now, so that its import does not count

    begin = clock.perf_counter()
    pipeline.generate(model)
    return clock.perf_counter() - begin


def _reference(
    plan: MeasurementPlan, module: GeneratedModule, progress: Progress, reporter: Reporter
) -> "Reference":
    """The solution that errors are measured against."""
    from eomgen.study.accuracy.reference import reference

    return reference(
        plan.model,
        module,
        plan.parameters or None,
        plan.inputs or None,
        plan.t_end,
        progress=progress,
        folder=_reference_folder(reporter),
        rest_speed=plan.simulation.rest_speed,
    )


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
    accelerator, problem = (
        Accelerator(plan.model, module, *values),
        problem_of(module, *values, own),
    )
    powers = None if keeps else as_powers(module, *values)
    compiled = plan.options.backend == "c"
    if compiled:
        accelerator.compile()
        powers = powers and accelerator.powers(powers)
    quick = accelerator.of(problem)
    return Bench(
        problem=quick if compiled else replace(problem, series=quick.series),
        reference=truth,
        rest_speed=plan.simulation.rest_speed,
        kinetic=kinetic,
        energy=energy if keeps else None,
        energy_scale=scale,
        powers=powers,
        gap=gap if own.form == "redundant" else None,
        compiled=compiled,
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
        quick=plan.options.quick,
        run_time=plan.options.run_time,
        noise=float(max(noise(plan.t_end))) if noise else 0.0,
    )


def _climb(
    bench: "Bench",
    ladder: "Ladder",
    plan: MeasurementPlan,
    works: "dict[Setting, Work]",
    keep: "Callable[[Mapping[Setting, Work]], None]",
    notice: Notice,
) -> int:
    """Make the missing runs, write each to the table at once, and return their number."""
    from eomgen.study.accuracy.work_precision import sweep

    begin, made = clock.perf_counter(), 0

    def reported(setting: "Setting") -> None:
        notice(len(works), clock.perf_counter() - begin, setting)

    for work in sweep(bench, ladder, plan.methods, works, begin + plan.options.time, reported):
        works[work.setting] = work
        made += 1
        keep(works)
    return made


@public
@taking(ArithmeticOptions)
def arithmetic(options: ArithmeticOptions) -> "Arithmetic":
    """Measure the error of v̇ by each route against 60 digits, in units in the last place.

    Raises `SceneError`, or `RunError` for an invalid argument.
    """
    scene = read(options.source)
    model = model_of(scene, options.source)
    given = named(options.parameters, model.defaults, "parameters", "parameter")
    return arithmetic_of(model.with_parameters(given), scene.simulation, options)


def _check_moves(model: Model) -> None:
    """Raise `RunError` for a model without velocities, whose motion is given by the time."""
    if not model.velocities:
        raise RunError(
            f"{model.name}: all coordinates are driven, so that no method makes an error; leave "
            "one free"
        )


def arithmetic_of(
    model: Model,
    simulation: Simulation,
    options: ArithmeticOptions,
    *,
    name: str = "",
    reporter: Reporter = SILENT,
) -> "Arithmetic":
    """The result of `arithmetic` for a model; `name` is the name of the scene in it."""
    _check_moves(model)
    from eomgen.study.cost.arithmetic import arithmetic as measured

    name = name or model.name
    wanted: dict[str, Any] = {
        "states": options.states,
        "seed": options.seed,
        "single": options.single,
    }
    with reporter.located(), reporter.progress(f"arithmetic of {name}") as progress:
        found = measured(model, simulation, **wanted, progress=progress)
    return replace(found, name=name)
