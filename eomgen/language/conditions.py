"""Conditions on parameters, for the values of a scene, of `--set` and of a module's `p`."""

import math
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from eomgen.base.errors import SceneError
from eomgen.language.base import LARGEST
from eomgen.language.formula import (
    ZERO,
    Apply,
    Constant,
    Formula,
    Name,
    evaluate,
    names_in,
    written,
)
from eomgen.scalars.floats import FloatScalars

ROUNDING = 1e-9
"""Relative rounding error that is allowed in the numbers of a scene."""


PRINTED = 1e-3
"""The same of inertias printed with three digits."""


@dataclass(frozen=True)
class Condition:
    """A formula of parameters must be >= low (> low if `strict`) and <= high.

    location  of the value in the scene
    words     message if it does not hold, with braces for the values of the formulas `shown`
    """

    location: str
    value: Formula
    words: str
    shown: tuple[Formula, ...]
    low: float = 0.0
    strict: bool = False
    high: float = math.inf

    def problem(self, known: Mapping[str, float]) -> str:
        """The message if the condition does not hold at these parameters, else ""."""
        value = value_of(self.value, known)
        if self.shown and not math.isfinite(value):
            return f"{self.location}: its value is not a finite number; change its parameters"
        if value <= self.high and (value > self.low or (value == self.low and not self.strict)):
            return ""
        shown = (value_of(formula, known) for formula in self.shown)
        return f"{self.location}: {self.words.format(*shown)}"

    @property
    def depends(self) -> bool:
        """Whether it depends on parameters, so that it may hold for some of their values only."""
        return next(names_in(self.value), None) is not None


def require(conditions: Iterable[Condition], known: Mapping[str, float]) -> None:
    """Raise `SceneError` unless all conditions hold at these parameters."""
    for condition in conditions:
        if problem := condition.problem(known):
            raise SceneError(problem)


def value_of(formula: Formula, known: Mapping[str, float]) -> float:
    """The value of a formula; nan if it is undefined."""
    try:
        return float(evaluate(formula, known, FloatScalars()))
    except (ArithmeticError, ValueError):
        return math.nan


def are_zero(known: Mapping[str, float], *formulas: Formula) -> bool:
    """Whether all `formulas` are 0 at these parameters."""
    return all(value_of(formula, known) == 0 for formula in formulas)


def of_quantity(location: str, formula: Formula, bound: str, unit: str) -> Iterator[Condition]:
    """Conditions of a quantity: its absolute value is at most `LARGEST`; its sign fits `bound`."""
    words = f"{{:g}} is larger than {LARGEST:g}; choose other units"
    yield Condition(location, formula, words, (formula,), low=-LARGEST, high=LARGEST)
    if bound == "positive":
        words = f"{{:g}} is not positive; give a number > 0 in {unit}"
        yield Condition(location, formula, words, (formula,), strict=True)
    if bound == "nonnegative":
        yield not_negative(location, formula, unit)


def of_moving(location: str, formula: Formula, known: Mapping[str, float]) -> Iterator[Condition]:
    """Conditions of a formula that depends on the motion: its constant parts are finite."""
    for part in _constant_parts(formula, known):
        text = written(part).replace("{", "{{").replace("}", "}}")
        shown = text if len(text) <= 60 else f"{text[:57]}..."
        words = f"its part '{shown}' is not a finite number; change it or its parameters"
        most = sys.float_info.max
        yield Condition(location, part, words, (), low=-most, high=most)


def _constant_parts(formula: Formula, known: Mapping[str, float]) -> Iterator[Apply]:
    """The largest parts of a formula that depend only on parameters."""
    if isinstance(formula, Apply):
        if all(name in known for name in names_in(formula)):
            yield formula
        else:
            for operand in formula.operands:
                yield from _constant_parts(operand, known)


def not_negative(location: str, formula: Formula, unit: str) -> Condition:
    """The condition formula >= 0."""
    words = f"{{:g}} is negative; give a number >= 0 in {unit}"
    return Condition(location, formula, words, (formula,))


def a_part(location: str, formula: Formula) -> Condition:
    """The condition 0 <= formula <= 1."""
    words = "{:g} is not from 0 to 1; give one that is"
    return Condition(location, formula, words, (formula,), high=1.0)


def in_order(location: str, low: Formula, high: Formula) -> Condition:
    """The condition low < high."""
    words = "{:g} is not below high, {:g}; make low < high"
    return Condition(location, _difference(high, low), words, (low, high), strict=True)


def can_meet(location: str, radii: Sequence[Formula]) -> Condition:
    """The condition that at most one of these radii, m, is 0, since two points do not touch."""
    spheres = _sum(*(Apply("step", (radius,)) for radius in radii))
    words = "two points never meet; give a radius > 0"
    return Condition(location, spheres, words, (), low=len(radii) - 1.0)


def of_inertia(
    location: str,
    body: str,
    mass: Formula,
    entries: Sequence[Formula],
    known: Mapping[str, float],
    rounding: float | None = ROUNDING,
) -> Iterator[Condition]:
    """Conditions that a body can have this inertia about its centre of mass.

    `entries` is one moment in the plane, or xx, yy, zz, xy, xz, yz in space; moments have been
    checked to be not negative. A body without mass has no inertia. This is required of a body that
    has no mass at the `known` parameters; the equations of others need its mass to stay positive.

    In space the principal moments are not negative and none exceeds the sum of the other two. This
    holds if and only if Σ = ½ tr(I) 1 - I, the integral of r rᵀ dm, is positive semidefinite:
    P. M. Wensing, S. Kim, J.-J. E. Slotine, IEEE Robotics and Automation Letters 3 (2018) 60-67.
    For a lamina or a rod Σ is singular, so a tolerance of `rounding` of the trace is allowed. With
    None this is not required.
    """
    trace = _sum(*entries[:3])
    words = f"body '{body}' has inertia but no mass; give it a mass, or inertia_com = 0"
    if value_of(mass, known) == 0.0:
        yield Condition(location, Apply("select", (mass, Constant(1.0), _minus(trace))), words, ())
    if len(entries) == 1 or rounding is None:
        return
    xx, yy, zz, *products = entries
    if all(product == ZERO for product in products):
        words = (
            f"body '{body}' has principal moments {{:.6g}}, {{:.6g}}, {{:.6g}}; no body has one "
            "larger than the other two together: change xx, yy or zz"
        )
        allowed = _product(Constant(rounding / 2), trace)
        excesses = (
            _difference(_sum(b, c, allowed), a)
            for a, b, c in ((xx, yy, zz), (yy, zz, xx), (zz, xx, yy))
        )
        yield Condition(location, _least(*excesses), words, (xx, yy, zz))
        return
    words = (
        f"body '{body}' has moments {{:.6g}}, {{:.6g}}, {{:.6g}} and products {{:.6g}}, {{:.6g}}, "
        "{:.6g}; so one of its principal moments is negative, or larger than the other two "
        "together: make the products smaller, or change xx, yy or zz"
    )
    least = _least(*_leading_minors(entries, rounding))
    yield Condition(location, least, words, tuple(entries), strict=True)


def _leading_minors(entries: Sequence[Formula], rounding: float) -> tuple[Formula, ...]:
    """Three numbers that are > 0 if and only if 2 Σ / s + `rounding`/2 is positive definite.

    s is the sum of the absolute values of all entries, or 1 if that is 0. This is Sylvester's
    criterion; the determinant is multiplied by the first minor, which avoids a division by it
    (E. H. Bareiss, Math. Comp. 22 (1968) 565-578). The tolerance is far larger than the rounding
    errors of the minors for a rod in any orientation.
    """
    size = _sum(*(Apply("abs", (entry,)) for entry in entries))
    size = Apply("select", (size, size, Constant(1.0)))
    xx, yy, zz, xy, xz, yz = (Apply("/", (entry, size)) for entry in entries)
    one = _sum(xx, yy, zz, Constant(rounding / 2))
    a, b, c = (_difference(one, _product(Constant(2.0), x)) for x in (xx, yy, zz))
    p, q, r = (_product(Constant(-2.0), x) for x in (xy, xz, yz))
    second = _difference(_product(a, b), _product(p, p))
    other = _difference(_product(a, c), _product(q, q))
    mixed = _difference(_product(a, r), _product(p, q))
    return a, second, _difference(_product(second, other), _product(mixed, mixed))


def is_of_size(condition: Condition) -> bool:
    """Whether it only bounds the absolute value of a parameter, as for all parameters."""
    value = condition.value
    if isinstance(value, Apply) and value.operation == "neg":
        (value,) = value.operands
    return isinstance(value, Name) and condition.low <= -LARGEST


def _sum(first: Formula, *rest: Formula) -> Formula:
    for term in rest:
        first = Apply("+", (first, term))
    return first


def _least(first: Formula, *rest: Formula) -> Formula:
    for term in rest:
        first = Apply("min", (first, term))
    return first


def _product(a: Formula, b: Formula) -> Formula:
    return Apply("*", (a, b))


def _difference(a: Formula, b: Formula) -> Formula:
    return Apply("-", (a, b))


def _minus(a: Formula) -> Formula:
    return Apply("neg", (a,))
