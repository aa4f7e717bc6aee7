"""The bounds of the verification, and the reasons for them.

- Forward error of v̇, of the route taken: at most `BOUND` ulps, 1e-13, at general states, and
  `IN_LINE`, 1e-10, at states where bodies are in line or nearly so and lengths cancel; or, if that
  is more, `AMPLIFIED` times the change of v̇ when the data change by one ulp. A backward stable
  algorithm gives the exact result for data that are a few ulps off; no algorithm in doubles can do
  better. It must not lose digits that the data have. `--bound` sets a number of ulps instead.
- The other routes are compared, though they are not generated. In addition they may lose what any
  solution with the mass matrix may lose, a few ulps times its condition number (Higham, Accuracy
  and Stability of Numerical Algorithms, theorem 10.3 and section 9). The report says so.
- Residual M v̇ + h - F, all outputs, inverse dynamics beside the true v̇: the bounds of the forward
  error, in ulps of the sum of the sizes of their terms.
- Each component of an output, each row of the Jacobian along a direction, and each of its entries
  in the rows of v̇ where they can be had (see `slopes`), is off by at most `PART` times what
  rounding makes of it in the module's own operations (see `roundings`). This finds small faults in
  components and terms that are small beside others; whether the operations lose more than the data
  is for the bounds above.
- The mass matrix is positive definite: all its pivots, scaled to a diagonal of ones, are > 0.
- Laws: kinetic energy changes by the power of all loads, and momentum by the external loads. The
  Jacobian is compared with differences of the independent solver, with a bound of the square root
  of the precision.
- Articulated bodies and virtual work, both in 60 digits, agree to at least `AGREED` digits. One of
  them rounds fixed rotations and oblique axes to doubles, the other does not.
- A short run conserves what exact motion conserves, to `RUN` times its tolerance for each step.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from eomgen.model.model import Model
from eomgen.run.problem import FloatArray
from eomgen.study.verification.drift import RTOL, Drift
from eomgen.study.verification.judging import Judged
from eomgen.study.verification.laws import Broken
from eomgen.study.verification.ulps import group_scales

T = TypeVar("T")
BOUND, IN_LINE, AMPLIFIED = 450.0, 450e3, 10.0
"""Ulps: 1e-13 and 1e-10; and a factor of the change by one ulp in the data."""
OWN = "scene's run"
"""The kind of states sampled from the scene's run."""
ANYWHERE = ("fast", "still", "random", OWN)
"""Kinds of states where bodies are in line only by chance."""
SOLVING = 10.0
"""Ulps, times condition number and number of velocities, allowed in a solution with M."""
SLOPES = 1e-8 * 2.0**52
"""Error allowed in the Jacobian, ulps."""
PART = 5.0
"""Error allowed in a component, in units of its spread in random arithmetic."""
SPREADS = "in spreads by rounding"
AGREED = 14.0
"""Digits to which the two solutions in 60 digits must agree."""
RUN, BOOKS = 100.0, 1e-6
UNIT = 1e-12
"""Difference allowed between a quaternion's length and 1."""


@dataclass(frozen=True)
class Check:
    """A line of the report: `value` must be at most `bound`, or above it if `above`.

    bound  None if nothing is required
    words  further remarks
    at     label of the state with this value
    taken  whether it is an error of the route taken
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
        """Whether the bound is missed; nan misses any bound."""
        if self.bound is None:
            return False
        return not (self.value > self.bound if self.above else self.value <= self.bound)


def forward_ulps(there: Sequence[Judged], route: str, model: Model) -> FloatArray:
    """Forward error of v̇ of a route at each state, (n,), ulps; infinite if v̇ is not finite."""
    return in_ulps(np.array([one.errors[route] for one in there]), there, model)


def in_ulps(deviations: FloatArray, there: Sequence[Judged], model: Model) -> FloatArray:
    """The deviations (n, nv) of v̇ in ulps (see `ulps`), (n,); infinite if one is not finite. A
    group counts at least what its terms would give: in free fall, a hinge has no acceleration.
    """
    true = np.array([one.vd for one in there]).T
    terms = np.array([one.terms for one in there])
    errors = np.zeros(len(there))
    for group, scale in group_scales(true, [c.unit for c in model.velocities]):
        scale = np.maximum(scale, np.max(terms[:, group], axis=1))
        apart = np.max(np.abs(deviations[:, group]), axis=1)
        with np.errstate(all="ignore"):
            parts = np.where(apart == 0.0, 0.0, apart / np.spacing(scale))
        errors = np.maximum(errors, np.where(np.isfinite(parts), parts, np.inf))
    return errors


def forward_checks(
    there: Sequence[Judged],
    ulps: Mapping[str, FloatArray],
    data: FloatArray,
    taken: str,
    nv: int,
    bound: float | None,
) -> list[Check]:
    """Forward error of v̇ of each route, the greatest of all, and the change by one ulp in the data.

    ulps   errors by route
    data   change of v̇ by one ulp in the data at each state, (n,), ulps
    nv     number of velocities
    bound  for the route taken, instead of the one that the data give
    """
    checks, asked = [], allowed_ulps(there, data)
    condition = np.array([one.condition for one in there])
    for route, errors in ulps.items():
        what, words = f"forward error of v̇, {route}", ""
        if route == taken:
            what += " (taken)"
            allowed = asked if bound is None else np.full_like(data, bound)
        else:
            words = "; loses digits" if np.any(errors > asked) else ""
            allowed = np.maximum(asked, SOLVING * nv * condition)
        found = _worst_state(what, there, errors, allowed)
        checks.append(replace(found, words=found.words + words, taken=route == taken))
    if len(ulps) > 1:
        spread = _worst_state("routes apart", there, np.max(list(ulps.values()), axis=0))
        checks.append(replace(spread, words=""))
    return [*checks, _worst_state("one ulp in the data", there, data)]


def _worst_state(
    what: str, there: Sequence[Judged], errors: FloatArray, allowed: FloatArray | None = None
) -> Check:
    """The state that exceeds its bound by most or, if none does, has the greatest error, ulps."""
    k, bound = int(np.argmax(errors)), None
    if allowed is not None:
        with np.errstate(all="ignore"):
            share = np.where(errors == 0.0, 0.0, errors / allowed)
        k = int(np.argmax(share if np.max(share) > 1 else errors))
        bound = float(allowed[k])
    words = f"median {np.median(errors):.1f}"
    return Check(what, float(errors[k]), bound, "ulp", words, there[k].state.label)


def allowed_ulps(there: Sequence[Judged], data: FloatArray) -> FloatArray:
    """Forward error allowed for the route taken at each state, (n,), ulps."""
    least = np.array([BOUND if one.state.kind in ANYWHERE else IN_LINE for one in there])
    return np.asarray(np.maximum(least, AMPLIFIED * data))


def _greatest(found: Iterable[T], value: Callable[[T], float]) -> T:
    """The one with the greatest value; nan counts as the greatest."""
    return max(found, key=lambda one: ((x := value(one)) != x, x))


def matrix_checks(there: Sequence[Judged]) -> list[Check]:
    """Condition and pivots of M, and the agreement of the two solutions in 60 digits."""
    one = _greatest(there, lambda one: one.condition)
    least = _greatest(there, lambda one: -one.pivot)
    other, agree = (
        _greatest(there, lambda one: -one.agreed),
        "virtual work against articulated bodies",
    )
    remark = "relative, in 60 digits"
    return [
        Check("condition of M, scaled", one.condition, None, "", "", one.state.label),
        Check(
            "smallest pivot of M, scaled", least.pivot, 0.0, "", "", least.state.label, above=True
        ),
        Check(agree, 10.0**-other.agreed, 10.0**-AGREED, "", remark, other.state.label),
    ]


def loss_checks(there: Sequence[Judged], taken: str) -> list[Check]:
    """The errors of everything else that the module of the route taken computes."""
    losses = {"residual M v̇ + h - F": [one.residuals[taken] for one in there]}
    losses |= {what: [one.losses[what] for one in there] for what in there[0].losses}
    checks = []
    for what, lost in losses.items():
        errors, data = np.array([(loss.error, loss.data) for loss in lost]).T
        checks.append(_worst_state(what, there, errors, np.maximum(BOUND, AMPLIFIED * data)))
    return checks


def part_checks(there: Sequence[Judged]) -> list[Check]:
    """The component of an output that is off by most in units of what rounding makes of it."""
    found = [(*part, name, one) for one in there for name, part in one.parts.items()]
    value, index, name, one = _greatest(found, lambda part: part[0])
    words = f"{SPREADS}; entry {index} of {name}"
    return [Check("each component", value, PART, "", words, one.state.label)]


def law_checks(model: Model, laws: Sequence[Broken]) -> list[Check]:
    """Laws of motion and the Jacobian, at the states where they were checked."""
    checks = []
    pick: dict[str, tuple[Callable[[Broken], float | None], float]] = {
        "energy law: rate = power of loads": (lambda law: law.energy, BOUND),
        "momentum law: rate = loads from outside": (lambda law: law.momentum, BOUND),
        "jacobian": (lambda law: law.slopes, SLOPES),
        "jacobian, each row": (lambda law: law.rows, PART),
    }
    for what, (of, bound) in pick.items():
        values = [(value, law) for law in laws if (value := of(law)) is not None]
        if values:
            value, law = _greatest(values, lambda pair: pair[0])
            unit, words = ("", SPREADS) if bound == PART else ("ulp", "")
            checks.append(Check(what, value, bound, unit, words, law.state.label))
    return checks


def slope_checks(slopes: Mapping[str, float | None]) -> list[Check]:
    """The Jacobian's worst entry, of those at some states, by their labels."""
    found = [(value, label) for label, value in slopes.items() if value is not None]
    if not found:
        return []
    value, label = _greatest(found, lambda pair: pair[0])
    return [Check("jacobian, each entry", value, PART, "", SPREADS, label)]


def drift_checks(ran: Drift) -> list[Check]:
    """The drift of conserved quantities in the short run."""
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
