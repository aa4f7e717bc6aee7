"""Simulation of a scene: `simulate`, which calls `plan_run` and `run_plan`."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from eomgen.api.controllers import with_controllers
from eomgen.api.generating import compiled
from eomgen.api.given import model_of, overridden, read
from eomgen.api.inputs import applied
from eomgen.api.options import RunOptions
from eomgen.api.planning import Plan, plan_run
from eomgen.api.public import public
from eomgen.api.reporter import SILENT, Reporter, logger
from eomgen.api.runs import Run
from eomgen.api.states import initial_with, origin_from, split
from eomgen.base.options import taking
from eomgen.model.elaborate import expanded
from eomgen.model.model import Model
from eomgen.results.module import Module
from eomgen.run.inputs import ModuleWithInputs, with_corners
from eomgen.run.module import GeneratedModule, as_powers
from eomgen.run.problem import Problem
from eomgen.scene.appearance import appearance_of
from eomgen.study.diagnosis import problem_of
from eomgen.study.observed import setup_of
from eomgen.study.recording import recorded, unknown_forces
from eomgen.study.whole import whole_of

if TYPE_CHECKING:
    from eomgen.native.accelerator import Accelerator
    from eomgen.run.guard import Guard
    from eomgen.run.resume import Start
    from eomgen.run.tally import Follow
    from eomgen.run.trajectory import Trajectory
    from eomgen.run.works import Powers
    from eomgen.study.accuracy.search import Choice
    from eomgen.study.accuracy.trial import Case, Tried

Given = tuple[Mapping[str, float] | None, Mapping[str, float] | None]
"""Values of parameters and constant inputs."""
WATCHED = 6
"""Runs of a module with fewer correct digits of accelerations have a guard."""


@public
@taking(RunOptions)
def simulate(options: RunOptions) -> Run:
    """Simulate a scene from its initial state.

    A run that cannot continue is returned with its rows so far: `finished` is false, and `outcome`
    says why and what to change. Warnings also go to the logger "eomgen", notes as level INFO.
    Raises `SceneError`, or `RunError` for an invalid argument.
    """
    run = run_plan(plan_of(options), follow=options.follow)
    for warning in run.warnings:
        logger().warning("%s: %s", run.model.name, warning)
    return run


def plan_of(options: RunOptions, reporter: Reporter = SILENT) -> Plan:
    """The plan of a run. Raises `SceneError` or `RunError`."""
    source = options.source
    scene, functions = with_controllers(read(source), options.controllers, reporter)
    scene, constants, varying = applied(scene, options.inputs, reporter)
    model = overridden(model_of(scene, source), form=options.form, route=options.route)
    given: dict[str, Any] = {"constants": constants, "varying": varying, "functions": functions}
    return plan_run(scene, model, options, **given, reporter=reporter)


def run_plan(plan: Plan, *, follow: "Follow | None" = None, reporter: Reporter = SILENT) -> Run:
    """Run a plan. Where the coordinates or velocities that were taken as independent have a dead
    point, the run is made again with others; one that continues an earlier one has its coordinates.

    Raises `RunError` if the run cannot start.
    """
    states = _earlier(plan)[0].states if plan.options.resume is not None else None
    known = states is None or not plan.model.constraints
    if not known and states != compiled(plan.model, reporter=reporter)[1].STATES:
        plan = replace(plan, model=_other(plan.model))
    run = _run(plan, follow, reporter)
    if not run.outcome.dead:
        return run
    model = _other(plan.model)
    module, functions = compiled(model, reporter=reporter)
    if module.source == run.module.source or states not in (None, functions.STATES):
        return run
    again = _run(replace(plan, model=model), follow, reporter)
    if not again.finished and again.t[-1] <= run.t[-1]:
        return run
    notice = (
        f"after t = {run.t[-1]:.6g} s what was taken as independent does not determine the other "
        "coordinates; the run was made again with all of them as states"
    )
    reporter.note(notice)
    return replace(again, warnings=(*again.warnings, notice))


def _other(model: Model) -> Model:
    """The model with coordinates and a route that have no dead points."""
    # Imported here, since it takes long and few runs need it.
    from eomgen.codegen.choice import without_dead_points

    return without_dead_points(model)


@dataclass(frozen=True, eq=False)
class _Ready:
    """What a plan runs.

    model        with the initial state of the plan
    functions    of its module, at `values` of parameters and constant inputs
    accelerator  its compiled steps and functions, if it may have some
    start        where it continues an earlier run
    said         what was noted of it
    """

    model: Model
    functions: GeneratedModule
    values: Given
    case: "Case"
    accelerator: "Accelerator | None"
    start: "Start | None"
    said: tuple[str, ...]


def _ready(plan: Plan, module: Module, functions: GeneratedModule, reporter: Reporter) -> _Ready:
    """What a plan runs, with the coordinates of its model."""
    # Imported here: plans are checked without SciPy.
    from eomgen.native.accelerator import without_compiler
    from eomgen.study.accuracy.trial import Case

    if plan.varying:
        functions = cast(GeneratedModule, ModuleWithInputs(functions, plan.varying))
    values = (plan.parameters or None, plan.inputs or None)
    options: dict[str, Any] = {
        "samples": plan.options.samples,
        "max_step": plan.options.max_step,
        "rest_speed": plan.scene.simulation.rest_speed,
        "guard": _guard(plan, module, functions, values),
        "unstable": plan.options.unstable,
    }
    said: list[str] = []
    hearing = _also(said.append, reporter)
    problem, model = _problem(plan, plan.model, functions, values, hearing)
    accelerator = _accelerator(plan, functions, values, reporter)
    made = accelerator.of if accelerator else without_compiler(model, functions, values)
    problem, moved = made(problem), None
    if plan.setting is None or plan.options.estimate:
        from eomgen.study.accuracy.moved import moved_problem

        moved = moved_problem(functions, model, *values, start=problem.initial, compiled=made)
    start = _start(plan, problem)
    if start is not None:
        problem = start.problem
        options |= start.options
    if plan.setting is None:
        from eomgen.study.accuracy.localised import under_scrutiny

        problem = under_scrutiny(problem, model, functions, *values)
    case = Case(problem, plan.t_end, functions.UNITS, options, reporter.progress, moved)
    return _Ready(model, functions, values, case, accelerator, start, tuple(said))


def _run(plan: Plan, follow: "Follow | None", reporter: Reporter) -> Run:
    """Run a plan with the coordinates of its model."""
    from eomgen.show.observe import observe

    module, functions = compiled(plan.model, asked=plan.outputs, reporter=reporter)
    ready = _ready(plan, module, functions, reporter)
    model, functions, accelerator = ready.model, ready.functions, ready.accelerator
    powers = as_powers(functions, *ready.values) if plan.works else None
    if powers and accelerator:
        powers = accelerator.powers(powers)
    trial, choice = _run_case(plan, ready.case, powers, follow, reporter)
    trajectory, estimate = trial.trajectory, None
    error, why = _error_of_choice(choice)
    if choice is None and plan.options.estimate and trajectory.finished:
        from eomgen.study.accuracy.estimate import by_second_run

        estimate = by_second_run(ready.case, trial)
        error = estimate.last
    varying = plan.varying(trajectory.t).T if plan.varying else None
    trajectory = replace(
        trajectory,
        saved=recorded(plan.options.save, model, functions, trajectory, ready.values),
        setup=setup_of(plan.scene, model, plan.parameters, plan.inputs, varying=varying),
    )
    notices = [_why_not_compiled(plan, accelerator), unknown_forces(trajectory)]
    for notice in filter(None, notices):
        reporter.note(notice)
    every = (*model.notices, *module.notices, *ready.said, *why, *filter(None, notices))
    model = model.with_parameters(plan.parameters)
    # What varies is not 0.
    pushing = dict.fromkeys(plan.varying.given, 1.0) if plan.varying else plan.inputs
    return Run(
        model,
        module,
        trajectory,
        motion=observe(model, functions, trajectory, appearance_of(expanded(plan.scene)), pushing),
        options=trial.setting.options,
        error=error,
        warnings=every,
        choice=choice,
        estimate=estimate,
        begun=ready.start.reported(trajectory) if ready.start else "",
        compiled=accelerator is not None and accelerator.used,
        simulation=plan.scene.simulation,
        inputs=plan.inputs,
        varying=plan.varying is not None,
    )


def _error_of_choice(choice: "Choice | None") -> tuple[float, list[str]]:
    """The estimated error of a run with a chosen method, and a warning if the aim was not met."""
    if choice is None:
        return math.nan, []
    from eomgen.study.accuracy.aimed import UNKNOWN

    if choice.met:
        return choice.error, []
    why = choice.reason or UNKNOWN
    return choice.error, [f"accuracy: not reached; the error estimate is {choice.error:.1g}: {why}"]


def _problem(
    plan: Plan,
    model: Model,
    module: GeneratedModule,
    values: Given,
    reporter: Reporter,
) -> tuple[Problem, Model]:
    """The problem of a plan, and its model with the initial state of the plan."""
    if not plan.state:
        problem = problem_of(module, *values, model, note=reporter.note_scene)
    else:
        with reporter.located():
            problem = problem_of(
                *(module, *values, model),
                lambda y: initial_with(model, y, plan.state, reporter, values[0]),
            )
        problem = replace(problem, origin=origin_from(problem.origin, problem.initial))
        whole = whole_of(module, model, 0.0, problem.initial, *values)
        q, v, x = split(model, whole)
        states = (
            replace(state, initial=value) for state, value in zip(model.extra, x, strict=True)
        )
        model = replace(model, initial_q=q, initial_v=v, extra=tuple(states))
    if plan.functions and problem.sampling:
        sampling = replace(problem.sampling, functions=plan.functions)
        problem = replace(problem, sampling=sampling, origin=None)  # a file does not hold functions
    if plan.varying:
        problem = with_corners(problem, module, values[0], plan.varying)
        problem = replace(problem, origin=None)  # a file does not hold functions
    return problem, model


def _also(hear: Callable[[str], None], reporter: Reporter) -> Reporter:
    """A reporter whose notes are also heard here."""

    def note(text: str) -> None:
        hear(text)
        reporter.note(text)

    return replace(reporter, note=note)


def _accelerator(
    plan: Plan,
    module: GeneratedModule,
    values: Given,
    reporter: Reporter,
) -> "Accelerator | None":
    """The compiled steps and functions of a plan; None if it asks for none."""
    if plan.options.backend == "numpy" or plan.varying:
        return None
    from eomgen.native.accelerator import Accelerator

    accelerator = Accelerator(plan.model, module, *values)
    if plan.options.backend == "c":
        with reporter.waiting(f"compiling {plan.model.name} …"):
            accelerator.compile()
    return accelerator


def _why_not_compiled(plan: Plan, accelerator: "Accelerator | None") -> str:
    """Why a run that is long, or was to be compiled, took nothing compiled; "" if it need not."""
    if accelerator and accelerator.notice:
        return f"the run was not compiled: {accelerator.notice}"
    if accelerator and plan.options.backend == "c" and not accelerator.used:
        return (
            "nothing was computed in C: a parameter, or a constant computed from them, is too "
            "small or too large"
        )
    return ""


def _run_case(
    plan: Plan, case: "Case", powers: "Powers | None", follow: "Follow | None", reporter: Reporter
) -> "tuple[Tried, Choice | None]":
    """The run of a plan, and the choice of its method if the plan has an aim."""
    if plan.setting is not None:
        return case.run(plan.setting, powers=powers, follow=follow), None
    from eomgen.study.accuracy.aimed import aimed, made_again

    choice = aimed(
        case,
        accuracy=plan.options.accuracy,
        budget=plan.options.budget,
        integrator=plan.options.integrator,
        say=reporter.trial,
    )
    return made_again(case, choice, powers, follow), choice


def _guard(
    plan: Plan,
    module: Module,
    functions: GeneratedModule,
    values: Given,
) -> "Guard | None":
    """The guard against rounding errors, if the plan has one, or if few digits are right."""
    few = module.digits is not None and module.digits < WATCHED and not plan.varying
    if plan.options.guard is None and not few:
        return None
    from eomgen.store import program_of
    from eomgen.study.precision.guarding import guard_of

    return guard_of(
        functions, program_of(plan.model), *values, repairs=plan.options.guard == "repair"
    )


def _start(plan: Plan, problem: Problem) -> "Start | None":
    """Where the run continues an earlier one, if the plan names one."""
    if plan.options.resume is None:
        return None
    from eomgen.run.resume import going_on

    assert plan.setting is not None
    ended, path = _earlier(plan)
    limits = {"max_step": plan.options.max_step, "rest_speed": plan.scene.simulation.rest_speed}
    return going_on(ended, path, problem, plan.setting, **limits)


def _earlier(plan: Plan) -> "tuple[Trajectory, Path]":
    """The run that a plan continues, and where it is from."""
    from eomgen.run.trajectory import load_npz

    assert plan.options.resume is not None
    if isinstance(plan.options.resume, Run):
        return plan.options.resume.trajectory, Path(f"the run of {plan.options.resume.model.name}")
    return load_npz(Path(plan.options.resume)), Path(plan.options.resume)
