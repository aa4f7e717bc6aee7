"""What a derivation that is to be read consists of."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from eomgen.derivation.symbols import Expr
from eomgen.tables.details import Detail, Method

Definition = tuple[Expr, Expr]
"""A symbol and what it stands for."""
Pairs = list[Definition]
"""Left and right sides of equations."""
Kind = Literal["introduction", "state", "bodies", "balance", "joint", "motion", "pose", "effect",
               "constraint", "algorithm", "equations", "solution", "form", "impact", "force",
               "variant"]  # fmt: skip

LEVELS: dict[Kind, Detail] = {
    "introduction": "summary",
    "state": "summary",
    "bodies": "steps",  # each by itself, with its forces
    "balance": "steps",  # Newton and Euler for each
    "joint": "steps",
    "motion": "steps",  # the derivatives of a joint
    "pose": "steps",  # where bodies are in the world, and how they move
    "effect": "steps",
    "constraint": "steps",
    "algorithm": "steps",
    "equations": "summary",  # M, V, G, F
    "solution": "summary",  # the accelerations
    "form": "summary",  # the derivative of the state
    "impact": "steps",
    "force": "all",  # what joints, constraints and gravity exert
    "variant": "all",  # another way to write what has been said
}
"""The first level of detail at which a kind of step is shown."""
FIGURES: dict[Kind, str] = {"state": "mechanism", "bodies": "bodies"}
"""The sketch beside the words of a kind of step."""


@dataclass(frozen=True)
class Equation:
    """One line `left = right`; a matrix equation where `right` is a matrix."""

    left: Expr
    right: Expr


@dataclass(frozen=True)
class Step:
    """One step: what it is, a title, an explanation, its equations, its number in brackets, and the
    method to which it belongs where several stand side by side.

    In the words, blank lines divide paragraphs and backquotes enclose what is code.
    """

    kind: Kind
    title: str
    words: str
    equations: tuple[Equation, ...]
    number: str = ""
    way: Method | None = None

    @classmethod
    def of(
        cls, kind: Kind, title: str, words: str, pairs: Iterable[Definition], number: str = ""
    ) -> "Step":
        """A step with lines by their left and right sides."""
        return cls(kind, title, words, tuple(Equation(*pair) for pair in pairs), number)

    @property
    def figure(self) -> str:
        """The sketch that belongs beside the words: "mechanism", "bodies", or none."""
        return FIGURES.get(self.kind, "")
