"""Checked options of a simulation: `plan_run`, which `simulate` calls."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from eomgen.api.given import Values, values_of
from eomgen.api.options import RunOptions
from eomgen.api.reporter import SILENT, Reporter
from eomgen.api.settings import check_unstable, setting_of
from eomgen.api.states import values_by_index
from eomgen.base.errors import RunError, nearest
from eomgen.base.frozen import FrozenDict
from eomgen.model.elaborate import available_in, in_order, outputs_for
from eomgen.model.model import Model
from eomgen.run.inputs import InputsOfTime
from eomgen.run.sampling import Function
from eomgen.scene.schema import SHOWN, LoopsKept, Scene
from eomgen.tables.integrators import INTEGRATORS
from eomgen.tables.outputs import GROUPS, SAVED

if TYPE_CHECKING:
    from eomgen.study.accuracy.trial import Setting


@dataclass(frozen=True)
class Plan:
    """Checked options of a run.

    scene       its settings and appearance are used
    model       with the outputs that the run and its pictures need
    setting     method and tolerances or step; None if `accuracy` or `budget` choose them
    t_end       end time, s
    parameters  values that are not the scene's own
    inputs      constant inputs that are not their defaults
    options     all options, as they were given
    outputs     those that the caller named
    state       values of the initial state, by index in [q, v, x]
    varying     all inputs, if some of them are tables or functions of time
    functions   controllers that are functions of Python, by name
    """

    scene: Scene
    model: Model
    setting: "Setting | None"
    t_end: float
    parameters: Mapping[str, float]
    inputs: Mapping[str, float]
    options: RunOptions
    outputs: Sequence[str] = ()
    state: Mapping[int, float] = field(default_factory=dict)
    varying: InputsOfTime | None = None
    functions: Mapping[str, Function] = field(default_factory=dict)

    @property
    def works(self) -> bool:
        """Whether the works of effects are computed."""
        return self.options.works or "works" in self.options.save


def plan_run(
    scene: Scene,
    model: Model,
    options: RunOptions,
    *,
    constants: Values | None = None,
    varying: InputsOfTime | None = None,
    functions: Mapping[str, Function] = FrozenDict({}),
    outputs: Sequence[str] = (),
    reporter: Reporter = SILENT,
) -> Plan:
    """Check the options of `simulate` for a scene's model. Raises `RunError`.

    Of inputs `constants` are constant; `varying` are all of them if some are not, see
    `inputs.applied`. `outputs` must be in the module. Controllers that are `functions` are not
    repeated by trials and second runs.
    """
    bounds = {"rtol": options.rtol, "atol": options.atol, "dt": options.dt}
    aims = [name for name in ("accuracy", "budget") if getattr(options, name) is not None]
    _check_aims(aims, bounds, options.resume, reporter)
    if not model.states:  # all is given by the time, and no step makes an error
        options, aims = replace(options, accuracy=None, budget=None), []
    parameters, inputs = values_of(model, options.parameters, constants, reporter)
    setting = None
    if not aims:
        setting = setting_of(scene.simulation, options.integrator, **bounds, reporter=reporter)
    if varying is not None:
        _check_varying(options, aims, setting, reporter)
    if functions and (aims or options.estimate):
        raise RunError(
            f"{reporter.argument('controllers')}: functions of Python do not go together with a "
            "choice of method or an estimate; give formulas, or leave the other option out"
        )
    if options.unstable:
        check_unstable(setting, reporter)
    plan = Plan(
        scene,
        model,
        setting,
        scene.simulation.t_end if options.t_end is None else options.t_end,
        parameters,
        inputs,
        options,
        outputs,
        values_by_index(model, options.state, reporter),
        varying,
        functions,
    )
    saved = wanted_outputs(options.save, model, reporter)
    more = (*(("effect_powers",) if plan.works else ()), *_of_method(setting, model))
    needed = in_order((*model.outputs, *SHOWN, *saved, *more))
    return replace(
        plan, model=replace(model, outputs=needed, loops_kept=_loops_kept(setting, model))
    )


def _check_varying(
    options: RunOptions, aims: Sequence[str], setting: "Setting | None", reporter: Reporter
) -> None:
    """Raise `RunError` for what does not go together with tables and functions of time."""
    argument = reporter.argument("inputs")
    others = (options.estimate, options.guard, options.resume, options.backend == "c")
    if aims or any(others):
        raise RunError(
            f"{argument}: tables and functions of time do not go together with a choice of "
            "method, an estimate, a guard, an earlier run or compiled code; give a formula of t, "
            "or leave the other option out"
        )
    if setting and _takes_series(setting.integrator):
        raise RunError(
            f"{argument}: Taylor series need constant inputs or formulas of t; take --integrator "
            "DOP853 for tables and functions of time"
        )


def wanted_outputs(
    names: Sequence[str], model: Model, reporter: Reporter = SILENT
) -> tuple[str, ...]:
    """The outputs that are needed to save what is named.

    Raises `RunError` for an unknown name, or `SceneError` for one that the model lacks.
    """
    argument = reporter.argument("save")
    found: list[str] = []
    for name in names:
        if name not in GROUPS and name not in SAVED:
            known = (*GROUPS, *SAVED)
            hint = nearest(name, known) or f"; known: {', '.join(known)}"
            raise RunError(f"{argument}: no '{name}' can be saved{hint}")
        found += GROUPS.get(name, (name,))
    return outputs_for(found, argument, available_in(model))


def _check_aims(
    aims: Sequence[str],
    bounds: Mapping[str, float | None],
    resume: object,
    reporter: Reporter,
) -> None:
    """Raise `RunError` for two aims, or for an aim with a tolerance, a step or an earlier run."""
    if len(aims) > 1:
        both = ", ".join(map(reporter.argument, aims))
        raise RunError(f"{both}: a run has only one aim; give one of them")
    for aim in map(reporter.argument, aims):
        for name, value in bounds.items():
            if value is not None:
                option = reporter.argument(name)
                raise RunError(f"{aim}, {option}: {aim} chooses {name} itself; leave one out")
    if aims and resume is not None:
        raise RunError(
            f"{reporter.argument('resume')}: continues with a given method; leave out "
            f"{reporter.argument('accuracy')} and {reporter.argument('budget')}"
        )


def _loops_kept(setting: "Setting | None", model: Model) -> LoopsKept:
    """How loops are closed: with all coordinates as states where a method needs them."""
    return "projected" if _is_rattle(setting) and model.loops_kept == "auto" else model.loops_kept


def _is_rattle(setting: "Setting | None") -> bool:
    return setting is not None and INTEGRATORS[setting.integrator].rattle


def _of_method(setting: "Setting | None", model: Model) -> tuple[str, ...]:
    """The outputs that a method needs."""
    if setting is not None and (own := INTEGRATORS[setting.integrator].outputs):
        return own
    if _is_rattle(setting) and model.constraints:
        return ("mass_matrix", "kinetic_slopes")
    return ()


def _takes_series(integrator: str) -> bool:
    """Whether a method makes its steps by Taylor series."""
    from eomgen.run.integrators import Adaptive, find_integrator

    method = find_integrator(integrator)
    return isinstance(method, Adaptive) and bool(method.series)
