"""Simulation of a scene: `simulate`, which calls `plan_run` and `run_plan`."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from eomgen.api.generating import compiled
from eomgen.api.given import Source, Values, check, overridden, read, values_of
from eomgen.api.reporter import SILENT, Reporter
from eomgen.api.settings import setting_of
from eomgen.errors import RunError
from eomgen.model.elaborate import in_order
from eomgen.model.model import Model
from eomgen.results import Run
from eomgen.run.module import GeneratedModule, as_powers
from eomgen.run.problem import Problem
from eomgen.scene.appearance import appearance_of
from eomgen.scene.schema import SHOWN, Form, Route, Scene
from eomgen.study.diagnosis import problem_of

if TYPE_CHECKING:
    from eomgen.native.accelerator import Accelerator
    from eomgen.run.guard import Guard
    from eomgen.run.resume import Start
    from eomgen.run.tally import Follow
    from eomgen.run.works import Powers
    from eomgen.study.accuracy.search import Choice
    from eomgen.study.accuracy.trial import Case, Setting, Tried

GuardMode = Literal["stop", "repair"]
Backend = Literal["auto", "numpy", "c"]
EarlierRun = str | PathLike[str] | Run


@dataclass(frozen=True)
class Plan:
    """Checked arguments of a run.

    scene    its settings and appearance are used
    model    with the outputs that the run and its pictures need
    setting  method and tolerances or step; None if `accuracy` or `budget` choose them
    outputs  those that the caller named

    The other fields are arguments of `simulate`.
    """

    scene: Scene
    model: Model
    setting: "Setting | None"
    t_end: float
    parameters: Mapping[str, float]
    inputs: Mapping[str, float]
    outputs: Sequence[str] = ()
    accuracy: float | None = None
    budget: float | None = None
    integrator: str | None = None
    samples: int = 1001
    max_step: float | None = None
    works: bool = False
    guard: GuardMode | None = None
    unstable: bool = False
    estimate: bool = False
    resume: EarlierRun | None = None
    backend: Backend = "auto"


def simulate(
    source: Source,
    *,
    t_end: float | None = None,
    integrator: str | None = None,
    dt: float | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    accuracy: float | None = None,
    budget: float | None = None,
    parameters: Values | None = None,
    inputs: Values | None = None,
    form: Form | None = None,
    route: Route | None = None,
    samples: int = 1001,
    max_step: float | None = None,
    works: bool = False,
    guard: GuardMode | None = None,
    unstable: bool = False,
    estimate: bool = False,
    resume: EarlierRun | None = None,
    backend: Backend = "auto",
    follow: "Follow | None" = None,
) -> Run:
    """Simulate a scene from its initial state.

    t_end       end time, s; None: the scene's own
    integrator  name of the method; None: the scene's own
    dt          step of a fixed-step method, s; None: the scene's own
    rtol, atol  relative and absolute tolerance of an adaptive method; None: the scene's own
    accuracy    choose method and tolerances so that the error of the last state, relative to the
                scale of the motion, is below this; they are found by trial runs of this scene
    budget      choose the most accurate run that takes about this time, s
    parameters  values that replace those of the scene, by name
    inputs      constant values, by name; others are 0
    form        state form; None: the scene's own
    route       to the equations; None: the scene's own
    samples     number of rows that are kept, about
    max_step    longest step of an adaptive method, s
    works       also compute the work of each effect, J
    guard       check rounding errors at each step, and "stop" where digits are lost, or "repair"
    unstable    allow steps of an explicit fixed-step method that are too long for stability
    estimate    estimate the error by a second run
    resume      continue an earlier run: a `Run`, or its archive `.npz`
    backend     "numpy": compute all in Python; "c": compute the derivative, the Jacobian and what
                else the run evaluates in compiled C code, with the same bits, and make whole steps
                of DOP853, rk4, euler and semi_implicit_euler there; "auto": do so if a library is
                in the store, or if the run is longer than compiling takes and there is a compiler
    follow      called with time and state after each step; a true result stops the run

    A run that cannot continue is returned with its rows so far: `finished` is false, and `outcome`
    says why and what to change. Raises `SceneError`, or `RunError` for an invalid argument.
    """
    scene = read(source)
    plan = plan_run(
        scene,
        overridden(check(scene), form=form, route=route),
        t_end=t_end,
        integrator=integrator,
        dt=dt,
        rtol=rtol,
        atol=atol,
        accuracy=accuracy,
        budget=budget,
        parameters=parameters,
        inputs=inputs,
        samples=samples,
        max_step=max_step,
        works=works,
        guard=guard,
        unstable=unstable,
        estimate=estimate,
        resume=resume,
        backend=backend,
    )
    return run_plan(plan, follow=follow)


def plan_run(
    scene: Scene,
    model: Model,
    *,
    outputs: Sequence[str] = (),
    t_end: float | None = None,
    integrator: str | None = None,
    dt: float | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    accuracy: float | None = None,
    budget: float | None = None,
    parameters: Values | None = None,
    inputs: Values | None = None,
    samples: int = 1001,
    max_step: float | None = None,
    works: bool = False,
    guard: GuardMode | None = None,
    unstable: bool = False,
    estimate: bool = False,
    resume: EarlierRun | None = None,
    backend: Backend = "auto",
    reporter: Reporter = SILENT,
) -> Plan:
    """Check the arguments of `simulate`, which describes them, for a scene's model.

    `outputs` must be in the module. Raises `RunError` for an invalid argument.
    """
    bounds = {"rtol": rtol, "atol": atol, "dt": dt}
    aims = [n for n, x in (("accuracy", accuracy), ("budget", budget)) if x is not None]
    _check_aims(aims, bounds, resume, reporter)
    parameters, inputs = values_of(model, parameters, inputs, reporter)
    if guard not in (None, "stop", "repair"):
        raise RunError(f"{reporter.argument('guard')}: '{guard}' is none of stop, repair")
    if backend not in ("auto", "numpy", "c"):
        raise RunError(f"{reporter.argument('backend')}: '{backend}' is none of auto, numpy, c")
    setting = None
    if not aims:
        setting = setting_of(scene.simulation, integrator, **bounds, reporter=reporter)
    if unstable:
        _check_unstable(setting, reporter)
    needed = (*model.outputs, *SHOWN, *(("effect_powers",) if works else ()))
    return Plan(
        scene,
        replace(model, outputs=in_order(needed)),
        setting,
        scene.simulation.t_end if t_end is None else t_end,
        parameters,
        inputs,
        outputs,
        accuracy=accuracy,
        budget=budget,
        integrator=integrator,
        samples=samples,
        max_step=max_step,
        works=works,
        guard=guard,
        unstable=unstable,
        estimate=estimate,
        resume=resume,
        backend=backend,
    )


def run_plan(plan: Plan, *, follow: "Follow | None" = None, reporter: Reporter = SILENT) -> Run:
    """Run a plan. Raises `RunError` if the run cannot start."""
    # Imported here: plans are checked without SciPy.
    from eomgen.native.accelerator import without_compiler
    from eomgen.show.observe import observe
    from eomgen.study.accuracy.trial import Case

    model = plan.model
    module, functions = compiled(model, asked=plan.outputs, reporter=reporter)
    values = (plan.parameters or None, plan.inputs or None)
    options: dict[str, Any] = {
        "samples": plan.samples,
        "max_step": plan.max_step,
        "rest_speed": plan.scene.simulation.rest_speed,
        "guard": _guard(plan, functions, values),
        "unstable": plan.unstable,
    }
    problem = problem_of(functions, *values, model)
    accelerator = _accelerator(plan, functions, values, reporter)
    made = accelerator.of if accelerator else without_compiler(model, functions, values)
    problem = made(problem)
    start = _start(plan, problem)
    if start is not None:
        problem = start.problem
        options |= start.options
    moved = None
    if plan.setting is None or plan.estimate:
        from eomgen.study.accuracy.moved import moved_problem

        moved = moved_problem(functions, model, *values, compiled=made)
    case = Case(problem, plan.t_end, functions.UNITS, options, reporter.progress, moved)
    powers = as_powers(functions, *values) if plan.works else None
    warnings, error = [*model.notices, *module.notices], math.nan
    trial, choice = _run_case(plan, case, powers, follow, reporter)
    trajectory, estimate = trial.trajectory, None
    if choice is not None:
        from eomgen.study.accuracy.aimed import UNKNOWN

        error = choice.error
        if not choice.met:
            why = choice.reason or UNKNOWN
            warnings.append(f"accuracy: not reached, the estimate is {error:.1g}: {why}")
    elif plan.estimate and trajectory.finished:
        from eomgen.study.accuracy.estimate import by_second_run

        estimate = by_second_run(case, trial)
        error = estimate.last
    if told := _why_not_compiled(plan, accelerator):
        warnings.append(told)
        reporter.note(told)
    model = model.with_parameters(plan.parameters)
    return Run(
        model,
        module,
        trajectory,
        observe(model, functions, trajectory, appearance_of(plan.scene), plan.inputs),
        trial.setting.options,
        error,
        tuple(warnings),
        choice=choice,
        estimate=estimate,
        begun=start.reported(trajectory) if start else "",
        compiled=accelerator is not None and accelerator.used,
    )


def _accelerator(
    plan: Plan,
    module: GeneratedModule,
    values: tuple[Mapping[str, float] | None, ...],
    reporter: Reporter,
) -> "Accelerator | None":
    """The compiled steps and functions of a plan; None if it asks for none."""
    if plan.backend == "numpy":
        return None
    from eomgen.native.accelerator import Accelerator

    accelerator = Accelerator(plan.model, module, *values)
    if plan.backend == "c":
        with reporter.waiting(f"compiling {plan.model.name} …"):
            accelerator.compile()
    return accelerator


def _why_not_compiled(plan: Plan, accelerator: "Accelerator | None") -> str:
    """Why a run that is long, or was to be compiled, took nothing compiled; "" if it need not."""
    if accelerator and accelerator.notice:
        return f"the run was not compiled: {accelerator.notice}"
    if accelerator and plan.backend == "c" and not accelerator.used:
        return (
            "nothing was computed in C: a parameter, or a constant computed from them, is too "
            "small or too large for that"
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
        accuracy=plan.accuracy,
        budget=plan.budget,
        integrator=plan.integrator,
        say=reporter.trial,
    )
    return made_again(case, choice, powers, follow), choice


def _check_aims(
    aims: Sequence[str],
    bounds: Mapping[str, float | None],
    resume: EarlierRun | None,
    reporter: Reporter,
) -> None:
    """Raise `RunError` for two aims, or for an aim with a tolerance, a step or an earlier run."""
    if len(aims) > 1:
        both = ", ".join(map(reporter.argument, aims))
        raise RunError(f"{both}: a run has one aim; give one of them")
    for aim in map(reporter.argument, aims):
        for name, value in bounds.items():
            if value is not None:
                option = reporter.argument(name)
                raise RunError(f"{aim}, {option}: {aim} chooses {name} itself; leave one out")
    if aims and resume is not None:
        raise RunError(
            f"{reporter.argument('resume')}: continues with a given method; leave "
            f"{reporter.argument('accuracy')}, {reporter.argument('budget')} out"
        )


def _check_unstable(setting: "Setting | None", reporter: Reporter) -> None:
    """Raise `RunError` for `unstable` unless the method is explicit with a given step."""
    from eomgen.run.integrators import FixedStep, find_integrator

    asked = reporter.argument("unstable")
    if setting is None:
        raise RunError(
            f"{asked}: is for a given step; leave {reporter.argument('accuracy')}, "
            f"{reporter.argument('budget')} out"
        )
    method = find_integrator(setting.integrator)
    if not (isinstance(method, FixedStep) and method.explicit):
        raise RunError(
            f"{asked}: {setting.integrator} is stable at any step or chooses its own; leave "
            f"it out, or take {reporter.argument('integrator')} euler, leapfrog or rk4"
        )


def _guard(
    plan: Plan, module: GeneratedModule, values: tuple[Mapping[str, float] | None, ...]
) -> "Guard | None":
    """The guard against rounding errors, if the plan has one."""
    if plan.guard is None:
        return None
    from eomgen.precision.guarding import guard_of
    from eomgen.store import program_of

    return guard_of(module, program_of(plan.model), *values, repairs=plan.guard == "repair")


def _start(plan: Plan, problem: Problem) -> "Start | None":
    """Where the run continues an earlier one, if the plan names one."""
    if plan.resume is None:
        return None
    from eomgen.run.resume import going_on
    from eomgen.run.trajectory import load_npz

    assert plan.setting is not None
    if isinstance(plan.resume, Run):
        path = Path(f"the run of {plan.resume.model.name}")
        ended = plan.resume.trajectory
    else:
        path = Path(plan.resume)
        ended = load_npz(path)
    limits = {"max_step": plan.max_step, "rest_speed": plan.scene.simulation.rest_speed}
    return going_on(ended, path, problem, plan.setting, **limits)
