"""Rigid contacts of a run, by the rules of `eomgen.engine.contacts`.

Its tolerances are relative to the size of the mechanism, `Contacts.sizes`: `in_sizes` scales gaps.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from eomgen.engine.contact_runs import CLOSED, NOT_FOUND, NOT_KEPT, OPENED, WHOLE, taken
from eomgen.engine.contacts import Place, Touching, deepest, press
from eomgen.engine.differences import differences
from eomgen.engine.roots import Search
from eomgen.engine.structures import with_room
from eomgen.run.compiled import Touched
from eomgen.run.failure import StepFailure
from eomgen.run.problem import Contacts, FloatArray, Problem

Rate = Callable[[float, FloatArray], FloatArray]
"""A function of time and state, such as the derivative."""


def sizes_of(contacts: Contacts) -> FloatArray:
    """`Contacts.sizes`, (nc,)."""
    return np.array(contacts.sizes or np.ones(len(contacts.names)))


def in_sizes(contacts: Contacts) -> Contacts:
    """The same contacts with gaps, their rates and accelerations relative to `Contacts.sizes`."""
    sizes = sizes_of(contacts)
    if (sizes == 1).all():
        return contacts

    def held(t: float, y: FloatArray, forces: FloatArray) -> FloatArray:
        found = contacts.held(t, y, forces)
        shape = (len(sizes), *([1] * (found.ndim - 1)))
        found[len(y) : len(y) + len(sizes)] /= sizes.reshape(shape)
        return found

    return replace(
        contacts,
        gaps=lambda t, y: contacts.gaps(t, y) / sizes,
        rates=lambda t, y: contacts.rates(t, y) / sizes,
        held=held,
    )


def nothing_held(contacts: Contacts, states: int, rest_speed: float | None) -> Touching:
    """What is known of contacts before a run. `rest_speed`, m/s or rad/s: see `integrate`."""
    n = len(contacts.names)
    return with_room(
        Touching,
        alpha=0.0,
        fastest=0.0,
        units=np.ones(n),
        rest=np.full(n, -1.0) if rest_speed is None else rest_speed / sizes_of(contacts),
        CONTACTS=n,
        PRESSED=states + 2 * n + len(contacts.drives),
    )


@dataclass(frozen=True, eq=False)
class Holding:
    """The forces of contacts that are held: they may open, but not close."""

    contacts: Contacts
    held: Touching

    def solve(self, t: float, y: FloatArray) -> FloatArray:
        """What `Contacts.held` gives under the forces, (ny + 2 nc + nd,); overwritten by the next
        call.

        Raises `StepFailure` if no forces keep the contacts from closing.
        """
        if not press(self.contacts, self.held, t, y):
            raise no_forces(self.contacts.names, self.held, t)
        return self.held.found

    def derivative(self, t: float, y: FloatArray) -> FloatArray:
        """The state's derivative (ny,) under the contacts' forces."""
        return self.solve(t, y)[: len(y)].copy()

    def powers(self, t: float, y: FloatArray) -> FloatArray:
        """Powers of the contacts' forces and of the drives (nc + nd,), W."""
        return self.solve(t, y)[len(y) + len(self.contacts.names) :].copy()


def no_forces(names: Sequence[str], held: Touching, t: float) -> StepFailure:
    """The failure of a step for which contacts have no forces."""
    which = ", ".join(names[k] for k in np.flatnonzero(held.holds).tolist())
    return StepFailure(
        f"no contact forces at t = {t:.6g} keep {which} from closing "
        "(strong friction can cause this)",
        "take less friction, or another contact law",
    )


@dataclass(frozen=True)
class Within:
    """The states of a step from t and y to `last` at `end`, and `between` these."""

    t: float
    y: FloatArray
    last: FloatArray
    end: float
    between: Callable[[float], FloatArray]

    def state(self, s: float) -> FloatArray:
        """The state s seconds after its start."""
        if s <= 0:
            return self.y
        return self.last if s >= self.end - self.t else self.between(self.t + s)


def meets(met: Touched, step: Within, share: float) -> bool:
    """Go to the end of a step that has been made, or to the first event in it, see
    `engine.contact_runs.taken`. Answers whether there is one; then `met` says which.

    Raises `StepFailure` if that is not found.
    """
    why = taken(met.law, step, met.now, Search(), met.at, step.end, share)
    if why not in (WHOLE, CLOSED, OPENED):
        raise not_taken(met.names, met.now, why, (step.t, step.end), met.at)
    return why != WHOLE


def not_taken(
    names: Sequence[str], held: Touching, why: int, times: tuple[float, float], now: Place
) -> StepFailure:
    """Why a step between two times cannot be taken."""
    start, end = times
    if why == NOT_KEPT:
        return no_forces(names, held, end)
    if why == NOT_FOUND:
        return StepFailure(
            f"the time of a contact is not found between {start:.6g} and {end:.6g}",
            "take a smaller step",
        )
    return StepFailure(
        f"contacts struck or opened {now.events - 1} times within {now.least:.2g} s",
        "take a larger rest_speed",
    )


def restrained(
    problem: Problem, holding: Holding | None, counted: Callable[[Rate], Rate]
) -> Problem:
    """The problem while contacts are held; its Jacobian is then computed by differences, and it has
    no series.

    `counted` wraps a function so that its calls count as derivatives.
    """
    if holding is None:
        return problem
    made = replace(problem, derivative=counted(holding.derivative), timed=True, series={})
    sizes = np.array(problem.sizes or np.ones(len(problem.states)))

    def jacobian(t: float, y: FloatArray) -> FloatArray:
        found = np.empty((len(y), len(y)))
        differences(made, sizes, t, y, found)
        return found

    return replace(made, jacobian=jacobian)


def check_depth(contacts: Contacts, t: float, y: FloatArray) -> None:
    """Raise `StepFailure` if a contact penetrates by more than `TOLERANCE`."""
    found = deepest(contacts, t, y)
    if found >= 0:
        depth = -contacts.gaps(t, y)[found] * sizes_of(contacts)[found]
        raise StepFailure(
            f"contact {contacts.names[found]} starts {depth:.3g} deep",
            "move its bodies apart in the initial state",
        )
