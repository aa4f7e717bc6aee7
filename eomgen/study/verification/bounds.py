"""What a generated module is held to, and why the bounds are what they are.

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
from dataclasses import dataclass

import numpy as np

from eomgen.model.model import Model
from eomgen.run.problem import Floats
from eomgen.study.verification.drift import RTOL, Drift
from eomgen.study.verification.judging import Judged
from eomgen.study.verification.laws import Broken
from eomgen.study.verification.ulps import group_scales

BOUND, IN_LINE, AMPLIFIED = 450.0, 450e3, 10.0
"""Ulps: 1e-13 and 1e-10; and times what one ulp in the data does."""
OWN = "own run"
"""The kind of states that the scene's own run visits."""
ANYWHERE = ("fast", "still", "random", OWN)
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


@dataclass(frozen=True)
class Check:
    """A line of the report: `value` is to be at most `bound`, if there is one, or `above` it.

    words  what else there is to say
    at     label of the state it comes from
    taken  whether it is how exact the route taken is
    """

    what: str
    value: float
    bound: float | None
    unit: str
    words: str = ""
    at: str = ""
    above: bool = False
    taken: bool = False

    @property
    def missed(self) -> bool:
        """Whether the bound is missed; what is not a number misses it."""
        if self.bound is None:
            return False
        return not (self.value > self.bound if self.above else self.value <= self.bound)


def forward_ulps(there: Sequence[Judged], route: str, model: Model) -> Floats:
    """Forward error of v̇ of a route at each state (n,), ulps; infinite where not finite."""
    return in_ulps(np.array([one.off[route] for one in there]), there, model)


def in_ulps(off: Floats, there: Sequence[Judged], model: Model) -> Floats:
    """Differences (n, nv) from v̇ in ulps (see `ulps`), (n,); infinite where not finite."""
    true = np.array([one.vd for one in there]).T
    errors = np.zeros(len(there))
    for group, scale in group_scales(true, [c.unit for c in model.velocities]):
        apart = np.max(np.abs(off[:, group]), axis=1)
        with np.errstate(all="ignore"):
            parts = np.where(apart == 0.0, 0.0, apart / np.spacing(scale))
        errors = np.maximum(errors, np.where(np.isfinite(parts), parts, np.inf))
    return errors


def forward_checks(
    there: Sequence[Judged],
    ulps: Mapping[str, Floats],
    data: Floats,
    taken: str,
    nv: int,
    bound: float | None,
) -> list[Check]:
    """Forward error of v̇ of each route, what they are apart, and what one ulp in the data does.

    ulps   errors by route, and
    data   what one ulp in the data does, at each state (n,)
    nv     how many velocities there are
    bound  for the route taken, in the place of what the data allow
    """
    checks = []
    for route, errors in ulps.items():
        asked = allowed_ulps(there, data)
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
        label = there[k].state.label
        checks.append(
            Check(
                what,
                float(errors[k]),
                float(allowed[k]),
                "ulp",
                words,
                label,
                taken=route == taken,
            )
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


def allowed_ulps(there: Sequence[Judged], data: Floats) -> Floats:
    """What the forward error of the route taken may be at each state (n,), ulps."""
    least = np.array([BOUND if one.state.kind in ANYWHERE else IN_LINE for one in there])
    return np.asarray(np.maximum(least, AMPLIFIED * data))


def _worst(errors: Floats, allowed: Floats) -> int:
    """The state that misses by most, or if none misses the one with the greatest error."""
    with np.errstate(all="ignore"):
        share = np.where(errors == 0.0, 0.0, errors / allowed)
    return int(np.argmax(share if np.max(share) > 1 else errors))


def matrix_checks(there: Sequence[Judged]) -> list[Check]:
    """Condition and pivots of M, and the agreement of two ways to v̇ in 60 digits."""
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


def loss_checks(there: Sequence[Judged], taken: str) -> list[Check]:
    """Whatever else the module of the route taken computes."""
    checks = []
    losses = {"residual M v̇ + h - F": [one.residuals[taken] for one in there]}
    losses |= {what: [one.losses[what] for one in there] for what in there[0].losses}
    for what, lost in losses.items():
        errors = np.array([loss.error for loss in lost])
        data = np.array([loss.data for loss in lost])
        allowed = np.maximum(BOUND, AMPLIFIED * data)
        k = _worst(errors, allowed)
        words = f"median {np.median(errors):.1f}"
        checks.append(
            Check(what, float(errors[k]), float(allowed[k]), "ulp", words, there[k].state.label)
        )
    return checks


def law_checks(model: Model, laws: Sequence[Broken]) -> list[Check]:
    """Laws of motion and the Jacobian, at the states where they were asked."""
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


def drift_checks(ran: Drift) -> list[Check]:
    """What the short run did not keep."""
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
