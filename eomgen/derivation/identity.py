"""Whether expressions are the same: their values in exact arithmetic where symbols are random.

Each symbol has a random rational value. The sine and cosine of a symbol are those of another random
angle, rational as well: to the laws of algebra θ, sin θ and cos θ have only sin² + cos² = 1 in
common. Expressions that differ have the same value there with a chance below one in a million. With
other functions, or angles that are no sums of symbols, values are rounded.
"""

import random
from collections.abc import Iterable, Sequence
from fractions import Fraction

import sympy as sp

from eomgen.derivation.steps import Definition
from eomgen.derivation.symbols import Expr

NEAR = Fraction(1, 10**9)
"""How far apart values may be, relative to their size, once a number is not exact."""
TRIES = 2


def identical(pairs: Iterable[tuple[Expr, Expr]], definitions: Sequence[Definition] = ()) -> bool:
    """Whether both expressions of all pairs are the same, `definitions` put in for symbols."""
    every, known = list(pairs), dict(definitions)
    for seed in range(TRIES):
        try:
            same = _same(every, _Point(seed, known, exact=True))
        except _NoTurnError:
            same = _same(every, _Point(seed, known, exact=False))
        if not same:
            return False
    return True


def _same(pairs: Iterable[tuple[Expr, Expr]], point: "_Point") -> bool:
    for a, b in pairs:
        left, right = point.value(a), point.value(b)
        allowed = NEAR * max(Fraction(1), abs(left), abs(right)) if point.rounded else 0
        if abs(left - right) > allowed:
            return False
    return True


class _NoTurnError(Exception):
    """An angle is no sum of whole multiples of symbols."""


class _Point:
    """Values of expressions at one random point."""

    def __init__(self, seed: int, definitions: dict[Expr, Expr], *, exact: bool) -> None:
        self.rounded = False
        self._exact, self._definitions = exact, definitions
        self._chance = random.Random(seed)
        self._known: dict[str, Fraction] = {}
        self._angles: dict[str, tuple[Fraction, Fraction]] = {}

    def value(self, e: Expr) -> Fraction:
        """The value of a scalar expression."""
        if e.is_Symbol:
            return self._symbol(e)
        if e.is_Rational:
            return Fraction(int(e.p), int(e.q))
        if e.is_Add:
            return sum((self.value(x) for x in e.args), Fraction(0))
        if e.is_Mul:
            product = Fraction(1)
            for x in e.args:
                product *= self.value(x)
            return product
        if e.is_Pow and e.exp.is_Integer:
            return self.value(e.base) ** int(e.exp)
        if self._exact and isinstance(e, sp.sin | sp.cos):
            return self._turn(e.args[0])[isinstance(e, sp.sin)]
        return self._rounded(e)

    def _symbol(self, e: Expr) -> Fraction:
        if e in self._definitions:
            if e.name not in self._known:
                self._known[e.name] = self.value(self._definitions[e])
        elif e.name not in self._known:
            self._known[e.name] = self._random()
        return self._known[e.name]

    def _random(self) -> Fraction:
        return Fraction(self._chance.randint(10**6, 4 * 10**6), 2 * 10**6 + 3)

    def _turn(self, angle: Expr) -> tuple[Fraction, Fraction]:
        """Cosine and sine of a sum of whole multiples of symbols."""
        whole = (Fraction(1), Fraction(0))
        for term in sp.Add.make_args(angle):
            times, symbol = term.as_coeff_Mul()
            if not (symbol.is_Symbol and times.is_Integer):
                raise _NoTurnError
            defined = self._definitions.get(symbol)
            c, s = self._angle(symbol) if defined is None else self._turn(defined)
            if times < 0:
                s = -s
            for _ in range(abs(int(times))):
                whole = (whole[0] * c - whole[1] * s, whole[0] * s + whole[1] * c)
        return whole

    def _angle(self, symbol: Expr) -> tuple[Fraction, Fraction]:
        if symbol.name not in self._angles:
            t = self._random()
            self._angles[symbol.name] = ((1 - t * t) / (1 + t * t), 2 * t / (1 + t * t))
        return self._angles[symbol.name]

    def _rounded(self, e: Expr) -> Fraction:
        """What is not rational, rounded; conditions by the values of their sides."""
        self.rounded = True
        if isinstance(e, sp.Piecewise):
            for value, condition in e.args:
                if condition == True or condition.func(*map(self._number, condition.args)) == True:  # noqa: E712 - SymPy's own truth
                    return self.value(value)
        return Fraction(float(e.func(*map(self._number, e.args)) if e.args else e))

    def _number(self, e: Expr) -> Expr:
        return sp.Float(float(self.value(e)))
