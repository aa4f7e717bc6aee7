"""Motions with a proven error: `certify`."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from eomgen.api.generating import compiled
from eomgen.api.given import Values, model_of, named, read, values_of
from eomgen.api.inputs import constant_inputs
from eomgen.api.options import CertifyOptions
from eomgen.api.public import public
from eomgen.api.reporter import SILENT, Reporter
from eomgen.api.runs import Run
from eomgen.api.states import initial_with, values_by_index
from eomgen.base.errors import RunError
from eomgen.base.options import taking
from eomgen.certified.balls import Ball, Balls, ball, check_balls, in_parts, precision, radius
from eomgen.certified.proof import Proof, prove
from eomgen.certified.recursion import Motion
from eomgen.model.model import Model
from eomgen.program.taylor import NoSeriesError
from eomgen.results.enclosed import Enclosure
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import FloatArray, Problem
from eomgen.store import program_of
from eomgen.study.diagnosis import problem_of


@public
@taking(CertifyOptions)
def certify(options: CertifyOptions) -> Enclosure:
    """Prove boxes that hold a motion, or bounds of the error of a run.

    The motion is the exact solution of the equations of the scene's module: its constants and the
    start are taken as the doubles that they are. The equations must be smooth: rigid contacts,
    functions with corners or jumps, and loops that have no closed form are refused. Needs the
    package python-flint: `pip install 'eomgen[certified]'`.

    Raises `SceneError`, or `RunError` for an invalid argument or a motion that cannot be proven.
    """
    if isinstance(options.source, Run):
        return certified_run(options.source, options)
    scene = read(options.source)
    t_end = scene.simulation.t_end if options.t_end is None else options.t_end
    return certified(model_of(scene, options.source), options, t_end)


def certified(
    model: Model, options: CertifyOptions, t_end: float, reporter: Reporter = SILENT
) -> Enclosure:
    """A checked model's motion up to a time, enclosed as `certify` describes."""
    constants = constant_inputs(options.inputs, reporter)
    parameters, inputs = values_of(model, options.parameters, constants, reporter)
    state = values_by_index(model, options.state, reporter)
    task = _Task.of(model, parameters, inputs, state, options.uncertain, reporter)
    times = np.linspace(0.0, t_end, options.samples)
    found = task.proven(times, options.tolerance, reporter)
    return _enclosure(task, found, times, options.tolerance)


def certified_run(run: Run, options: CertifyOptions, reporter: Reporter = SILENT) -> Enclosure:
    """The motion of a run from its first row on, and bounds of the run's errors."""
    given = [
        name
        for name in ("t_end", "parameters", "state", "inputs", "uncertain")
        if getattr(options, name)
    ]
    if given:
        raise RunError(f"{reporter.argument(given[0])}: the run has its own; leave it out")
    if run.varying:
        raise RunError("certify: tables and functions of time have no proof; give formulas of t")
    setup = run.trajectory.setup
    parameters = dict(setup.parameters) if setup else {}
    task = _Task.of(run.model, parameters, dict(run.inputs), {}, None, reporter)
    if task.problem.states != run.states:
        raise RunError("certify: the run has other states than the scene; run it again")
    task = replace(task, start=[ball(x) for x in run.y[0].tolist()])
    found = task.proven(run.t, options.tolerance, reporter)
    enclosure = _enclosure(task, found, run.t, options.tolerance)
    with precision(2 * found.plan.bits):
        errors = [
            [abs(x - value) for x, value in zip(row, values, strict=True)]
            for row, values in zip(found.rows, run.y.tolist(), strict=False)
        ]
        most = [[_double(x.upper(), math.inf) for x in row] for row in errors]
        least = [[max(0.0, _double(x.lower(), -math.inf)) for x in row] for row in errors]
    return replace(enclosure, error=np.array(most), least=np.array(least))


@dataclass(frozen=True, eq=False)
class _Task:
    """A motion that is to be proven.

    values  of parameters and inputs that are known
    start   the box of the states, and of uncertain parameters
    """

    name: str
    motion: Motion
    problem: Problem
    values: Mapping[str, Ball]
    start: Balls

    @classmethod
    def of(
        cls,
        model: Model,
        parameters: dict[str, float],
        inputs: dict[str, float],
        state: Mapping[int, float],
        uncertain: Values | None,
        reporter: Reporter,
    ) -> "_Task":
        """The task, with all arguments checked. Raises `RunError`."""
        check_balls()
        _, module = compiled(model, reporter=reporter)
        with reporter.located():
            problem = problem_of(
                *(module, parameters, inputs, model),
                (lambda y: initial_with(model, y, state, reporter, parameters)) if state else None,
            )
        _check_smooth(module, problem)
        values = {**module.PARAMETERS, **parameters, **module.INPUTS, **inputs}
        widths = _widths(uncertain, module, reporter)
        varied = [name for name in widths if name in module.PARAMETERS]
        try:
            motion = Motion.of(program_of(model), module.STATES, varied)
        except NoSeriesError as error:
            raise RunError(f"certify: takes smooth equations, and these contain {error}") from None
        middles = [*problem.initial.tolist(), *(float(values[name]) for name in varied)]
        start = [ball(x, widths.get(n, 0.0)) for n, x in zip(motion.names, middles, strict=True)]
        known = {name: ball(float(x)) for name, x in values.items() if name not in varied}
        return cls(model.name, motion, problem, known, start)

    def proven(self, times: FloatArray, wanted: float, reporter: Reporter) -> Proof:
        """Boxes at the times. Raises `RunError` if not even the first step is proven."""
        with reporter.waiting(f"proving {self.name} …"):
            found = prove(self.motion, dict(self.values), self.start, times.tolist(), wanted)
        if found.reached <= times[0]:
            raise RunError(f"certify: no step from t = {times[0]:g} s could be proven")
        return found


def _check_smooth(module: GeneratedModule, problem: Problem) -> None:
    """Raise `RunError` for what has no proof."""
    if problem.contacts is not None:
        raise RunError("certify: rigid contacts strike, which has no proof yet")
    if problem.sampling is not None:
        raise RunError("certify: controllers that sample have no proof yet; leave them out")
    if problem.projection is not None:
        raise RunError(
            "certify: the constraints of this scene have no closed form, and motions that are "
            "projected on them have no proof yet"
        )
    if not module.STATES:
        raise RunError("certify: the scene has no states; all of its motion is prescribed")


def _widths(
    uncertain: Values | None, module: GeneratedModule, reporter: Reporter
) -> dict[str, float]:
    """How far parameters and states may lie from their values, by name."""
    argument = reporter.argument("uncertain")
    known = (*module.STATES, *module.PARAMETERS)
    widths = named(uncertain, known, argument, "state or parameter")
    for name, width in widths.items():
        if width < 0:
            raise RunError(f"{argument}: {name} has a negative width; give how far it may be off")
    return widths


def _enclosure(task: _Task, found: Proof, times: FloatArray, wanted: float) -> Enclosure:
    rows = found.rows
    exact = all(radius(x) == 0 for x in task.start)
    whole = len(rows) == times.size
    message = ""
    if not whole:
        message = (
            f"proven up to t = {found.reached:.6g} s only: from there boxes are too wide, or the "
            "motion is not smooth"
        )
    elif exact and found.radius > wanted:
        message = f"the radius grows to {found.radius:.2g}"
    with precision(2 * found.plan.bits):
        parts = [[in_parts(x) for x in row] for row in rows]
    y, low, radii = (np.array([[x[k] for x in row] for row in parts]) for k in range(3))
    return Enclosure(
        task.name,
        task.motion.names,
        times[: len(rows)],
        *(y, low, radii),
        *(wanted, not message, message),
        *(found.plan.bits, found.plan.order, found.steps),
    )


def _double(x: Ball, towards: float) -> float:
    return math.nextafter(float(x), towards)
