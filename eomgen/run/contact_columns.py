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
from eomgen.engine.contacts import TOLERANCE, Place
from eomgen.engine.roots import Search
from eomgen.engine.sums import Sum, add_compensated
from eomgen.run.contacts import Holding, in_sizes, nothing_held, sizes_of
from eomgen.run.failure import StepFailure
from eomgen.run.integrators.interface import Change
from eomgen.run.problem import Contacts, FloatArray, Problem


@dataclass(eq=False)
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
        contacts, module = self.problem.contacts, self.module
        assert contacts is not None
        law = replace(
            contacts,
            gaps=self._of_one(module.gaps),
            rates=self._of_one(module.gap_rates),
            held=self._of_one(module.held),
            impact=self._of_one(module.impact),
        )
        law, now = in_sizes(law), nothing_held(contacts, len(y), self.rest)
        free, holding = self._of_one(module.derivative), Holding(law, now)

        def derivative(t: float, y: FloatArray) -> FloatArray:
            found = holding.derivative if now.holds.any() else free
            return found(t, y[:, 0])[:, None]

        self._moved, self._lost = replace(self.problem, derivative=derivative), lost.copy()
        closed, opened = np.zeros((2, len(contacts.names)), np.int64)
        at = Place(t, y.copy(), closed, opened, length, t, 0)
        try:
            why = through(law, self, now, Search(), at, length, end)
        except (ArithmeticError, ValueError, StepFailure):
            return None
        return (at.y, self._lost) if why == WHOLE else None

    def _of_one(self, function: Callable[..., FloatArray]) -> Callable[..., FloatArray]:
        """A function of columns for a single one; it may take further columns, and numbers."""

        def value(t: float, *given: Any) -> FloatArray:
            columns = (x[:, None] if isinstance(x, np.ndarray) else x for x in given)
            return np.array(function(t, *columns, *self.given)[:, 0])

        return value

    def go(self, t: float, y: FloatArray, length: float, end: float) -> bool:
        """See `engine.contact_steps.Way`."""
        self._t, self._end, self._y = t, end, y.copy()
        total = Sum(y.copy(), self._lost)
        add_compensated(total, self.change(self._moved, t, self._y[:, None], length)[:, 0])
        self._lost, self._last = total.lost, self.placed(end, total.value[:, None])[:, 0]
        return bool(np.isfinite(self._last).all())

    def part(self) -> None:
        """See `engine.contact_steps.Way`."""
        self._lost = np.zeros_like(self._lost)

    def state(self, s: float) -> FloatArray:
        """See `engine.contact_times.Within`."""
        t = self._t + s
        if s >= self._end - self._t:
            return self._last.copy()
        if s <= 0 or t <= self._t:
            return self._y.copy()
        change = self.change(self._moved, self._t, self._y[:, None], t - self._t)
        return self.placed(t, self._y[:, None] + change)[:, 0]


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
