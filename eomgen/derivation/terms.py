"""The terms of the equations of motion."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Self

import sympy as sp

from eomgen.derivation.steps import Step
from eomgen.derivation.symbols import Expr


@dataclass(frozen=True)
class Terms:
    """M v̇ + V + G = F: mass matrix (n, n), and forces of velocity, gravity and all else (n, 1)."""

    M: Expr
    V: Expr
    G: Expr
    F: Expr

    @property
    def whole(self) -> tuple[Expr, Expr, Expr, Expr]:
        """M, V, G and F."""
        return self.M, self.V, self.G, self.F

    @property
    def right(self) -> Expr:
        """F - V - G."""
        return self.F - self.V - self.G

    def each(self, change: Callable[[Expr], Expr]) -> Self:
        """M, V, G and F changed."""
        M, V, G, F = map(change, self.whole)
        return replace(self, M=M, V=V, G=G, F=F)


def terms_steps(title: str, words: str, terms: Terms) -> Iterator[Step]:
    """A step for each of M, V, G and F; that of M has its own title and words."""
    whole = (("M", title, words), ("V", "Velocity forces", ""), ("G", "Gravity forces", ""))
    for letter, name, about in (*whole, ("F", "Applied forces", "")):
        yield Step.of("equations", name, about, [(sp.Symbol(letter), getattr(terms, letter))])
