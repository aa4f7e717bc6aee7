"""The definitions that a derivation makes, in order, and what is written with them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import sympy as sp

from eomgen.derivation.rewriting import gathered
from eomgen.derivation.steps import Definition
from eomgen.derivation.symbols import Expr, real

TURNS = ("R__", "k__")
"""How the names of entries of a joint's rotation begin."""


def is_turn(symbol: Expr) -> bool:
    """Whether a symbol is an entry of a joint's rotation, or scales a quaternion."""
    return bool(symbol.name.startswith(TURNS))


def needed_by(
    expressions: Sequence[Expr], definitions: Sequence[Definition]
) -> tuple[Definition, ...]:
    """The definitions that expressions need, directly or by others."""
    needed = {s for e in expressions for s in e.free_symbols}
    kept = []
    for symbol, e in reversed(definitions):
        if symbol in needed:
            needed |= e.free_symbols
            kept.append((symbol, e))
    return tuple(reversed(kept))


def written_out(expression: Expr, definitions: Iterable[Definition]) -> Expr:
    """An expression with all definitions substituted. For a long solution it is very long."""
    known: dict[Expr, Expr] = {}
    for symbol, value in needed_by([expression], tuple(definitions)):
        known[symbol] = value.xreplace(known)
    return expression.xreplace(known)


def written_size(expression: Expr, definitions: Iterable[Definition]) -> int:
    """The symbols and numbers that an expression has with all definitions substituted."""
    counts: dict[Expr, int] = {}

    def leaves(e: Expr) -> int:
        return sum(counts.get(x, 1) for x in sp.preorder_traversal(e) if x.is_Atom)

    for symbol, value in needed_by([expression], tuple(definitions)):
        counts[symbol] = leaves(value)
    return leaves(expression)


def triple(word: str, name: str) -> Expr:
    """Three symbols of a vector."""
    return sp.Matrix([real(f"{word}__{name}__{axis}") for axis in "xyz"])


@dataclass
class Ledger:
    """The definitions of a derivation, in order: its only mutable object.

    fixed    symbols that depend on parameters alone
    inline   largest number of operations of an expression that is not given a name
    longest  largest number of operations of an expression that is simplified
    rates    time derivatives of symbols; a symbol without an entry is constant
    """

    fixed: frozenset[Expr]
    inline: int
    longest: int
    definitions: dict[Expr, Expr] = field(default_factory=dict)
    rates: dict[Expr, Expr] = field(default_factory=dict)

    def define(self, symbol: Expr, expression: Expr) -> Expr:
        """A definition, whatever its length."""
        self.definitions[symbol] = expression
        return symbol

    def named(self, name: str, expression: Expr, *, positive: bool = False) -> Expr:
        """A symbol for an expression that is long; a short one itself."""
        if expression.is_Atom or sp.count_ops(expression) <= self.inline:
            return expression
        if positive:
            return self.define(sp.Symbol(name, positive=True), expression)
        return self.define(real(name), expression)

    def short(self, expression: Expr, sums: Mapping[Expr, Expr] | None = None) -> Expr:
        """An expression, or each component of a vector, simplified by `gathered` unless long."""
        if isinstance(expression, sp.MatrixBase):
            return expression.applyfunc(self.short)
        if expression.is_Atom or sp.count_ops(expression) > self.longest:
            return expression
        return gathered(expression, self.fixed, sums)

    def vector(self, word: str, name: str, expressions: Expr) -> Expr:
        """The same for the components of a vector."""
        pairs = zip("xyz", expressions, strict=True)
        return sp.Matrix([self.named(f"{word}__{name}__{axis}", e) for axis, e in pairs])
