"""Many runs of one scene: `ensemble`."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from eomgen.api.generating import compiled
from eomgen.api.given import Source, Values, check_name, check_time, model_of, read, values_of
from eomgen.api.inputs import Inputs, for_members
from eomgen.api.planning import Backend
from eomgen.api.public import public
from eomgen.api.reporter import SILENT, Reporter
from eomgen.api.settings import check_unstable, setting_of
from eomgen.api.states import state_names
from eomgen.base.errors import RunError
from eomgen.model.elaborate import in_order
from eomgen.model.model import Model
from eomgen.native import equal_steps
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
from eomgen.run.problem import FloatArray
from eomgen.scene.schema import Scene
from eomgen.study.accuracy.trial import Setting
from eomgen.sweep.design import Design, Law, grid, in_radians, listed, sampled
from eomgen.sweep.ensemble import Ensemble
from eomgen.sweep.execute import chunk_size, execute
from eomgen.sweep.layout import Memory, bytes_each, layout_of, worded
from eomgen.sweep.members import Task
from eomgen.sweep.storage import Storage, opened
from eomgen.sweep.together import METHODS, build
from eomgen.tables.outputs import OUTPUTS

__all__ = ["Design", "Ensemble", "Law", "ensemble", "grid", "plan_sweep", "run_sweep", "sampled"]

MANY = 20
"""Least number of members for which C steps are compiled that are not in the store."""
DYNAMICS = ("forward_dynamics", "inverse_dynamics")
"""Outputs that take more than a time and a state."""
UNITS = {name: spec.units[0] for name, spec in OUTPUTS.items() if not spec.shape}
"""Units of the outputs with one number."""
MOST_STEPS = 10_000_000


@dataclass(frozen=True)
class SweepPlan:
    """Checked arguments of a sweep."""

    scene: Scene
    model: Model
    design: Design
    setting: Setting
    t_end: float
    parameters: Mapping[str, float]
    inputs: Mapping[str, float]
    varying: InputsOfTime | None
    outputs: tuple[str, ...]
    samples: int
    max_step: float | None
    unstable: bool
    backend: Backend


@public
def ensemble(
    source: Source,
    vary: Design | Mapping[str, Sequence[float] | FloatArray],
    *,
    t_end: float | None = None,
    integrator: str | None = None,
    dt: float | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    parameters: Values | None = None,
    inputs: Inputs | None = None,
    outputs: Sequence[str] = (),
    samples: int = 2,
    max_step: float | None = None,
    unstable: bool = False,
    backend: Backend = "auto",
    workers: int = 1,
    scheduler: str = "",
    folder: str | PathLike[str] | None = None,
) -> Ensemble:
    """Run a scene many times, with other parameters, initial states or inputs.

    vary        lists of values by name of a parameter, a state or an input, one for each member,
                `<name>_deg` of an angle in degrees; or `grid(...)` or `sampled(...)`
    t_end, integrator, dt, rtol, atol, max_step, unstable  as for `simulate`
    parameters, inputs  values that all members have; inputs may also be formulas of t, the motion
                and parameters, or the path of a table, as for `simulate`; with a table nothing is
                compiled
    outputs     functions of the module to compute: "kinetic_energy" for example
    samples     approximate number of rows to keep; 2 keeps only the first and the last
    backend     "numpy": run in Python; "c": compile at once; "auto": compile if that pays
    workers     number of processes, or threads if members run together in compiled code. With more
                than one, a script needs `if __name__ == "__main__":`
    scheduler   address of a Dask scheduler whose workers run the members
    folder      where finished members are kept, so that the same call continues a stopped sweep

    A member that stops or is refused is a row that says so. The results do not depend on backend,
    workers or scheduler. Raises `SceneError`, or `RunError` for an invalid argument.
    """
    scene, constants, varying = for_members(read(source), inputs)
    design = vary if isinstance(vary, Design) else listed(vary)
    plan = plan_sweep(
        scene,
        model_of(scene, source),
        design,
        t_end=t_end,
        integrator=integrator,
        dt=dt,
        rtol=rtol,
        atol=atol,
        parameters=parameters,
        inputs=constants,
        varying=varying,
        outputs=outputs,
        samples=samples,
        max_step=max_step,
        unstable=unstable,
        backend=backend,
    )
    kept = None if folder is None else Path(folder)
    return run_sweep(plan, workers=workers, scheduler=scheduler, folder=kept)


def plan_sweep(
    scene: Scene,
    model: Model,
    design: Design,
    *,
    t_end: float | None = None,
    integrator: str | None = None,
    dt: float | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    parameters: Values | None = None,
    inputs: Values | None = None,
    varying: InputsOfTime | None = None,
    outputs: Sequence[str] = (),
    samples: int = 2,
    max_step: float | None = None,
    unstable: bool = False,
    backend: Backend = "auto",
    reporter: Reporter = SILENT,
) -> SweepPlan:
    """Check the arguments of `ensemble`, which describes them. Raises `RunError`."""
    argument = reporter.argument
    check_samples(samples)
    t_end = scene.simulation.t_end if t_end is None else t_end
    check_time(t_end, argument("t_end"))
    if backend not in ("auto", "numpy", "c"):
        raise RunError(f"{argument('backend')}: '{backend}' is not one of auto, numpy, c")
    for name in outputs:
        check_name(name, [n for n in OUTPUTS if n not in DYNAMICS], argument("outputs"), "output")
    setting = setting_of(
        scene.simulation, integrator, dt=dt, rtol=rtol, atol=atol, reporter=reporter
    )
    if unstable:
        check_unstable(setting, reporter)
    fixed = values_of(model, parameters, inputs, reporter)
    design = in_radians(design, _degrees(model))
    if varying is not None and backend == "c":
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
        replace(model, outputs=in_order((*model.outputs, *outputs))),
        design,
        setting,
        t_end,
        *fixed,
        varying,
        tuple(outputs),
        samples,
        max_step,
        unstable,
        backend,
    )


def _degrees(model: Model) -> dict[str, str]:
    """The names of angles in degrees, unless something else has them, with those in radians."""
    plain = len(model.coordinates) + len(model.velocities) + len(model.extra)
    others = {*model.defaults, *(i.name for i in model.inputs)}
    angles = state_names(model)[plain:]
    return {name: name.removesuffix("_deg") for name in angles if name not in others}


def run_sweep(
    plan: SweepPlan,
    *,
    workers: int = 1,
    scheduler: str = "",
    folder: Path | None = None,
    reporter: Reporter = SILENT,
) -> Ensemble:
    """Run a plan. Raises `RunError` if it cannot begin, or if workers fail."""
    if workers < 1:
        raise RunError(
            f"{reporter.argument('workers')}: {workers} is not a number of processes; give 1 or "
            "more"
        )
    model = plan.model
    module, functions = compiled(model, asked=plan.outputs, reporter=reporter)
    state_names: tuple[str, ...] = functions.STATES
    times, dt, every = _times(plan)
    in_c = _compiles(plan, reporter)
    many = plan.backend == "c" or len(plan.design.values) >= MANY
    together = in_c and many and _run_together(plan.setting.integrator, functions)
    task = Task(
        model=model,
        source=module.source,
        compiled=in_c,
        at_once=in_c and many,
        together=together,
        threads=in_c and many and _mostly_in_c(plan.setting.integrator, functions),
        names=plan.design.names,
        kinds=tuple(_kind(name, model, state_names, reporter) for name in plan.design.names),
        parameters=plan.parameters,
        inputs=plan.inputs,
        varying=plan.varying,
        outputs=plan.outputs,
        t_end=plan.t_end,
        times=times,
        settings={
            "integrator": plan.setting.integrator,
            "dt": plan.setting.dt,
            **plan.setting.tolerances,
            "max_step": plan.max_step,
            "unstable": plan.unstable,
            "rest_speed": plan.scene.simulation.rest_speed,
        },
        dt=dt,
        every=every,
    )
    if not scheduler:
        task = _built(task, plan, reporter)
    layout, members = layout_of(task), len(plan.design.values)
    size = chunk_size(members, task.together, bytes_each(layout))
    with ExitStack() as open_ones:
        kept: Memory | Storage = (
            Memory(layout, members, size)
            if folder is None
            else open_ones.enter_context(opened(folder, task, plan.design, layout, size))
        )
        progress = open_ones.enter_context(reporter.progress(f"sweeping {model.name}"))
        execute(
            *(task, plan.design, kept, size),
            workers=workers,
            scheduler=scheduler,
            progress=progress,
        )
        found, messages = kept.results()
    return Ensemble(
        model.name,
        plan.design,
        state_names,
        found["final"],
        found["t"],
        found["status"],
        worded(messages, members),
        np.array(times),
        found.get("rows"),
        {name: found[name] for name in plan.outputs},
        {**functions.UNITS, **UNITS},
    )


def _times(plan: SweepPlan) -> tuple[tuple[float, ...], float, int]:
    """The times of the rows that are kept, s; for fixed steps also the step, and the number of
    steps from one row to the next.
    """
    method = find_integrator(plan.setting.integrator)
    if not isinstance(method, FixedStep):
        check_no_step(plan.setting.integrator, plan.setting.dt)
        assert plan.setting.rtol is not None
        check_tolerances(method, plan.setting.rtol, plan.setting.atol)
        longest_steps(plan.max_step, plan.t_end)
        return tuple(np.linspace(0.0, plan.t_end, plan.samples).tolist()), 0.0, 1
    given = (plan.setting.integrator, plan.t_end, plan.setting.dt, plan.samples, MOST_STEPS)
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

    if plan.backend == "numpy" or plan.varying is not None:
        return False
    if plan.backend == "c" and not find_integrator(plan.setting.integrator).compiled:
        method = plan.setting.integrator
        reporter.note(f"steps of {method} are not compiled, but their derivatives are")
    try:
        find_compiler()
    except RunError as error:
        if plan.backend == "c":
            raise
        reporter.note(f"the sweep is not compiled: {error}")
        return False
    return True


def _run_together(integrator: str, functions: Any) -> bool:
    """Whether members run together: by a method that can do that, of a module without contacts
    and constraints, and for adaptive methods without other one-sided forces.
    """
    alone = any(getattr(functions, name, ()) for name in ("CONTACTS", "CONSTRAINTS"))
    if integrator not in METHODS or not functions.STATES or alone:
        return False
    switching = ("switching_functions", "_switching_functions_of_time")
    return integrator == "rk4" or not any(hasattr(functions, name) for name in switching)


def _mostly_in_c(integrator: str, functions: Any) -> bool:
    """Whether Python does so little in members that run one by one that threads serve them: if
    compiled code makes almost all steps. For adaptive methods rigid contacts are held in Python,
    and steps that pass over a corner are repeated there.
    """
    method = find_integrator(integrator)
    contacts: tuple[str, ...] = getattr(functions, "CONTACTS", ())
    loops: tuple[str, ...] = getattr(functions, "CONSTRAINTS", ())
    if not method.compiled or (contacts and (loops or method.compiled not in equal_steps.METHODS)):
        return False
    return isinstance(method, FixedStep) or not hasattr(functions, "switching_functions")


def _built(task: Task, plan: SweepPlan, reporter: Reporter) -> Task:
    """The task with its kernels compiled, or without them if that fails. With the backend "c" it
    raises `RunError` instead.
    """
    try:
        build(task)
    except RunError as error:
        if plan.backend == "c":
            raise
        reporter.note(f"the sweep is not compiled: {error}")
        return replace(task, compiled=False, at_once=False, together=False, threads=False)
    return task
