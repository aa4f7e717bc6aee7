"""Derivatives of formulas as formulas."""

from dataclasses import dataclass
from typing import Any

from eomgen.language.formula import ZERO, Apply, Constant, Formula, Name, evaluate, names_in
from eomgen.language.rewriting import difference, total
from eomgen.scalars.duals import Dual, Duals
from eomgen.scalars.exact import Real
from eomgen.scalars.protocol import Scalars

ONE = Constant(1.0)


def derivative(formula: Formula, name: str) -> Formula:
    """The derivative of a formula by a name; at a corner or a jump that of the branch taken."""
    zero, one = _Built(ZERO), _Built(ONE)
    names = {n: Dual(_Built(Name(n)), one if n == name else zero) for n in names_in(formula)}
    found: Formula = evaluate(formula, names, Duals(_Formulas())).rate.formula
    return found


@dataclass(frozen=True)
class _Built:
    """A formula as a scalar: terms that are 0 and factors 1 vanish."""

    formula: Formula

    def __add__(self, other: "_Built") -> "_Built":
        return _Built(total(self.formula, other.formula))

    def __sub__(self, other: "_Built") -> "_Built":
        return _Built(difference(self.formula, other.formula))

    def __neg__(self) -> "_Built":
        return _Built(difference(ZERO, self.formula))

    def __mul__(self, other: "_Built") -> "_Built":
        a, b = self.formula, other.formula
        if ZERO in (a, b):
            return _Built(ZERO)
        if ONE in (a, b):
            return other if a == ONE else self
        return _Built(Apply("*", (a, b)))

    def __truediv__(self, other: "_Built") -> "_Built":
        if self.formula == ZERO or other.formula == ONE:
            return self
        return _Built(Apply("/", (self.formula, other.formula)))


class _Formulas(Scalars):
    """Formulas as scalars."""

    def number(self, value: Real) -> _Built:
        """A constant."""
        return _Built(Constant(float(value)))

    def call(self, function: str, *arguments: Any) -> _Built:
        """A function of formulas."""
        return _Built(Apply(function, tuple(x.formula for x in arguments)))
