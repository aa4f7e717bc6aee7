"""SymPy expressions as scalars for effects and formulas that are to be read."""

from typing import Any

import sympy as sp

from eomgen.derivation.symbols import Expr
from eomgen.scalars.protocol import Scalars

PLAIN = {
    "sin": sp.sin,
    "cos": sp.cos,
    "tan": sp.tan,
    "asin": sp.asin,
    "acos": sp.acos,
    "atan": sp.atan,
    "atan2": sp.atan2,
    "exp": sp.exp,
    "log": sp.log,
    "tanh": sp.tanh,
    "sqrt": sp.sqrt,
    "abs": sp.Abs,
}
"""Functions of formulas that SymPy has; min, max and step stay functions without a meaning to it,
since it would try to compare their arguments.
"""
GUARD = 1e-15
"""Lower bounds below this keep lengths from being 0 where points coincide; they are not shown."""
HALVES = 8
"""Fractions with whole numerators up to this and denominator 2 or 4 are written as fractions."""


class SymbolicScalars(Scalars):
    """SymPy expressions as scalars: what has cases stays a function or a case distinction."""

    def number(self, value: Any) -> Expr:
        """A whole number or a simple fraction exactly, any other as the decimal it is."""
        x = float(value)
        if x.is_integer() and abs(x) < 1e15:
            return sp.Integer(int(x))
        if (4 * x).is_integer() and abs(4 * x) <= HALVES:
            return sp.Rational(int(4 * x), 4)
        return sp.Float(x)

    def call(self, function: str, *arguments: Expr) -> Expr:
        """A function of formulas."""
        if function == "select":
            condition, yes, no = arguments
            if yes == no:
                return yes
            if condition.is_number:
                return yes if condition > 0 else no
            return sp.Piecewise((yes, positive(condition)), (no, True), evaluate=False)
        if function in ("min", "max") and all(x.is_number for x in arguments):
            return (min if function == "min" else max)(arguments)
        if function == "max" and arguments[1].is_number and 0 < arguments[1] < GUARD:
            return arguments[0]
        if function in PLAIN:
            return PLAIN[function](*arguments)
        return sp.Function(function, real=True)(*arguments)


def positive(condition: Expr) -> Expr:
    """`condition > 0`, written without a leading minus."""
    if condition.could_extract_minus_sign() and not condition.is_Add:
        return sp.StrictLessThan(-condition, 0, evaluate=False)
    return sp.StrictGreaterThan(condition, 0, evaluate=False)
