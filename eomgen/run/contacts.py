"""Rigid contacts: forces of those that are held, and impacts of those that close."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from eomgen.run.complementarity import complementary
from eomgen.run.integrators.interface import StepFailure
from eomgen.run.problem import Contacts, Floats, Problem

TOLERANCE = 1e-9
"""m or rad: contacts this close touch, and may start this deep."""

STILL = 1e-10
"""m/s or rad/s: contacts that close more slowly do not close."""

PARTING = 1e-9
"""m/s^2 or rad/s^2: contacts without a force that part with less stay as they are."""

ALPHA = 10.0
"""1/s: what a held contact is off by, it leaves behind at this rate."""

BOUNCES, STRIKES = 100, 5000
"""Strikes at one moment, per contact: with restitution, and in all."""

_CUBE_ROOT = np.finfo(float).eps ** (1 / 3)


Rate = Callable[[float, Floats], Floats]
"""A function of time and state, such as the derivative."""


@dataclass(frozen=True, eq=False)
class Holding:
    """Some contacts of a mechanism, held: they may part, but not close.

    Their forces f solve 0 <= f, 0 <= a, f a = 0 with a = gap'' + 2 α gap' + α² gap, which is affine
    in the forces; α (Baumgarte's stabilisation with both roots at -α) takes drift back.
    """

    contacts: Contacts
    held: tuple[int, ...]
    start: tuple[float, Floats]

    @cached_property
    def units(self) -> Floats:
        """Forces (nh,) that accelerate each gap by about 10 m/s²: differences keep their digits."""
        matrix, _, _ = self._system(*self.start, np.ones(len(self.held)))
        own = np.abs(np.diagonal(matrix))
        return 10.0 / np.where(own > 0, own, 10.0)

    def solve(self, t: float, y: Floats) -> tuple[Floats, Floats, Floats]:
        """Return what `Contacts.held` gives (ny + 2 nc + nd,), and (nh,) each: forces times what
        they do to their own gaps, and a, m/s².

        Raises `StepFailure` if no forces keep the contacts from closing.
        """
        matrix, offset, columns = self._system(t, y, self.units)
        forces = complementary(matrix, offset)
        if forces is None:
            names = ", ".join(self.contacts.names[k] for k in self.held)
            raise StepFailure(
                f"no contact forces at t = {t:.6g} keep {names} from closing (much friction may do "
                f"that); take less friction, or another law of contact"
            )
        result = columns[:, 0] + (columns[:, 1:] - columns[:, :1]) @ forces
        return result, forces * np.diagonal(matrix), matrix @ forces + offset

    def derivative(self, t: float, y: Floats) -> Floats:
        """The state's derivative (ny,) under the contacts' forces."""
        return self.solve(t, y)[0][: len(y)]

    def powers(self, t: float, y: Floats) -> Floats:
        """What the contacts' forces and the drives do (nc + nd,), W."""
        return self.solve(t, y)[0][len(y) + len(self.contacts.names) :]

    def _system(self, t: float, y: Floats, units: Floats) -> tuple[Floats, Floats, Floats]:
        """Matrix and offset of a, and the columns that `Contacts.held` gives: under no force, and
        under the unit of each.
        """
        held = list(self.held)
        forces = np.zeros((len(held) + 1, len(self.contacts.names)))
        forces[range(1, len(held) + 1), held] = units
        # One at a time: scalar code, ten times as fast as columns where there are few.
        columns = np.column_stack([self.contacts.held(t, y, each) for each in forces])
        gaps, rates = self.contacts.gaps(t, y)[held], self.contacts.rates(t, y)[held]
        free = columns[len(y) :][held]
        offset = free[:, 0] + 2 * ALPHA * rates + ALPHA**2 * gaps
        return free[:, 1:] - free[:, :1], offset, columns


def restrained(
    problem: Problem, holding: Holding | None, counted: Callable[[Rate], Rate]
) -> Problem:
    """The problem while contacts are held; its Jacobian is then one by differences.

    `counted` makes a function count among the derivatives evaluated.
    """
    if holding is None:
        return problem
    derivative = counted(holding.derivative)
    return replace(problem, derivative=derivative, jacobian=partial(_differences, derivative))


def _differences(derivative: Rate, t: float, y: Floats) -> Floats:
    """Derivatives (ny, ny) of a derivative by the state, by central differences."""
    steps = _CUBE_ROOT * np.maximum(1.0, np.abs(y))
    columns = [derivative(t, y + change) - derivative(t, y - change) for change in np.diag(steps)]
    return np.column_stack(columns) / (2 * steps)


def strikes(
    contacts: Contacts, t: float, y: Floats, touching: Sequence[int], rest_speed: float
) -> Iterator[tuple[int, float, Floats]]:
    """Yield what strikes at one moment: contact, speed with which it closed, state after it.

    Of those in `touching` the one that closes fastest strikes, again and again, until none closes.
    One that closes more slowly than `rest_speed` strikes without bouncing, and so does each after
    `BOUNCES` strikes per contact. Raises `StepFailure` if `STRIKES` per contact do not end it.
    """
    where = list(touching)
    for count in range(STRIKES * len(where)):
        rates = contacts.rates(t, y)[where]
        first = int(np.argmin(rates))
        speed = -float(rates[first])
        if not speed > STILL:
            return
        bounces = speed >= rest_speed and count < BOUNCES * len(where)
        y = contacts.impact(t, y, where[first], 1.0 if bounces else 0.0)
        yield where[first], speed, y
    names = ", ".join(contacts.names[k] for k in where)
    raise StepFailure(
        f"the impacts among {names} at t = {t:.6g} come to no end; take less restitution"
    )


def still(contacts: Contacts, t: float, y: Floats, touching: Sequence[int]) -> list[int]:
    """Those in `touching` that are to be held: they neither part nor would without a force."""
    rates = contacts.rates(t, y)
    slow = [k for k in touching if rates[k] <= STILL]
    if not slow:
        return []
    _, pushes, parts = Holding(contacts, tuple(slow), (t, y)).solve(t, y)
    return [
        k for k, push, part in zip(slow, pushes, parts, strict=True) if push > 0 or part <= PARTING
    ]


def check_depth(contacts: Contacts, t: float, y: Floats) -> None:
    """Raise `StepFailure` if a contact is deeper than `TOLERANCE`."""
    gaps = contacts.gaps(t, y)
    deepest = int(np.argmin(gaps))
    if gaps[deepest] < -TOLERANCE:
        raise StepFailure(
            f"contact {contacts.names[deepest]} starts {-gaps[deepest]:.3g} deep; "
            "move its bodies apart in the initial state"
        )
