"""The interface of constraints: scalar equations of the motion, each kept by a multiplier."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from eomgen.scene.effects.base import EffectTable, JointLoad, Load, Mechanism, Scalar


@dataclass(frozen=True)
class Row:
    """One scalar constraint g = 0, or its rate alone if it restricts velocities only.

    The constraint's force is its multiplier times `loads`, so the rate of g is the power of these
    loads plus `drift`, which is what time alone changes (virtual work).

    residual  g, m or rad; None if only its rate is constrained
    loads     the loads of a multiplier of 1
    drift     rate of g at rest, m/s or rad/s; None for 0
    """

    residual: Scalar | None
    loads: tuple[Load | JointLoad, ...]
    drift: Scalar | None = None


class Constraint(Protocol):
    """What closes a loop or restricts a motion."""

    @property
    def name(self) -> str:
        """Its name in the scene."""

    def row_names(self, dimensions: int) -> Sequence[tuple[str, str]]:
        """The name and the unit of the multiplier of each of its rows."""

    def rows(self, mechanism: Mechanism) -> Sequence[Row]:
        """Its scalar constraints, over the mechanism's scalars, in the order of `row_names`."""


class ConstraintTable(EffectTable):
    """The base of the constraints that a scene lists; its names and points are read as those of
    effects.
    """

    def row_names(self, dimensions: int) -> Sequence[tuple[str, str]]:
        """The name and the unit of the multiplier of each row."""
        raise NotImplementedError

    def rows(self, mechanism: Mechanism) -> Sequence[Row]:
        """Its scalar constraints."""
        raise NotImplementedError
