"""Explicit steps whose length is given: Runge-Kutta methods, and splittings into drift and kick.

Hairer, Nørsett, Wanner, Solving ODEs I, and Hairer, Lubich, Wanner, Geometric Numerical
Integration. STATES is the number of states; of these POSITIONS are positions and OTHERS are not.
"""

from dataclasses import dataclass, field
from typing import Annotated, Protocol

from eomgen.engine.system import System
from eomgen.engine.tableau import ButcherTableau
from eomgen.subset.words import (
    Known,
    Matrix,
    Vector,
    Whole,
    added,
    copy,
    product,
    rows,
    unrolled,
    zeros,
)


@dataclass(frozen=True)
class Composition:
    """The parts γ_i of a step that is made of steps of another method; its order."""

    name: str
    order: int
    parts: tuple[float, ...]


_SUZUKI = 1 / (4 - 4 ** (1 / 3))
_KAHAN_LI = (0.39216144400731413928, 0.33259913678935943860, -0.70624617255763935981,
             0.08221359629355080023)  # fmt: skip
LEAPFROG_4 = Composition("leapfrog_4", 4, (_SUZUKI, _SUZUKI, 1 - 4 * _SUZUKI, _SUZUKI, _SUZUKI))
"""Suzuki, Phys. Lett. A 146 (1990) 319-323."""
LEAPFROG_6 = Composition(
    "leapfrog_6", 6, (*_KAHAN_LI, 1 - 2 * sum(_KAHAN_LI), *reversed(_KAHAN_LI))
)
"""Kahan and Li, Math. Comput. 66 (1997) 1089-1099."""
EULER = ButcherTableau(a=((0,),), b=(1,), c=(0,), order=1, name="euler")
# Hairer, Nørsett, Wanner, table II.1.2.
RUNGE_KUTTA_4 = ButcherTableau(
    a=(
        (0, 0, 0, 0),
        (1 / 2, 0, 0, 0),
        (0, 1 / 2, 0, 0),
        (0, 0, 1, 0),
    ),
    b=(1 / 6, 1 / 3, 1 / 3, 1 / 6),
    c=(0, 1 / 2, 1 / 2, 1),
    order=4,
    name="rk4",
)


@dataclass(slots=True)
class Step:
    """What a step leaves: the change of the state, and the last derivative, `slope` at `place`."""

    change: Annotated[Vector, "STATES"] = field(default_factory=lambda: zeros(0))
    place: Annotated[Vector, "STATES"] = field(default_factory=lambda: zeros(0))
    slope: Annotated[Vector, "STATES"] = field(default_factory=lambda: zeros(0))


@dataclass(slots=True)
class Split:
    """A system whose positions move by the other states: which states these are, and the constant
    matrix by which the others give the rates of the positions.
    """

    positions: Annotated[Whole, "POSITIONS"]
    others: Annotated[Whole, "OTHERS"]
    rates: Annotated[Matrix, "POSITIONS", "OTHERS"]


class Method(Protocol):
    """A method with steps of given length."""

    def changed(self, t: float, y: Annotated[Vector, "STATES"], h: float, step: Step) -> int:
        """Make a step of h from y at t. Returns the number of iterations, 1 if it has none, or 0
        if there is no step.
        """
        ...


def runge_kutta(
    method: Known,
    system: System,
    t: float,
    y: Annotated[Vector, "STATES"],
    h: float,
    step: Step,
) -> None:
    """A step of an explicit method: Hairer, Nørsett, Wanner, definition II.1.1."""
    k = rows(method.stages, len(y))
    by_slopes(method, system, t, y, h, k, step)
    step.slope = k[method.stages - 1]


def by_slopes(
    method: Known,
    system: System,
    t: float,
    y: Annotated[Vector, "STATES"],
    h: float,
    k: Annotated[Matrix, "4", "STATES"],
    step: Step,
) -> None:
    """The same step, without the last slope, and the slopes in it."""
    k[0] = system.derivative(t, y)
    step.place = copy(y)
    for i in unrolled(range(1, method.stages)):
        step.place = y + h * added(a * k[j] for j, a in method.rows[i])
        k[i] = system.derivative(t + method.c[i] * h, step.place)
    step.change = h * added(b * k[j] for j, b in method.sums)


def semi_implicit_euler(
    system: System,
    positions: Annotated[Whole, "POSITIONS"],
    t: float,
    y: Annotated[Vector, "STATES"],
    h: float,
    step: Step,
) -> None:
    """Symplectic Euler: kick the velocities, then drift with the new ones. Hairer, Lubich, Wanner,
    (VI.3.1); the drift is the position part of f(old positions, new velocities), which holds for
    every form of the state.
    """
    slope = system.derivative(t, y)
    change = h * slope
    change[positions] = 0.0
    place = y + change
    slope = system.derivative(t, place)
    change[positions] = h * slope[positions]
    step.change = change
    step.place = place
    step.slope = slope


def leapfrog(
    system: System, split: Split, t: float, y: Annotated[Vector, "STATES"], h: float, step: Step
) -> None:
    """Störmer-Verlet: half a drift, kick, half a drift. Hairer, Lubich, Wanner, (I.1.17)."""
    velocities = copy(y[split.others])
    drift = product(split.rates, velocities)
    place = copy(y)
    place[split.positions] += h / 2.0 * drift
    slope = system.derivative(t + h / 2.0, place)
    kick = h * slope[split.others]
    middle = velocities + kick / 2.0
    drift = product(split.rates, middle)
    change = copy(y)
    change[split.others] = kick
    change[split.positions] = h * drift
    step.change = change
    step.place = place
    step.slope = slope


def composed(
    of: Known,
    method: Method,
    t: float,
    y: Annotated[Vector, "STATES"],
    h: float,
    step: Step,
) -> int:
    """A step made of steps of parts of h, of which some lead back: Hairer, Lubich, Wanner,
    (II.4.2). Returns the number of iterations, or 0 if there is no step.
    """
    total = 0.0 * y
    start = t
    iterations = 0
    for part in unrolled(of.parts):
        place = y + total
        made = method.changed(start, place, part * h, step)
        if made == 0:
            return 0
        iterations += made
        total = total + step.change
        start += part * h
    step.change = total
    return iterations


def constant_rates(
    system: System,
    positions: Annotated[Whole, "POSITIONS"],
    others: Annotated[Whole, "OTHERS"],
    y: Annotated[Vector, "STATES"],
    rates: Annotated[Matrix, "POSITIONS", "OTHERS"],
) -> None:
    """The matrix of a `Split`, from derivatives at the positions of y."""
    place = copy(y)
    place[others] = 0.0
    for i in range(len(others)):
        place[others[i]] = 1.0
        slope = system.derivative(0.0, place)
        rates[:, i] = slope[positions]
        place[others[i]] = 0.0
