"""Sums of many changes, without the rounding errors that would add up."""

from dataclasses import dataclass, field
from typing import Annotated

from eomgen.subset.words import Vector, copy, zeros


@dataclass(slots=True)
class Sum:
    """A sum of changes: its value so far, and what rounding took from it."""

    value: Annotated[Vector, "STATES"] = field(default_factory=lambda: zeros(0))
    lost: Annotated[Vector, "STATES"] = field(default_factory=lambda: zeros(0))


def round_off(
    y: Annotated[Vector, "STATES"],
    raw: Annotated[Vector, "STATES"],
    change: Annotated[Vector, "STATES"],
    lost: Annotated[Vector, "STATES"],
) -> None:
    """What rounding took from y + change, which is `raw`, exactly (Knuth's two-sum)."""
    rest = raw - y
    lost[:] = (y - (raw - rest)) + (change - rest)


def add_compensated(of: Sum, change: Annotated[Vector, "STATES"]) -> None:
    """Add a change; what rounding takes from it is added to the next one: Hairer, Lubich, Wanner,
    Geometric Numerical Integration, VIII.5.
    """
    step = change + of.lost
    total = of.value + step
    lost = copy(step)
    round_off(of.value, total, step, lost)
    of.lost = lost
    of.value = total
