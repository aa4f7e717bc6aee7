"""The motion of a scene: `simulate`, and its two halves, `planned` and `carried_out`."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from eomgen.api.generating import compiled
from eomgen.api.given import Source, Values, check, named, overridden, read
from eomgen.api.reporter import SILENT, Reporter
from eomgen.errors import RunError
from eomgen.model.elaborate import in_order
from eomgen.model.model import Model
from eomgen.results import Run
from eomgen.run.module import GeneratedModule, as_powers
from eomgen.run.problem import Problem
from eomgen.scene.appearance import appearance_of
from eomgen.scene.schema import SHOWN, Form, Route, Scene, Simulation
from eomgen.study.diagnosis import problem_of

if TYPE_CHECKING:
    from eomgen.run.guard import Guard
    from eomgen.run.resume import Start
    from eomgen.run.tally import Follow
    from eomgen.study.accuracy.search import Choice
    from eomgen.study.accuracy.trial import Setting

Guarding = Literal["stop", "repair"]
Earlier = str | PathLike[str] | Run


@dataclass(frozen=True)
class Plan:
    """A run that is asked for, and what of it could be checked at once.

    scene    what is simulated, for its settings and its looks
    model    with the outputs that the run and its pictures take
    setting  method and tolerances or step; None where `accuracy` or `budget` choose it
    outputs  those that were asked for by name
    others   as `simulate` has them
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
    guard: Guarding | None = None
    unstable: bool = False
    estimate: bool = False
    resume: Earlier | None = None


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
    guard: Guarding | None = None,
    unstable: bool = False,
    estimate: bool = False,
    resume: Earlier | None = None,
    follow: "Follow | None" = None,
) -> Run:
    """The motion of a scene from its initial state.

    t_end, integrator, dt, rtol, atol  None: the scene's own; `dt` for equal steps, s, `rtol` and
                        `atol` for adaptive methods
    accuracy            asks for a method and tolerances whose error in the last state is below this
                        part of the motion's scale, by runs of this very scene
    budget              asks for the most exact run that takes about so long, s
    parameters, inputs  other values by name; inputs are constant
    samples             rows that are kept, about
    max_step            longest step of adaptive methods, s
    works               asks for what each effect has done, J
    guard               watches rounding at every step: "stop" where digits are lost, or "repair"
    unstable            lets equal steps of an explicit method be too long for stability
    estimate            estimates the error by a second run
    resume              goes on where an earlier run ended: its archive `.npz`, or itself
    follow              told time and state after each step; a true result stops the run

    A run that cannot go on is returned with the rows up to there: it is not `finished`, and its
    `outcome` says why and what to change. Raises `SceneError`, or `RunError` for an argument that
    cannot be served.
    """
    scene = read(source)
    plan = planned(
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
    )
    return carried_out(plan, follow=follow)


def planned(
    scene: Scene,
    model: Model,
    *,
    t_end: float | None = None,
    integrator: str | None = None,
    dt: float | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    parameters: Values | None = None,
    inputs: Values | None = None,
    unstable: bool = False,
    reporter: Reporter = SILENT,
    **others: Any,
) -> Plan:
    """A run of a scene's model, as `simulate` describes it.

    Raises `RunError` for what cannot be served.
    """
    bounds = {"rtol": rtol, "atol": atol, "dt": dt}
    aims = [name for name in ("accuracy", "budget") if others.get(name) is not None]
    _check_aims(aims, bounds, reporter)
    asked = (*model.outputs, *SHOWN, *(("effect_powers",) if others.get("works") else ()))
    model = replace(model, outputs=in_order(asked))
    given = named(parameters, model.defaults, reporter.argument("parameters"), "parameter")
    pushes = named(inputs, [i.name for i in model.inputs], reporter.argument("inputs"), "input")
    if aims and others.get("resume") is not None:
        raise RunError(
            f"{reporter.argument('resume')}: goes on with a method that is named; leave "
            f"{reporter.argument('accuracy')}, {reporter.argument('budget')} out"
        )
    guard = others.get("guard")
    if guard not in (None, "stop", "repair"):
        raise RunError(f"{reporter.argument('guard')}: '{guard}' is none of stop, repair")
    setting = (
        None if aims else setting_of(scene.simulation, integrator, **bounds, reporter=reporter)
    )
    if unstable:
        _check_unstable(setting, reporter)
    end = scene.simulation.t_end if t_end is None else t_end
    others |= {"integrator": integrator, "unstable": unstable}
    return Plan(scene, model, setting, end, given, pushes, **others)


def carried_out(plan: Plan, *, follow: "Follow | None" = None, reporter: Reporter = SILENT) -> Run:
    """The run of a plan. Raises `RunError` where it cannot begin."""
    # Imported here: to check and to generate needs no SciPy.
    from eomgen.show.observe import observe
    from eomgen.study.accuracy.aimed import UNKNOWN, made_again
    from eomgen.study.accuracy.estimate import by_second_run
    from eomgen.study.accuracy.moved import moved_problem
    from eomgen.study.accuracy.trial import Case

    model = plan.model
    module, functions = compiled(model, asked=plan.outputs, reporter=reporter)
    values = (plan.parameters or None, plan.inputs or None)
    kept: dict[str, Any] = {
        "samples": plan.samples,
        "max_step": plan.max_step,
        "rest_speed": plan.scene.simulation.rest_speed,
        "guard": _guard(plan, functions, values),
        "unstable": plan.unstable,
    }
    problem = problem_of(functions, *values, model)
    start = _start(plan, problem)
    if start is not None:
        problem = start.problem
        kept |= start.options
    moved = moved_problem(functions, model, *values)
    case = Case(problem, plan.t_end, functions.UNITS, kept, reporter.progress, moved)
    powers = as_powers(functions, *values) if plan.works else None
    warnings, error = [*model.notices, *module.notices], math.nan
    choice: Choice | None = None
    if plan.setting is None:
        choice = _chosen(plan, case, reporter)
        error = choice.error
        if not choice.met:
            why = choice.reason or UNKNOWN
            warnings.append(f"accuracy: not reached, the estimate is {error:.1g}: {why}")
        tried = made_again(case, choice, powers, follow)
    else:
        tried = case.run(plan.setting, powers=powers, follow=follow)
    trajectory, estimate = tried.trajectory, None
    if plan.estimate and choice is None and trajectory.finished:
        estimate = by_second_run(case, tried)
        error = estimate.last
    own = model.with_parameters(plan.parameters)
    return Run(
        own,
        module,
        trajectory,
        observe(own, functions, trajectory, appearance_of(plan.scene), plan.inputs),
        tried.setting.options,
        error,
        tuple(warnings),
        choice=choice,
        estimate=estimate,
        begun=start.reported(trajectory) if start else "",
    )


def _chosen(plan: Plan, case: Any, reporter: Reporter) -> "Choice":
    from eomgen.study.accuracy.aimed import aimed

    return aimed(
        case,
        accuracy=plan.accuracy,
        budget=plan.budget,
        integrator=plan.integrator,
        say=reporter.trial,
    )


def _check_aims(
    aims: Sequence[str], bounds: Mapping[str, float | None], reporter: Reporter
) -> None:
    """Raise `RunError` where a run is asked for in two ways at once."""
    if len(aims) > 1:
        both = ", ".join(map(reporter.argument, aims))
        raise RunError(f"{both}: a run has one aim; give one of them")
    for aim in map(reporter.argument, aims):
        for name, value in bounds.items():
            if value is not None:
                option = reporter.argument(name)
                raise RunError(f"{aim}, {option}: {aim} chooses {name} itself; leave one out")


def _check_unstable(setting: "Setting | None", reporter: Reporter) -> None:
    """Raise `RunError` for `unstable` where no step can be too long."""
    from eomgen.run.integrators import FixedStep, find_integrator

    asked = reporter.argument("unstable")
    if setting is None:
        raise RunError(
            f"{asked}: is for a step that is given; leave {reporter.argument('accuracy')}, "
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
    """What watches the run, if that is asked for."""
    if plan.guard is None:
        return None
    from eomgen.precision.guarding import guard_of
    from eomgen.store import program_of

    return guard_of(module, program_of(plan.model), *values, repairs=plan.guard == "repair")


def _start(plan: Plan, problem: Problem) -> "Start | None":
    """How the run goes on from an earlier one, if that is asked for."""
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


def setting_of(
    wanted: Simulation,
    integrator: str | None = None,
    *,
    dt: float | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    reporter: Reporter = SILENT,
) -> "Setting":
    """The method asked for, or the scene's, `wanted`, with tolerances or a step.

    Raises `RunError` for tolerances of a method that takes equal steps.
    """
    from eomgen.run.integrators import FixedStep, find_integrator
    from eomgen.study.accuracy.trial import Setting

    name = wanted.integrator if integrator is None else integrator
    if not isinstance(find_integrator(name), FixedStep):
        return Setting(
            name,
            wanted.rtol if rtol is None else rtol,
            wanted.atol if atol is None else atol,
            dt,
        )
    if rtol is not None or atol is not None:
        rtol_name, atol_name, dt_name = map(reporter.argument, ("rtol", "atol", "dt"))
        raise RunError(
            f"{rtol_name}, {atol_name}: {name} takes equal steps; give {dt_name} instead"
        )
    return Setting(name, dt=wanted.dt if dt is None else dt)
