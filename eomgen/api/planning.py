"""Checked arguments of a simulation: `plan_run`, which `simulate` calls."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from typing import TYPE_CHECKING, Literal

from eomgen.api.given import Values, values_of
from eomgen.api.reporter import SILENT, Reporter
from eomgen.api.settings import check_unstable, setting_of
from eomgen.api.states import values_by_index
from eomgen.base.errors import RunError, nearest
from eomgen.model.elaborate import available_in, in_order, outputs_for
from eomgen.model.model import Model
from eomgen.results import Run
from eomgen.run.inputs import InputsOfTime
from eomgen.scene.schema import SHOWN, Closing, Scene
from eomgen.study.recording import GROUPS, SAVED
from eomgen.tables.integrators import INTEGRATORS

if TYPE_CHECKING:
    from eomgen.study.accuracy.trial import Setting

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
    state    values of the initial state, by index in [q, v, x]
    varying  all inputs, if some of them are tables or functions of time

    The other fields are arguments of `simulate`.
    """

    scene: Scene
    model: Model
    setting: "Setting | None"
    t_end: float
    parameters: Mapping[str, float]
    inputs: Mapping[str, float]
    outputs: Sequence[str] = ()
    state: Mapping[int, float] = field(default_factory=dict)
    varying: InputsOfTime | None = None
    accuracy: float | None = None
    budget: float | None = None
    integrator: str | None = None
    samples: int = 1001
    max_step: float | None = None
    works: bool = False
    save: Sequence[str] = ()
    guard: GuardMode | None = None
    unstable: bool = False
    estimate: bool = False
    resume: EarlierRun | None = None
    backend: Backend = "auto"


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
    state: Values | None = None,
    inputs: Values | None = None,
    varying: InputsOfTime | None = None,
    samples: int = 1001,
    max_step: float | None = None,
    works: bool = False,
    save: Sequence[str] = (),
    guard: GuardMode | None = None,
    unstable: bool = False,
    estimate: bool = False,
    resume: EarlierRun | None = None,
    backend: Backend = "auto",
    reporter: Reporter = SILENT,
) -> Plan:
    """Check the arguments of `simulate`, which describes them, for a scene's model.

    `inputs` are constants; `varying` are all of them if some are not, see `inputs.applied`.
    `outputs` must be in the module. Raises `RunError` for an invalid argument.
    """
    bounds = {"rtol": rtol, "atol": atol, "dt": dt}
    aims = [n for n, x in (("accuracy", accuracy), ("budget", budget)) if x is not None]
    _check_aims(aims, bounds, resume, reporter)
    if not model.states:  # all is given by the time, and no step makes an error
        accuracy, budget, aims = None, None, []
    parameters, inputs = values_of(model, parameters, inputs, reporter)
    if guard not in (None, "stop", "repair"):
        raise RunError(f"{reporter.argument('guard')}: '{guard}' is not one of stop, repair")
    if backend not in ("auto", "numpy", "c"):
        raise RunError(f"{reporter.argument('backend')}: '{backend}' is not one of auto, numpy, c")
    if varying is not None and (
        aims or estimate or guard is not None or resume is not None or backend == "c"
    ):
        raise RunError(
            f"{reporter.argument('inputs')}: tables and functions of time do not go together with "
            "a choice of method, an estimate, a guard, an earlier run or compiled code; give a "
            "formula of t, or leave the other option out"
        )
    setting = None
    if not aims:
        setting = setting_of(scene.simulation, integrator, **bounds, reporter=reporter)
    if varying is not None and setting and _takes_series(setting.integrator):
        raise RunError(
            f"{reporter.argument('inputs')}: Taylor series need constant inputs or formulas of t; "
            "take --integrator DOP853 for tables and functions of time"
        )
    if unstable:
        check_unstable(setting, reporter)
    works = works or "works" in save
    saved = wanted_outputs(save, model, reporter)
    more = (*(("effect_powers",) if works else ()), *_of_method(setting, model))
    needed = (*model.outputs, *SHOWN, *saved, *more)
    return Plan(
        scene,
        replace(model, outputs=in_order(needed), closing=_closing(setting, model)),
        setting,
        scene.simulation.t_end if t_end is None else t_end,
        parameters,
        inputs,
        outputs,
        values_by_index(model, state, reporter),
        varying,
        accuracy=accuracy,
        budget=budget,
        integrator=integrator,
        samples=samples,
        max_step=max_step,
        works=works,
        save=save,
        guard=guard,
        unstable=unstable,
        estimate=estimate,
        resume=resume,
        backend=backend,
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
    resume: EarlierRun | None,
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


def _closing(setting: "Setting | None", model: Model) -> Closing:
    """How loops are closed: with all coordinates as states where a method needs them."""
    return "projected" if _is_rattle(setting) and model.closing == "auto" else model.closing


def _is_rattle(setting: "Setting | None") -> bool:
    return setting is not None and INTEGRATORS[setting.integrator].rattle


def _of_method(setting: "Setting | None", model: Model) -> tuple[str, ...]:
    """The outputs that a method needs."""
    if _is_rattle(setting) and model.constraints:
        return ("mass_matrix", "kinetic_slopes")
    return ()


def _takes_series(integrator: str) -> bool:
    """Whether a method makes its steps by Taylor series."""
    from eomgen.run.integrators import Adaptive, find_integrator

    method = find_integrator(integrator)
    return isinstance(method, Adaptive) and bool(method.series)
