"""A generated module verified: against an independent solver and against 60 digits.

What is asked of it is in `study.bounds`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from eomgen.dynamics.regular import check_regular
from eomgen.errors import RunError
from eomgen.model.elaborate import in_order
from eomgen.model.model import Model
from eomgen.routes import ROUTES
from eomgen.run.module import GeneratedModule, as_problem, load_module
from eomgen.run.problem import Floats
from eomgen.run.progress import Progress
from eomgen.scene.schema import Simulation
from eomgen.store import generated_code
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
)
from eomgen.study.verification.drift import Drift, drift
from eomgen.study.verification.hard_states import State, hard_states
from eomgen.study.verification.judging import Judged, judged
from eomgen.study.verification.laws import broken, why_no_energy_law, why_no_momentum_law
from eomgen.study.verification.routes import compiled
from eomgen.study.verification.truth import Truth
from eomgen.study.verification.visited import Visited, visited

OUTPUTS = (
    "inverse_dynamics",
    "mass_matrix",
    "bias_force",
    "applied_force",
    "kinetic_energy",
    "potential_energy",
    "effect_powers",
    "momentum",
    "body_poses",
)
"""What is generated and verified beside derivative and Jacobian."""
STATES, FEW_STATES, LARGE = 8, 2, 12
"""How many of a kind, unless told; few where there are more velocities than `LARGE`."""


@dataclass(frozen=True)
class Verified:
    """What was found of a module.

    left_out  how many states had no finite acceleration in 60 digits
    until     how far the scene's own run was followed, s
    ulps      forward error of v̇ of each route at each state, and
    data      what one ulp in the data does to v̇ there
    """

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
    ulps: Mapping[str, Floats]
    data: Floats

    @property
    def better(self) -> list[str]:
        """The routes whose forward error is within what is asked of the one taken."""
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

    wanted  how the scene is to be run: some states are those of such a run
    states  how many seeded states of each kind (8, 2 if there are many velocities)
    bound   what the forward error may be at most, ulps, whatever the data do
    module  another one to verify in its place

    What of `OUTPUTS` the scene does not ask for is verified of a second module that has them.
    A model of momentum form is verified in its velocity form. Inputs are random at seeded states,
    0 in runs; no rigid contact is held.

    Raises `SceneError` or `RunError` if there is none, or no state has an acceleration.
    """
    form, model = model.form, replace(model, form="velocity")
    check_regular(model)
    taken, modules, full, missing = _modules(model, module, progress)
    module = modules[taken]
    bare = replace(model, outputs=())
    truth, count = Truth(bare), states or (STATES if len(model.velocities) <= LARGE else FEW_STATES)
    asked = hard_states(module, len(model.velocities), count, seed, wanted.t_end)
    run = visited(model, wanted, module, count + 2, lambda part: progress(0.2 + 0.1 * part))
    asked += _states(run, module)
    found = []
    for k, state in enumerate(asked):
        found.append(judged(bare, truth, taken, modules, full, state))
        progress(0.3 + 0.5 * (k + 1) / len(asked))
    there = [one for one in found if one is not None]
    if not there:
        raise RunError("no finite acceleration in 60 digits at any state; change the scene")
    firsts = [one for one in there if one.state.number == 0]
    laws = [broken(bare, module, one.state) for one in firsts if _has(one, taken)]
    progress(0.85)
    # What acts for a while only, as a contact does, is met by the run alone.
    telling = [one.state for one in firsts if one.state.kind in ("random", "still")]
    telling += [one.state for one in there if one.state.kind == OWN]
    ran = drift(model, wanted, module, full, telling, lambda part: progress(0.88 + 0.12 * part))
    ulps = {route: forward_ulps(there, route, bare) for route in modules}
    data = in_ulps(np.array([one.data for one in there]), there, bare)
    checks = (
        *forward_checks(there, ulps, data, taken, len(bare.velocities), bound),
        *matrix_checks(there),
        *loss_checks(there, taken),
        *law_checks(bare, laws),
        *drift_checks(ran),
    )
    notes = [f"route {route} is not there: {why}" for route, why in missing.items()]
    if form != "velocity":
        notes.append(f"form '{form}' is verified as 'velocity'")
    return Verified(
        name=model.name,
        taken=taken,
        seed=seed,
        states=module.STATES,
        units=tuple(module.UNITS[state] for state in module.STATES),
        judged=tuple(there),
        checks=checks,
        notes=(*notes, *_notes(ran, bare)),
        left_out=len(found) - len(there),
        until=run.until,
        ulps=ulps,
        data=data,
    )


def _modules(
    model: Model, module: GeneratedModule | None, progress: Progress
) -> tuple[str, dict[str, GeneratedModule], GeneratedModule, dict[str, str]]:
    """The route taken; the modules by route, `module` in its place if there is one; one of that
    route that has all of `OUTPUTS`; and why routes are missing.
    """
    code = generated_code(model)
    taken = next(line.split()[0] for line in code.explanation if "<- taken" in line)
    module = module or load_module(code.module, model.name)
    progress(0.05)
    full = module
    if not all(hasattr(module, name) for name in OUTPUTS):
        more = replace(model, outputs=in_order(OUTPUTS))
        full = load_module(generated_code(more).module, model.name)
    progress(0.1)
    others, missing = compiled(replace(model, outputs=()), but=taken)
    modules = {taken: module, **{route: made.module for route, made in others.items()}}
    progress(0.2)
    return taken, {r: modules[r] for r in ROUTES if r in modules}, full, missing


def _states(run: Visited, module: GeneratedModule) -> list[State]:
    """The states that the scene's own run visits."""
    unit = as_problem(module).unit  # within steps methods leave the sphere of unit quaternions
    inputs = dict.fromkeys(module.INPUTS, 0.0)
    return [
        State(OWN, k, float(t), unit(y), inputs)
        for k, (t, y) in enumerate(zip(run.t, run.y, strict=True))
    ]


def _has(one: Judged, route: str) -> bool:
    """Whether a route gave a finite acceleration."""
    return bool(np.isfinite(one.off[route]).all())


def _notes(ran: Drift, model: Model) -> list[str]:
    notes, keeps = [], ran.keeps
    if keeps.takers:
        notes.append(f"energy is not kept: {', '.join(keeps.takers)} give or take it")
    if why := why_no_energy_law(model):
        notes.append(f"no energy law: {why}")
    if why := why_no_momentum_law(model):
        notes.append(f"no momentum law: {why}")
    parts = ", ".join(keeps.momentum) or "no component"
    notes.append(f"exact motion keeps of momentum: {parts}")
    if any(getattr(effect, "law", "") == "impact" for effect in model.effects):
        notes.append("no rigid contact is held, and what they take is not asked for")
    if ran.stopped:
        notes.append(f"the short run {ran.stopped}")
    return notes
