"""Sums of many changes, without the rounding errors that would add up."""

from dataclasses import dataclass, field
from typing import Annotated

from eomgen.subset.words import Vector, zeros


@dataclass(slots=True)
class Sum:
    """A sum of changes: its value so far, and what rounding took from it."""

    value: Annotated[Vector, "STATES"] = field(default_factory=lambda: zeros(0))
    lost: Annotated[Vector, "STATES"] = field(default_factory=lambda: zeros(0))


def add_compensated(of: Sum, change: Annotated[Vector, "STATES"]) -> None:
    """Add a change. The rounding error of the sum is found exactly (Knuth's two-sum) and added to
    the next change: Hairer, Lubich, Wanner, Geometric Numerical Integration, VIII.5.
    """
    step = change + of.lost
    total = of.value + step
    rest = total - of.value
    of.lost = (of.value - (total - rest)) + (step - rest)
    of.value = total
