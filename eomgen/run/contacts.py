"""Rigid contacts: forces of contacts that are held, and impacts of contacts that close.

All tolerances are dimensionless: gaps are relative to the size of the mechanism, `Contacts.sizes`,
speeds and accelerations to those of its motion. So a scene in other units, or of another scale,
runs alike. `in_sizes` scales the gaps.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from eomgen.engine.complementarity import complementary
from eomgen.run.failure import StepFailure
from eomgen.run.problem import Contacts, FloatArray, Problem
from eomgen.subset.words import numbers

TOLERANCE = 1e-9
"""Contacts with gaps below this touch, and may penetrate by this at the start; in sizes."""

STILL = 3e-11
"""Contacts that close more slowly than this do not strike; in speeds of the motion."""

PARTING = 1e-10
"""A contact without force whose gap accelerates less than this does not open; in accelerations of
the motion."""

ALPHA = 10 / math.sqrt(9.81)
"""The rate at which the drift of held contacts decays, in rates of the motion: 10/s for a mechanism
of one metre under gravity."""

RISE = 5e-8
"""A contact that would rise less than this does not bounce, unless `rest_speed` is given; in sizes.
"""

AWAY = 1e-6
"""A gap that accelerates by more than this without contact forces opens by itself; in accelerations
of the motion."""

STRONG = 2.0**400
"""A force beside which all others are negligible, N or N m."""

BOUNCES, STRIKES = 100, 5000
"""Greatest number of strikes at one time, per contact: with restitution, and in all."""

_CUBE_ROOT = np.finfo(float).eps ** (1 / 3)


Rate = Callable[[float, FloatArray], FloatArray]
"""A function of time and state, such as the derivative."""


def in_sizes(contacts: Contacts) -> Contacts:
    """The same contacts with gaps, their rates and accelerations relative to `Contacts.sizes`."""
    sizes = np.array(contacts.sizes or np.ones(len(contacts.names)))
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


def recovery(contacts: Contacts, t: float, y: FloatArray, span: float) -> float:
    """The rate at which the drift of contacts decays in a run of `span` s, 1/s: `ALPHA` times the
    rate of the motion at its start, the greater of √a and v of the gaps in sizes.
    """
    fastest = float(np.abs(contacts.rates(t, y)).max())
    return ALPHA * max(math.sqrt(largest_acceleration(contacts, t, y)), fastest, 1 / span)


def largest_acceleration(contacts: Contacts, t: float, y: FloatArray) -> float:
    """The greatest magnitude of `accelerations`, sizes/s²."""
    return float(np.abs(accelerations(contacts, t, y)).max())


def accelerations(contacts: Contacts, t: float, y: FloatArray) -> FloatArray:
    """The accelerations of the gaps without contact forces, (nc,), sizes/s²."""
    count = len(contacts.names)
    return contacts.held(t, y, np.zeros(count))[len(y) : len(y) + count]


def slowest_bounces(free: FloatArray, rest_speed: FloatArray | None) -> FloatArray:
    """The least closing speed with which each contact bounces (nc,), sizes/s: `rest_speed` if
    given, else that from which it would rise by `RISE` against the accelerations `free` of the
    gaps.

    A contact that opens by itself, as in grazing a curved surface, bounces at any speed: its
    bounces end anyway, and without them it would stick.
    """
    largest = float(np.abs(free).max())
    # A contact that leaves at v against the acceleration a rises by v²/2a.
    rising = np.full(len(free), math.sqrt(2 * RISE * largest))
    return np.where(free > AWAY * largest, 0.0, rising if rest_speed is None else rest_speed)


@dataclass(frozen=True, eq=False)
class Holding:
    """The forces of contacts that are held: they may open, but not close.

    The forces f solve 0 <= f, 0 <= a, f a = 0 with a = gap'' + 2 α gap' + α² gap, which is affine
    in f. With α = `alpha` drift decays (Baumgarte stabilisation with both roots at -α).
    """

    contacts: Contacts
    held: tuple[int, ...]
    start: tuple[float, FloatArray]
    alpha: float

    @cached_property
    def _largest_acceleration(self) -> float:
        """The greatest acceleration of any gap without contact forces at the start, but at least
        that of the motion: bodies that move together do not accelerate their gaps.
        """
        return max(largest_acceleration(self.contacts, *self.start), self._motion_acceleration)

    @property
    def _motion_acceleration(self) -> float:
        """The acceleration of the motion, sizes/s²: see `recovery`."""
        return (self.alpha / ALPHA) ** 2

    @cached_property
    def units(self) -> FloatArray:
        """For each contact a force (nh,) that accelerates its gap about as much as the other forces
        do, so that differences do not lose digits.
        """
        matrix, _, _ = self._system(*self.start, np.full(len(self.held), STRONG))
        own = np.abs(np.diagonal(matrix)) / STRONG
        largest = self._largest_acceleration
        return largest / np.where(own > 0, own, largest)

    def solve(self, t: float, y: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return what `Contacts.held` gives under the forces, (ny + 2 nc + nd,), and for each held
        contact, (nh,), the acceleration of its gap by its own force, and a, or 0 if a is
        negligible.

        Raises `StepFailure` if no forces keep the contacts from closing.
        """
        matrix, offset, columns = self._system(t, y, self.units)
        found = numbers(len(offset))
        if not complementary(len(offset), matrix.tolist(), offset.tolist(), found):
            names = ", ".join(self.contacts.names[k] for k in self.held)
            raise StepFailure(
                f"no contact forces at t = {t:.6g} keep {names} from closing (strong friction can "
                "cause this)",
                "take less friction, or another contact law",
            )
        forces = np.array(found)
        result = columns[:, 0] + (columns[:, 1:] - columns[:, :1]) @ forces
        left = matrix @ forces + offset
        scale = max(float(np.abs(columns[self._gaps, 0]).max()), self._motion_acceleration)
        left[np.abs(left) <= PARTING * scale] = 0.0
        return result, forces * np.diagonal(matrix), left

    def derivative(self, t: float, y: FloatArray) -> FloatArray:
        """The state's derivative (ny,) under the contacts' forces."""
        return self.solve(t, y)[0][: len(y)]

    def powers(self, t: float, y: FloatArray) -> FloatArray:
        """Powers of the contacts' forces and of the drives (nc + nd,), W."""
        return self.solve(t, y)[0][len(y) + len(self.contacts.names) :]

    @property
    def _gaps(self) -> slice:
        """The part of `Contacts.held` with the accelerations of the gaps."""
        states = len(self.start[1])
        return slice(states, states + len(self.contacts.names))

    def _system(
        self, t: float, y: FloatArray, units: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Matrix and offset of a, and the columns that `Contacts.held` gives without forces and
        under the unit force of each held contact.
        """
        held = list(self.held)
        forces = np.zeros((len(held) + 1, len(self.contacts.names)))
        forces[range(1, len(held) + 1), held] = units
        # One at a time: for few columns, scalar code is ten times as fast as arrays.
        columns = np.column_stack([self.contacts.held(t, y, each) for each in forces])
        gaps, rates = self.contacts.gaps(t, y)[held], self.contacts.rates(t, y)[held]
        free = columns[self._gaps][held]
        offset = free[:, 0] + 2 * self.alpha * rates + self.alpha**2 * gaps
        return free[:, 1:] - free[:, :1], offset, columns


def restrained(
    problem: Problem, holding: Holding | None, counted: Callable[[Rate], Rate]
) -> Problem:
    """The problem while contacts are held; its Jacobian is then computed by differences, and its
    steps are not compiled.

    `counted` wraps a function so that its calls count as derivatives.
    """
    if holding is None:
        return problem
    derivative = counted(holding.derivative)
    sizes = np.array(problem.sizes or (1.0,))
    jacobian = partial(_differences, derivative, sizes)
    return replace(
        problem, derivative=derivative, jacobian=jacobian, timed=True, compiled=None, series={}
    )


def _differences(derivative: Rate, sizes: FloatArray, t: float, y: FloatArray) -> FloatArray:
    """The Jacobian (ny, ny) of a derivative by central differences; `sizes` of the states."""
    steps = _CUBE_ROOT * np.maximum(sizes, np.abs(y))
    columns = [derivative(t, y + change) - derivative(t, y - change) for change in np.diag(steps)]
    return np.column_stack(columns) / (2 * steps)


def strikes(
    contacts: Contacts,
    t: float,
    y: FloatArray,
    touching: Sequence[int],
    least: FloatArray,
    nothing: float,
) -> Iterator[tuple[int, float, FloatArray]]:
    """Yield the strikes at time t: contact, closing speed, state after it.

    The contact in `touching` that closes fastest strikes, repeatedly, until none closes faster than
    `nothing`. A contact that closes more slowly than its `least` (nc,) does not bounce, and after
    `BOUNCES` strikes per contact none does. Raises `StepFailure` after `STRIKES` per contact.
    """
    candidates = list(touching)
    for count in range(STRIKES * len(candidates)):
        rates = contacts.rates(t, y)[candidates]
        fastest = int(np.argmin(rates))
        contact, speed = candidates[fastest], -float(rates[fastest])
        if not speed > nothing:
            return
        bounces = speed >= least[contact] and count < BOUNCES * len(candidates)
        y = contacts.impact(t, y, contact, 1.0 if bounces else 0.0)
        yield contact, speed, y
    names = ", ".join(contacts.names[k] for k in candidates)
    raise StepFailure(
        f"the impacts among {names} at t = {t:.6g} do not end", "take less restitution"
    )


def still(
    contacts: Contacts,
    t: float,
    y: FloatArray,
    touching: Sequence[int],
    nothing: float,
    alpha: float,
) -> list[int]:
    """The contacts in `touching` that are to be held: those that do not open faster than `nothing`
    and would not open without a force.
    """
    rates = contacts.rates(t, y)
    slow = [k for k in touching if rates[k] <= nothing]
    if not slow:
        return []
    _, pushes, parts = Holding(contacts, tuple(slow), (t, y), alpha).solve(t, y)
    return [k for k, push, part in zip(slow, pushes, parts, strict=True) if push > 0 or part <= 0]


def check_depth(contacts: Contacts, t: float, y: FloatArray) -> None:
    """Raise `StepFailure` if a contact penetrates by more than `TOLERANCE`."""
    gaps = contacts.gaps(t, y)
    deepest = int(np.argmin(gaps))
    if gaps[deepest] < -TOLERANCE:
        depth = -gaps[deepest] * (contacts.sizes[deepest] if contacts.sizes else 1.0)
        raise StepFailure(
            f"contact {contacts.names[deepest]} starts {depth:.3g} deep",
            "move its bodies apart in the initial state",
        )
