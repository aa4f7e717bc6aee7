"""Verification of a generated module against an independent solver and 60 digits.

The bounds are in `study.verification.bounds`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from eomgen.base.displays import Displayed
from eomgen.base.errors import RunError
from eomgen.base.frozen import Frozen
from eomgen.dynamics.start.singularity import check_nonsingular
from eomgen.model.elaborate import in_order
from eomgen.model.model import Model
from eomgen.run.module import GeneratedModule, as_problem, load_module
from eomgen.run.problem import FloatArray
from eomgen.run.progress import Progress
from eomgen.scene.schema import Simulation
from eomgen.store import generated_code, interfaced_program_of
from eomgen.study.verification.bounds import (
    OWN,
    Check,
    allowed_ulps,
    drift_checks,
    forward_checks,
    forward_ulps,
    in_ulps,
    law_checks,
    loss_checks,
    matrix_checks,
    part_checks,
    slope_checks,
)
from eomgen.study.verification.drift import Drift, drift
from eomgen.study.verification.hard_states import State, constrained_states, hard_states
from eomgen.study.verification.judging import Judged, judged
from eomgen.study.verification.laws import broken, why_no_energy_law, why_no_momentum_law
from eomgen.study.verification.roundings import Roundings
from eomgen.study.verification.routes import compiled
from eomgen.study.verification.sampled import SampledRun, sampled
from eomgen.study.verification.slopes import worst_slope
from eomgen.study.verification.states import number_of_states
from eomgen.study.verification.truth import Truth
from eomgen.study.whole import viewed, whole_of
from eomgen.tables.routes import ROUTES

OUTPUTS = (
    "inverse_dynamics",
    "mass_matrix",
    "bias_force",
    "applied_force",
    "kinetic_energy",
    "potential_energy",
    "effect_powers",
    "effect_forces",
    "momentum",
    "body_poses",
)
"""What is generated and verified besides derivative and Jacobian."""
STATES, FEW_STATES = 8, 2
"""Default number of states of each kind; the smaller one for large models."""


@dataclass(frozen=True, repr=False)
class Verified(Frozen, Displayed):
    """The results of the verification of a module.

    left_out  number of states without a finite acceleration in 60 digits
    until     time up to which the scene's run was followed, s
    ulps      forward error of v̇ of each route at each state
    data      change of v̇ there by one ulp in the data, ulps
    stopped   how far an interrupt let it come; "" if it is complete
    """

    shown = ("taken", "judged", "better", "missed", "checks", "left_out", "stopped", "notes")

    name: str
    taken: str
    seed: int
    states: tuple[str, ...]
    units: tuple[str, ...]
    judged: tuple[Judged, ...]
    checks: tuple[Check, ...]
    notes: tuple[str, ...]
    left_out: int
    until: float
    ulps: Mapping[str, FloatArray]
    data: FloatArray
    stopped: str = ""

    @property
    def better(self) -> list[str]:
        """The routes whose forward error is within the bound of the route taken."""
        allowed = allowed_ulps(self.judged, self.data)
        return [route for route, errors in self.ulps.items() if np.all(errors <= allowed)]

    @property
    def missed(self) -> tuple[Check, ...]:
        """The checks that missed their bounds."""
        return tuple(check for check in self.checks if check.missed)


def verify(
    model: Model,
    wanted: Simulation,
    *,
    states: int | None = None,
    seed: int = 0,
    bound: float | None = None,
    module: GeneratedModule | None = None,
    progress: Progress = lambda fraction: None,
) -> Verified:
    """Verify the module that a model is compiled to by its route.

    wanted  how the scene is to be run, for states of its own run
    states  number of seeded states of each kind (8, or 2 for many velocities)
    bound   of the forward error, ulps, whatever the data allow
    module  another module to verify instead

    Outputs of `OUTPUTS` that the scene does not ask for are verified with a second module that has
    them. A model in momentum form is verified in its velocity form. Inputs are random at seeded
    states and 0 in runs; rigid contacts exert no force.

    Raises `SceneError` or `RunError` if there is no module, or no state has an acceleration.
    """
    form, model = model.form, replace(model, form="velocity")
    taken, modules, full, missing, roundings = _modules(model, module, progress)
    module, given = modules[taken], full
    modules = {route: viewed(each, model) for route, each in modules.items()}
    full, seen = viewed(full, model), modules[taken]
    bare = replace(model, outputs=())
    truth, count = Truth(bare), number_of_states(model, states, STATES, FEW_STATES)
    asked, run = _asked(model, module, wanted, count, seed, progress)
    judge = partial(judged, bare, truth, taken, modules, full, roundings)
    there, tried, stopped = _until_interrupted(
        judge, asked, lambda part: progress(0.3 + 0.5 * part)
    )
    lawful, ran = list[Check](), None
    if not stopped:
        lawful = _laws(there, taken, truth, seen, roundings)
        progress(0.85)
        shown = _of_conservation(there)
        ran = drift(model, wanted, module, given, shown, lambda x: progress(0.88 + 0.12 * x))
    ulps = {route: forward_ulps(there, route, bare) for route in modules}
    data = in_ulps(np.array([one.data for one in there]), there, bare)
    accurate = forward_checks(there, ulps, data, taken, len(bare.velocities), bound)
    others = (*matrix_checks(there), *loss_checks(there, taken), *part_checks(there))
    return Verified(
        name=model.name,
        taken=taken,
        seed=seed,
        states=seen.STATES,
        units=tuple(module.UNITS[state] for state in seen.STATES),
        judged=tuple(there),
        checks=(*accurate, *others, *lawful, *(drift_checks(ran) if ran else ())),
        notes=(*_remarks(missing, form), *(_notes(ran, bare) if ran else (stopped,))),
        left_out=tried - len(there),
        until=run.until,
        ulps=ulps,
        data=data,
        stopped=stopped,
    )


def _until_interrupted(
    judge: Callable[[State], Judged | None], asked: Sequence[State], progress: Progress
) -> tuple[list[Judged], int, str]:
    """What `judge` finds at the states, how many were judged, and a note if the user stopped it
    before the last of them.

    Raises `RunError` if no state has an acceleration.
    """
    found: list[Judged | None] = []
    stopped = ""
    try:
        for k, state in enumerate(asked):
            found.append(judge(state))
            progress((k + 1) / len(asked))
    except KeyboardInterrupt:
        if all(one is None for one in found):
            raise
        stopped = f"interrupted after {len(found)} of {len(asked)} states; no laws, no run"
    there = [one for one in found if one is not None]
    if not there:
        raise RunError("no finite acceleration in 60 digits at any state; change the scene")
    return there, len(found), stopped


def _asked(
    model: Model,
    module: GeneratedModule,
    wanted: Simulation,
    count: int,
    seed: int,
    progress: Progress,
) -> tuple[list[State], SampledRun]:
    """The seeded states, `count` of each kind, with those of the scene's run; and that run."""
    if model.constraints:
        asked = constrained_states(model, module, count, seed, wanted.t_end)
    else:
        asked = hard_states(module, len(model.velocities), count, seed, wanted.t_end)
    run = sampled(model, wanted, module, count + 2, lambda part: progress(0.2 + 0.1 * part))
    return asked + _states(run, module, model), run


def _remarks(missing: Mapping[str, str], form: str) -> list[str]:
    """What a user should know of how a model was verified."""
    notes = [f"route {route} is not available: {why}" for route, why in missing.items()]
    if form != "velocity":
        notes.append(f"form '{form}' is verified as 'velocity'")
    return notes


def _laws(
    there: Sequence[Judged],
    taken: str,
    truth: Truth,
    module: GeneratedModule,
    roundings: Roundings,
) -> list[Check]:
    """The checks of laws of mechanics, at the first state of each kind, and of Jacobians."""
    model, known = truth.model, [one.state for one in there if _has(one, taken)]
    laws = [broken(model, module, roundings, each) for each in known if each.number == 0]
    slopes = {each.label: worst_slope(model, truth, module, roundings, each) for each in known}
    return [*law_checks(model, laws), *slope_checks(slopes)]


def _of_conservation(there: Sequence[Judged]) -> list[State]:
    """The states at which what motion conserves is determined. Effects that act only for a time, as
    contacts do, are found by the run alone.
    """
    kinds = ("random", "still")
    found = [one.state for one in there if one.state.number == 0 and one.state.kind in kinds]
    return found + [one.state for one in there if one.state.kind == OWN]


def _modules(
    model: Model, module: GeneratedModule | None, progress: Progress
) -> tuple[str, dict[str, GeneratedModule], GeneratedModule, dict[str, str], Roundings]:
    """The route taken; the modules by route, with `module` for the route taken if given; a module
    of that route with all of `OUTPUTS`; why routes are missing; and the roundings of the programs
    of the route taken. Raises `SceneError` if the mass matrix is singular.
    """
    check_nonsingular(model)
    code = generated_code(model)
    taken = next(line.split()[0] for line in code.explanation if "<- taken" in line)
    module = module or load_module(code.module, model.name)
    progress(0.05)
    full, programs = module, [interfaced_program_of(model)]
    outputs = (*OUTPUTS, "constraint_forces") if model.constraints else OUTPUTS
    if not all(hasattr(module, name) for name in outputs):
        more = replace(model, outputs=in_order(outputs))
        full = load_module(generated_code(more).module, model.name)
        programs.append(interfaced_program_of(more))
    progress(0.1)
    others, missing = compiled(replace(model, outputs=()), but=taken)
    modules = {taken: module, **{route: made.module for route, made in others.items()}}
    progress(0.2)
    modules = {r: modules[r] for r in ROUTES if r in modules}
    return taken, modules, full, missing, Roundings(programs)


def _states(run: SampledRun, module: GeneratedModule, model: Model) -> list[State]:
    """The states sampled from the scene's run."""
    unit = as_problem(module).unit  # within a step, quaternions are not of unit length
    inputs = dict.fromkeys(module.INPUTS, 0.0)
    return [
        State(OWN, k, float(t), whole_of(module, model, float(t), unit(y)), inputs)
        for k, (t, y) in enumerate(zip(run.t, run.y, strict=True))
    ]


def _has(one: Judged, route: str) -> bool:
    """Whether a route gave a finite acceleration."""
    return bool(np.isfinite(one.errors[route]).all())


def _notes(ran: Drift, model: Model) -> list[str]:
    notes, keeps = [], ran.keeps
    if keeps.takers:
        notes.append(f"energy is not conserved: {', '.join(keeps.takers)} supply or dissipate it")
    if why := why_no_energy_law(model):
        notes.append(f"no energy law: {why}")
    if why := why_no_momentum_law(model):
        notes.append(f"no momentum law: {why}")
    parts = ", ".join(keeps.momentum) or "no component"
    notes.append(f"momentum that exact motion conserves: {parts}")
    if any(getattr(effect, "law", "") == "impact" for effect in model.effects):
        notes.append("rigid contacts exert no force here, and their impulses are not checked")
    if ran.stopped:
        notes.append(f"the short run {ran.stopped}")
    return notes
