"""Many runs of one scene: `ensemble`."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from eomgen.api.controllers import with_controllers
from eomgen.api.generating import compiled
from eomgen.api.given import Values, check_name, model_of, read, values_of
from eomgen.api.inputs import for_members
from eomgen.api.options import SweepOptions
from eomgen.api.public import public
from eomgen.api.reporter import SILENT, Reporter
from eomgen.api.settings import check_unstable, setting_of
from eomgen.api.states import state_names
from eomgen.base.errors import RunError
from eomgen.base.options import taking
from eomgen.model.elaborate import in_order
from eomgen.model.model import Model
from eomgen.results.design import Design, Law, grid, in_radians, listed, sampled
from eomgen.results.ensemble import Ensemble
from eomgen.results.module import Module
from eomgen.run.checks import (
    check_no_step,
    check_samples,
    check_steps,
    check_tolerances,
    longest_steps,
)
from eomgen.run.inputs import InputsOfTime
from eomgen.run.integrators import FixedStep, find_integrator
from eomgen.run.integrators.fixed_step import count_steps
from eomgen.run.through_events import THROUGH_EVENTS
from eomgen.scene.schema import Scene
from eomgen.study.accuracy.trial import Setting
from eomgen.sweep.execute import chunk_size, execute
from eomgen.sweep.layout import Memory, bytes_each, layout_of, worded
from eomgen.sweep.members import Task
from eomgen.sweep.storage import Storage, opened
from eomgen.sweep.together import METHODS, build
from eomgen.tables.outputs import OUTPUTS

__all__ = ["Design", "Ensemble", "Law", "ensemble", "grid", "plan_sweep", "run_sweep", "sampled"]

MANY = 20
"""Least number of members for which C steps are compiled that are not in the store."""
MOST_STEPS = 10_000_000


@dataclass(frozen=True)
class SweepPlan:
    """Checked options of a sweep.

    model       with the outputs that are computed
    design      the members, angles in radians
    setting     method and tolerances or step
    t_end       end time, s
    parameters  values that are not the scene's own
    inputs      constant inputs that are not their defaults
    varying     all inputs, if some of them are tables
    """

    scene: Scene
    model: Model
    design: Design
    setting: Setting
    t_end: float
    parameters: Mapping[str, float]
    inputs: Mapping[str, float]
    varying: InputsOfTime | None
    options: SweepOptions

    @property
    def outputs(self) -> tuple[str, ...]:
        """The functions of the module that are computed."""
        return tuple(self.options.outputs)


@public
@taking(SweepOptions)
def ensemble(options: SweepOptions) -> Ensemble:
    """Run a scene many times, with other parameters, initial states or inputs.

    A member that stops or is refused is a row that says so. The results do not depend on backend,
    workers or scheduler. Raises `SceneError`, or `RunError` for an invalid argument.
    """
    scene, functions = with_controllers(read(options.source), options.controllers)
    if functions:
        raise RunError("controllers: functions of Python run in simulate alone; give formulas")
    scene, constants, varying = for_members(scene, options.inputs)
    model = model_of(scene, options.source)
    return run_sweep(plan_sweep(scene, model, options, constants=constants, varying=varying))


def plan_sweep(
    scene: Scene,
    model: Model,
    options: SweepOptions,
    *,
    constants: Values | None = None,
    varying: InputsOfTime | None = None,
    reporter: Reporter = SILENT,
) -> SweepPlan:
    """Check the options of `ensemble` for a scene's model. Raises `RunError`.

    Of inputs `constants` are constant; `varying` are all of them if some are tables.
    """
    argument, vary = reporter.argument, options.vary
    check_samples(options.samples)
    known = [n for n, spec in OUTPUTS.items() if not spec.beside]
    for name in options.outputs:
        check_name(name, known, argument("outputs"), "output")
    steps = {"dt": options.dt, "rtol": options.rtol, "atol": options.atol}
    setting = setting_of(scene.simulation, options.integrator, **steps, reporter=reporter)
    if options.unstable:
        check_unstable(setting, reporter)
    fixed = values_of(model, options.parameters, constants, reporter)
    design = vary if isinstance(vary, Design) else listed(vary)
    design = in_radians(design, _degrees(model))
    if varying is not None and options.backend == "c":
        raise RunError(
            f"{argument('inputs')}: with a table nothing is compiled; give a formula of t, or "
            "leave the backend out"
        )
    tables = [name for name, x in (varying.given if varying else {}).items() if callable(x)]
    for name in design.names:
        if any(name in values for values in (*fixed, tables)):
            raise RunError(f"{argument('vary')}: {name} is also given a fixed value; leave one out")
    return SweepPlan(
        scene,
        replace(model, outputs=in_order((*model.outputs, *options.outputs))),
        design,
        setting,
        scene.simulation.t_end if options.t_end is None else options.t_end,
        *fixed,
        varying,
        options,
    )


def _degrees(model: Model) -> dict[str, str]:
    """The names of angles in degrees, unless something else has them, with those in radians."""
    plain = len(model.coordinates) + len(model.velocities) + len(model.extra)
    others = {*model.defaults, *(i.name for i in model.inputs)}
    angles = state_names(model)[plain:]
    return {name: name.removesuffix("_deg") for name in angles if name not in others}


def run_sweep(plan: SweepPlan, *, reporter: Reporter = SILENT) -> Ensemble:
    """Run a plan. Raises `RunError` if it cannot begin, or if workers fail."""
    model, options = plan.model, plan.options
    module, functions = compiled(model, asked=plan.outputs, reporter=reporter)
    task = _task(plan, module, functions, reporter)
    layout, members = layout_of(task), len(plan.design.values)
    size = chunk_size(members, task.together, bytes_each(layout))
    with ExitStack() as open_ones:
        kept: Memory | Storage = (
            Memory(layout, members, size)
            if options.folder is None
            else open_ones.enter_context(
                opened(Path(options.folder), task, plan.design, layout, size)
            )
        )
        progress = open_ones.enter_context(reporter.progress(f"sweeping {model.name}"))
        execute(
            *(task, plan.design, kept, size),
            workers=options.workers,
            scheduler=options.scheduler,
            progress=progress,
        )
        found, messages = kept.results()
    return Ensemble(
        model.name,
        plan.design,
        functions.STATES,
        found["final"],
        found["t"],
        found["status"],
        worded(messages, members),
        np.array(task.times),
        found.get("rows"),
        {name: found[name] for name in plan.outputs},
        {
            **functions.UNITS,
            **{n: OUTPUTS[n].unit("", 0) for n in plan.outputs if not OUTPUTS[n].shape},
        },
    )


def _task(plan: SweepPlan, module: Module, functions: Any, reporter: Reporter) -> Task:
    """What each member runs, with its kernels compiled if that pays."""
    setting, names = plan.setting, plan.design.names
    times, dt, every = _times(plan)
    in_c = _compiles(plan, reporter)
    many = in_c and (plan.options.backend == "c" or len(plan.design.values) >= MANY)
    task = Task(
        model=plan.model,
        source=module.source,
        compiled=in_c,
        at_once=many,
        together=many and _run_together(setting.integrator, functions),
        threads=many and _mostly_in_c(setting.integrator, functions),
        names=names,
        kinds=tuple(_kind(name, plan.model, functions.STATES, reporter) for name in names),
        parameters=plan.parameters,
        inputs=plan.inputs,
        varying=plan.varying,
        outputs=plan.outputs,
        t_end=plan.t_end,
        times=times,
        settings={
            "integrator": setting.integrator,
            "dt": setting.dt,
            **setting.tolerances,
            "max_step": plan.options.max_step,
            "unstable": plan.options.unstable,
            "rest_speed": plan.scene.simulation.rest_speed,
        },
        dt=dt,
        every=every,
    )
    return task if plan.options.scheduler else _built(task, plan, reporter)


def _times(plan: SweepPlan) -> tuple[tuple[float, ...], float, int]:
    """The times of the rows that are kept, s; for fixed steps also the step, and the number of
    steps from one row to the next.
    """
    method = find_integrator(plan.setting.integrator)
    if not isinstance(method, FixedStep):
        check_no_step(plan.setting.integrator, plan.setting.dt)
        assert plan.setting.rtol is not None
        check_tolerances(method, plan.setting.rtol, plan.setting.atol)
        longest_steps(plan.options.max_step, plan.t_end)
        return tuple(np.linspace(0.0, plan.t_end, plan.options.samples).tolist()), 0.0, 1
    given = (plan.setting.integrator, plan.t_end, plan.setting.dt, plan.options.samples, MOST_STEPS)
    dt, every = check_steps(*given)
    steps = int(count_steps(plan.t_end, dt))
    return (*(i * dt for i in range(0, steps, every)), plan.t_end), dt, every


def _kind(name: str, model: Model, states: Sequence[str], reporter: Reporter) -> str:
    """Whether a name is that of a parameter, a state or an input."""
    inputs = [i.name for i in model.inputs]
    for kind, names in (("parameter", model.defaults), ("state", states), ("input", inputs)):
        if name in names:
            return kind
    known = (*model.defaults, *states, *inputs)
    check_name(name, known, reporter.argument("vary"), "parameter, state or input")
    raise AssertionError(name)


def _compiles(plan: SweepPlan, reporter: Reporter) -> bool:
    """Whether members run in compiled code where that pays."""
    from eomgen.native.compiler import find_compiler

    if plan.options.backend == "numpy" or plan.varying is not None:
        return False
    if plan.options.backend == "c" and not find_integrator(plan.setting.integrator).compiled:
        method = plan.setting.integrator
        reporter.note(f"steps of {method} are not compiled, but their derivatives are")
    try:
        find_compiler()
    except RunError as error:
        if plan.options.backend == "c":
            raise
        reporter.note(f"the sweep is not compiled: {error}")
        return False
    return True


def _run_together(integrator: str, functions: Any) -> bool:
    """Whether members run together: by a method that can do that, of a module without contacts,
    constraints and sampled controllers, and for adaptive methods without other one-sided forces.
    """
    alone = any(getattr(functions, name, ()) for name in ("CONTACTS", "CONSTRAINTS", "CONTROLLERS"))
    if integrator not in METHODS or not functions.STATES or alone:
        return False
    switching = ("switching_functions", "_switching_functions_of_time")
    return integrator == "rk4" or not any(hasattr(functions, name) for name in switching)


def _mostly_in_c(integrator: str, functions: Any) -> bool:
    """Whether Python does so little in members that run one by one that threads serve them: if
    compiled code makes almost all steps, and for adaptive methods, whose steps are few, goes
    through the events of rigid contacts and over branches of the derivative, see
    `run.through_events`. Python looks at each of these if constraints are kept, and where branches
    depend on time alone.
    """
    method = find_integrator(integrator)
    if hasattr(functions, "CONTROLLERS"):
        return False
    if isinstance(method, FixedStep) or not method.compiled:
        return bool(method.compiled)
    in_time = hasattr(functions, "_switching_functions_of_time")
    held = bool(getattr(functions, "CONSTRAINTS", ()))
    looked = in_time or held or integrator not in THROUGH_EVENTS
    interrupted = getattr(functions, "CONTACTS", ()) or hasattr(functions, "switching_functions")
    return not (looked and interrupted)


def _built(task: Task, plan: SweepPlan, reporter: Reporter) -> Task:
    """The task with its kernels compiled, or without them if that fails. With the backend "c" it
    raises `RunError` instead.
    """
    try:
        build(task)
    except RunError as error:
        if plan.options.backend == "c":
            raise
        reporter.note(f"the sweep is not compiled: {error}")
        return replace(task, compiled=False, at_once=False, together=False, threads=False)
    return task
