"""A generated module verified: against an independent solver and against 60 digits.

What is asked, and why the bounds are what they are:

- Forward error of v̇, of the route taken: at most `BOUND` ulps, 1e-13, at states where bodies are
  anywhere, and `IN_LINE`, 1e-10, where they are in line or nearly so, and lengths cancel; or
  `AMPLIFIED` times what one ulp in the data does to v̇, whichever is more. An algorithm that is
  stable gives the answer to data that are a few ulps off; where even that changes the answer,
  nothing that works in doubles can do better. What it may not do is to lose digits that the data
  have. `--bound` asks for a number of ulps outright.
- The other routes are compared, and are not what is generated: they may in addition lose what any
  solution with the mass matrix may lose, a few ulps times its condition number (Higham, Accuracy
  and Stability of Numerical Algorithms, theorem 10.3 and section 9). What they lose is told.
- Residual M v̇ + h - F, all outputs, inverse dynamics at the true v̇: the same bounds as the forward
  error, in ulps of the sum of the sizes of their terms.
- The mass matrix is positive definite: every pivot of it, scaled to a diagonal of ones, is > 0.
- Laws: kinetic energy changes by the power of all loads, momentum by those from outside, and the
  Jacobian is the slope of the independent solver, which may be off by the square root of 1/ulp.
- Articulated bodies and virtual work, both in 60 digits, agree to `AGREED` digits at least. Fixed
  rotations and axes that are no quarter turns are rounded to doubles in one and not in the other.
- A short run keeps what exact motion keeps, to `RUN` times its tolerance for every step.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from eomgen.build import in_order
from eomgen.derivation.recursive.regular import check_regular
from eomgen.errors import RunError
from eomgen.model import Model
from eomgen.run.module import GeneratedModule, as_problem, load_module
from eomgen.run.problem import Floats
from eomgen.run.progress import Progress
from eomgen.scene.schema import Route
from eomgen.store import generated_code
from eomgen.study.drift import RTOL, Drift, drift
from eomgen.study.hard_states import State, hard_states
from eomgen.study.judging import Judged, judged
from eomgen.study.laws import (
    Broken,
    broken,
    why_no_energy_law,
    why_no_momentum_law,
)
from eomgen.study.routes import compiled
from eomgen.study.truth import Truth
from eomgen.study.ulps import group_scales
from eomgen.study.visited import visited

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
BOUND, IN_LINE, AMPLIFIED = 450.0, 450e3, 10.0
"""Ulps: 1e-13 and 1e-10; and times what one ulp in the data does."""
ANYWHERE = ("fast", "still", "random", "own run")
"""Kinds of states where bodies are in line by chance alone."""
SOLVING = 10.0
"""Ulps times the condition number and the number of velocities, of a solution with M."""
SLOPES = 1e-8 * 2.0**52
"""Ulps that the Jacobian may be off."""
AGREED = 14.0
"""Digits."""
RUN, BOOKS = 100.0, 1e-6
UNIT = 1e-12
"""What a quaternion may be off unit length."""
STATES, FEW_STATES, LARGE = 8, 2, 12
"""How many of a kind, unless told; few where there are more velocities than `LARGE`."""
OWN = "own run"


@dataclass(frozen=True)
class Check:
    """A line of the report: `value` is to be at most `bound`, if there is one, or `above` it.

    words  what else there is to say
    at     label of the state it comes from
    """

    what: str
    value: float
    bound: float | None
    unit: str
    words: str = ""
    at: str = ""
    above: bool = False

    @property
    def missed(self) -> bool:
        """Whether the bound is missed; what is not a number misses it."""
        if self.bound is None:
            return False
        return not (self.value > self.bound if self.above else self.value <= self.bound)


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
        allowed = _allowed(self.judged, self.data)
        return [route for route, errors in self.ulps.items() if np.all(errors <= allowed)]

    @property
    def missed(self) -> tuple[Check, ...]:
        """The checks that missed their bounds."""
        return tuple(check for check in self.checks if check.missed)


def verify(
    model: Model,
    *,
    states: int | None = None,
    seed: int = 0,
    bound: float | None = None,
    module: GeneratedModule | None = None,
    progress: Progress = lambda fraction: None,
) -> Verified:
    """Verify the module that a model is compiled to by its route.

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
    code = generated_code(model)
    taken = next(line.split()[0] for line in code.explanation if "<- taken" in line)
    module = module or load_module(code.module, model.name)
    progress(0.05)
    full = module
    if not all(hasattr(module, name) for name in OUTPUTS):
        more = replace(model, outputs=in_order(OUTPUTS))
        full = load_module(generated_code(more).module, model.name)
    progress(0.1)
    bare = replace(model, outputs=())
    others, missing = compiled(bare, but=taken)
    modules = {taken: module, **{route: made.module for route, made in others.items()}}
    modules = {route: modules[route] for route in get_args(Route) if route in modules}
    progress(0.2)
    count = states or (STATES if len(model.velocities) <= LARGE else FEW_STATES)
    truth = Truth(bare)
    asked = hard_states(module, len(model.velocities), count, seed, model.simulation.t_end)
    run = visited(model, module, count + 2, lambda part: progress(0.2 + 0.1 * part))
    unit = as_problem(module).unit  # within steps methods leave the sphere of unit quaternions
    asked += [
        State(OWN, k, float(t), unit(y), dict.fromkeys(module.INPUTS, 0.0))
        for k, (t, y) in enumerate(zip(run.t, run.y, strict=True))
    ]
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
    ran = drift(model, module, full, telling, lambda part: progress(0.88 + 0.12 * part))
    ulps = {route: _forward(there, route, bare) for route in modules}
    data = _in_ulps(np.array([one.data for one in there]), there, bare)
    checks = [
        *_forward_checks(there, ulps, data, taken, len(bare.velocities), bound),
        *_matrix_checks(there),
        *_loss_checks(there, taken),
        *_law_checks(bare, laws),
        *_drift_checks(ran),
    ]
    notes = [f"route {route} is not there: {why}" for route, why in missing.items()]
    if form != "velocity":
        notes.append(f"form '{form}' is verified as 'velocity'")
    notes += _notes(ran, bare)
    return Verified(
        model.name,
        taken,
        seed,
        module.STATES,
        tuple(module.UNITS[state] for state in module.STATES),
        tuple(there),
        tuple(checks),
        tuple(notes),
        len(found) - len(there),
        run.until,
        ulps,
        data,
    )


def _has(one: Judged, route: str) -> bool:
    """Whether a route gave a finite acceleration."""
    return bool(np.isfinite(one.off[route]).all())


def _forward(there: Sequence[Judged], route: str, model: Model) -> Floats:
    return _in_ulps(np.array([one.off[route] for one in there]), there, model)


def _in_ulps(off: Floats, there: Sequence[Judged], model: Model) -> Floats:
    """Differences (n, nv) from v̇ in ulps (see `ulps`), (n,); infinite where not finite."""
    true = np.array([one.vd for one in there]).T
    errors = np.zeros(len(there))
    for group, scale in group_scales(true, [c.unit for c in model.velocities]):
        apart = np.max(np.abs(off[:, group]), axis=1)
        with np.errstate(all="ignore"):
            parts = np.where(apart == 0.0, 0.0, apart / np.spacing(scale))
        errors = np.maximum(errors, np.where(np.isfinite(parts), parts, np.inf))
    return errors


def _forward_checks(
    there: Sequence[Judged],
    ulps: Mapping[str, Floats],
    data: Floats,
    taken: str,
    nv: int,
    bound: float | None,
) -> list[Check]:
    checks = []
    for route, errors in ulps.items():
        asked = _allowed(there, data)
        allowed = asked
        if bound is not None and route == taken:
            allowed = np.full_like(data, bound)
        if route != taken:
            condition = np.array([one.condition for one in there])
            allowed = np.maximum(allowed, SOLVING * nv * condition)
        k = _worst(errors, allowed)
        words = f"median {np.median(errors):.1f}"
        if route != taken and np.any(errors > asked):
            words += "; loses digits"
        what = f"forward error of v̇, {route}" + (" (taken)" if route == taken else "")
        checks.append(
            Check(what, float(errors[k]), float(allowed[k]), "ulp", words, there[k].state.label)
        )
    if len(ulps) > 1:
        spread = np.max(list(ulps.values()), axis=0)
        k = int(np.argmax(spread))
        checks.append(Check("routes apart", float(spread[k]), None, "ulp", at=there[k].state.label))
    k = int(np.argmax(data))
    checks.append(
        Check(
            "one ulp in the data",
            float(data[k]),
            None,
            "ulp",
            f"median {np.median(data):.1f}",
            there[k].state.label,
        )
    )
    return checks


def _allowed(there: Sequence[Judged], data: Floats) -> Floats:
    """What the forward error of the route taken may be at each state (n,), ulps."""
    least = np.array([BOUND if one.state.kind in ANYWHERE else IN_LINE for one in there])
    return np.asarray(np.maximum(least, AMPLIFIED * data))


def _worst(errors: Floats, allowed: Floats) -> int:
    """The state that misses by most, or if none misses the one with the greatest error."""
    with np.errstate(all="ignore"):
        share = np.where(errors == 0.0, 0.0, errors / allowed)
    return int(np.argmax(share if np.max(share) > 1 else errors))


def _matrix_checks(there: Sequence[Judged]) -> list[Check]:
    k = int(np.argmax([one.condition for one in there]))
    least = int(np.argmin([one.pivot for one in there]))
    agreed = int(np.argmin([one.agreed for one in there]))
    return [
        Check("condition of M, scaled", there[k].condition, None, "", at=there[k].state.label),
        Check(
            "smallest pivot of M, scaled",
            there[least].pivot,
            0.0,
            "",
            at=there[least].state.label,
            above=True,
        ),
        Check(
            "virtual work against articulated bodies",
            10.0 ** -there[agreed].agreed,
            10.0**-AGREED,
            "",
            "relative, in 60 digits",
            there[agreed].state.label,
        ),
    ]


def _loss_checks(there: Sequence[Judged], taken: str) -> list[Check]:
    checks = []
    for what in there[0].losses:
        if what.startswith("residual of ") and what != f"residual of {taken}":
            continue
        errors = np.array([one.losses[what].error for one in there])
        data = np.array([one.losses[what].data for one in there])
        allowed = np.maximum(BOUND, AMPLIFIED * data)
        k = _worst(errors, allowed)
        name = "residual M v̇ + h - F" if what.startswith("residual") else what
        words = f"median {np.median(errors):.1f}"
        checks.append(
            Check(name, float(errors[k]), float(allowed[k]), "ulp", words, there[k].state.label)
        )
    return checks


def _law_checks(model: Model, laws: Sequence[Broken]) -> list[Check]:
    checks = []
    pick: dict[str, tuple[Callable[[Broken], float | None], float]] = {
        "energy law: rate = power of loads": (lambda law: law.energy, BOUND),
        "momentum law: rate = loads from outside": (lambda law: law.momentum, BOUND),
        "jacobian": (lambda law: law.slopes, SLOPES),
    }
    for what, (of, bound) in pick.items():
        values = [(value, law) for law in laws if (value := of(law)) is not None]
        if values:
            # What is not a number is the worst.
            value, law = max(values, key=lambda pair: (pair[0] != pair[0], pair[0]))
            checks.append(Check(what, value, bound, "ulp", at=law.state.label))
    return checks


def _drift_checks(ran: Drift) -> list[Check]:
    bound = RUN * RTOL * max(1, ran.steps)
    checks = [
        Check(f"drift of {name}", lost, bound, "", f"{ran.steps} steps, {ran.until:g} s")
        for name, lost in ran.lost.items()
    ]
    if ran.books is not None:
        checks.append(
            Check("energy less works of effects", ran.books, BOOKS, "", "in the short run")
        )
    if ran.unit:
        checks.append(Check("quaternions off unit length", ran.unit, UNIT, "", "in the short run"))
    return checks


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
