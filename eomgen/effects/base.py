"""What effects share: the loads they put on free bodies and joints, over any scalars."""

from dataclasses import dataclass
from typing import Any, Literal, Protocol

from eomgen.language.formula import Formula

Scalar = Any
"""SymPy expressions, program nodes or floats; effects only add, subtract and multiply them."""


@dataclass(frozen=True)
class Input:
    """A commanded input `u` of the generated module; it is 0 unless given."""

    name: str
    unit: str
    about: str


@dataclass(frozen=True)
class Load:
    """A force on one free body: two components in the plane, three in space.

    `force` in world axes (N) acts at `at`, measured from the centre of mass in body axes (m).
    `kind` says on which side of M v̇ + V + G = F it stands.
    """

    body: str
    force: tuple[Scalar, ...]
    at: tuple[Scalar, ...]
    kind: Literal["gravity", "applied"]


@dataclass(frozen=True)
class JointLoad:
    """A force on the one coordinate of a joint (N m or N): on the child, and back on the parent."""

    joint: str
    force: Scalar


class Mechanism(Protocol):
    """What an effect may ask of the mechanism it acts on."""

    @property
    def dimensions(self) -> int:
        """2 in the plane, 3 in space."""

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of all bodies."""

    def mass(self, body: str) -> Scalar:
        """Mass of a body, kg."""

    def height(self, body: str) -> Scalar:
        """World y of a body's centre of mass in the plane, z in space, m."""

    def value(self, formula: Formula) -> Scalar:
        """Value of a quantity."""

    def input(self, name: str) -> Scalar:
        """Value of an input."""
