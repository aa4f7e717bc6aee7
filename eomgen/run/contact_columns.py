"""Steps of equal length through the events of rigid contacts, for columns of states in NumPy.

`templates/c/contact_lanes.c.jinja` makes the same steps in compiled code, with the same bits.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eomgen.engine.contact_runs import WHOLE
from eomgen.engine.contact_steps import through
from eomgen.engine.contacts import TOLERANCE, Place, Touching, press
from eomgen.engine.roots import Search
from eomgen.engine.sums import Sum, add_compensated
from eomgen.run.contacts import nothing_held, sizes_of
from eomgen.run.integrators.interface import Change
from eomgen.run.problem import Contacts, FloatArray, Problem


@dataclass(frozen=True, eq=False)
class Lane:
    """A column whose contacts touch, or may close: what the engine is given.

    module   whose functions are those of columns
    given    its parameters and inputs, as arguments of these
    problem  with contacts; `rest` is the speed below which these do not bounce
    change   a step of the method
    placed   (t, (ny, 1)) -> the state with unit quaternions, on the constraints
    """

    module: Any
    given: tuple[FloatArray | None, FloatArray | None]
    problem: Problem
    rest: float | None
    change: Change
    placed: Callable[[float, FloatArray], FloatArray]

    def led(
        self, t: float, y: FloatArray, lost: FloatArray, length: float, end: float
    ) -> tuple[FloatArray, FloatArray] | None:
        """The state after a step from t and y (ny,) to `end`, and what rounding took; None if there
        is none.
        """
        contacts = self.problem.contacts
        assert contacts is not None
        n = len(contacts.names)
        now = nothing_held(contacts, len(y), self.rest)
        closed, opened = np.zeros((2, n), np.int64)
        at = Place(t, y.copy(), closed, opened, length, t, 0)
        way = _Way(self, contacts, now, lost.copy())
        try:
            why = through(way, way, way, now, Search(), at, length, end)
        except (ArithmeticError, ValueError):
            return None
        return (at.y, way.lost) if why == WHOLE else None


@dataclass(eq=False)
class _Way:
    """The contact law of a lane, and the step being made."""

    of: Lane
    contacts: Contacts
    now: Touching
    lost: FloatArray
    t: float = 0.0
    end: float = 0.0

    def __post_init__(self) -> None:
        self.sizes = sizes_of(self.contacts)
        self.problem = replace(self.of.problem, derivative=self._derivative)

    def gaps(self, t: float, y: FloatArray) -> FloatArray:
        found: FloatArray = self.of.module.gaps(t, y[:, None], *self.of.given)[:, 0]
        return found / self.sizes

    def rates(self, t: float, y: FloatArray) -> FloatArray:
        found: FloatArray = self.of.module.gap_rates(t, y[:, None], *self.of.given)[:, 0]
        return found / self.sizes

    def held(self, t: float, y: FloatArray, forces: FloatArray) -> FloatArray:
        found = self.of.module.held(t, y[:, None], forces[:, None], *self.of.given)[:, 0]
        made: FloatArray = np.array(found)
        made[len(y) : len(y) + len(forces)] /= self.sizes
        return made

    def impact(self, t: float, y: FloatArray, contact: int, bounce: float) -> FloatArray:
        found = self.of.module.impact(t, y[:, None], contact, bounce, *self.of.given)
        return np.asarray(found[:, 0], dtype=np.float64)

    def _derivative(self, t: float, y: FloatArray) -> FloatArray:
        if not self.now.holds.any():
            found: FloatArray = self.of.module.derivative(t, y, *self.of.given)
            return found
        if not press(self, self.now, t, y[:, 0]):
            return np.full_like(y, np.nan)
        return np.array(self.now.found[: len(y), None], dtype=np.float64)

    def go(self, t: float, y: FloatArray, length: float, end: float) -> bool:
        self.t, self.end, self.y = t, end, y.copy()
        total = Sum(self.y.copy(), self.lost)
        add_compensated(total, self.of.change(self.problem, t, self.y[:, None], length)[:, 0])
        self.lost, self.last = total.lost, self.of.placed(end, total.value[:, None])[:, 0]
        return bool(np.isfinite(self.last).all())

    def part(self) -> None:
        self.lost = np.zeros_like(self.lost)

    def state(self, s: float) -> FloatArray:
        t = self.t + s
        if s >= self.end - self.t:
            return self.last.copy()
        if s <= 0 or t <= self.t:
            return self.y.copy()
        change = self.of.change(self.problem, self.t, self.y[:, None], t - self.t)
        return self.of.placed(t, self.y[:, None] + change)[:, 0]


def apart(
    contacts: Contacts,
    gaps: tuple[FloatArray, FloatArray],
    rates: tuple[FloatArray, FloatArray],
) -> NDArray[np.bool_]:
    """The columns whose contacts neither touch nor may close in a step, from gaps and their rates
    (nc, k) at its start and its end.
    """
    touch = gaps[0] / sizes_of(contacts)[:, None] > TOLERANCE
    dips = (rates[0] < 0.0) & (rates[1] > 0.0)
    clear: NDArray[np.bool_] = touch & (gaps[1] >= 0.0) & ~dips
    return np.asarray(clear.all(axis=0))
