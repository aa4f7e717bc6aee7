"""Rigid contacts: forces of those that are held, and impacts of those that close.

Nothing here has a unit of its own: gaps are counted in the size of the mechanism, `Contacts.sizes`,
speeds and accelerations in those of its motion. So a scene in other units, of molecules or of
planets, runs as it does in metres and seconds; `in_sizes` is what makes it so.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from eomgen.run.complementarity import complementary
from eomgen.run.integrators.interface import StepFailure
from eomgen.run.problem import Contacts, FloatArray, Problem

TOLERANCE = 1e-9
"""In sizes: contacts this close touch, and may start this deep."""

STILL = 3e-11
"""In speeds of the motion: contacts that close more slowly do not close."""

PARTING = 1e-10
"""In accelerations of the motion: contacts without a force that part with less stay as they are."""

ALPHA = 10 / math.sqrt(9.81)
"""In rates of the motion: what a held contact is off by, it leaves behind at this rate. It is 10/s
for a mechanism of one metre under gravity."""

RISE = 5e-8
"""In sizes: a bounce that will not rise higher than this is none, unless `rest_speed` says so."""

AWAY = 1e-6
"""In accelerations of the motion: a gap that grows at more than this does so of itself."""

STRONG = 2.0**400
"""N or N m: a force beside which all others are nothing, whatever it moves."""

BOUNCES, STRIKES = 100, 5000
"""Strikes at one moment, per contact: with restitution, and in all."""

_CUBE_ROOT = np.finfo(float).eps ** (1 / 3)


Rate = Callable[[float, FloatArray], FloatArray]
"""A function of time and state, such as the derivative."""


def in_sizes(contacts: Contacts) -> Contacts:
    """The same contacts, their gaps and what these do counted in sizes."""
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
    """The rate at which contacts recover from drift, 1/s, in a run of `span` s: `ALPHA` times that
    of the motion at its start, √(a/size) of what accelerates the gaps, or v/size.
    """
    fastest = float(np.abs(contacts.rates(t, y)).max())
    return ALPHA * max(math.sqrt(pressed(contacts, t, y)), fastest, 1 / span)


def pressed(contacts: Contacts, t: float, y: FloatArray) -> float:
    """The greatest acceleration of any gap, either way, without contact forces: sizes/s²."""
    return float(np.abs(accelerations(contacts, t, y)).max())


def accelerations(contacts: Contacts, t: float, y: FloatArray) -> FloatArray:
    """Those of the gaps (nc,), without contact forces: sizes/s²."""
    count = len(contacts.names)
    return contacts.held(t, y, np.zeros(count))[len(y) : len(y) + count]


def slowest_bounces(free: FloatArray, rest_speed: FloatArray | None) -> FloatArray:
    """With what speed each contact must close to bounce (nc,), sizes/s: `rest_speed` if given, or
    that from which the bounce rises by `RISE` under the accelerations `free` of the gaps.

    One that parts of itself, as what grazes along a curve does, bounces at any: its bounces come to
    an end without, and to stop them would stop what slides by.
    """
    force = float(np.abs(free).max())
    # What strikes at v under the acceleration a rises by v²/2a.
    rising = np.full(len(free), math.sqrt(2 * RISE * force))
    return np.where(free > AWAY * force, 0.0, rising if rest_speed is None else rest_speed)


@dataclass(frozen=True, eq=False)
class Holding:
    """Some contacts of a mechanism, held: they may part, but not close.

    Their forces f solve 0 <= f, 0 <= a, f a = 0 with a = gap'' + 2 α gap' + α² gap, which is affine
    in the forces; α = `alpha` (Baumgarte's stabilisation with both roots at -α) takes drift back.
    """

    contacts: Contacts
    held: tuple[int, ...]
    start: tuple[float, FloatArray]
    alpha: float

    @cached_property
    def pressed(self) -> float:
        """The greatest acceleration of any gap under no contact force at the start, or that of the
        motion, if it is more: bodies that move alike do not accelerate their gaps.
        """
        return max(pressed(self.contacts, *self.start), self._usual)

    @property
    def _usual(self) -> float:
        """An acceleration of the motion, sizes/s²: see `recovery`."""
        return (self.alpha / ALPHA) ** 2

    @cached_property
    def units(self) -> FloatArray:
        """Forces (nh,) that accelerate each gap about as all else does: differences keep their
        digits.
        """
        matrix, _, _ = self._system(*self.start, np.full(len(self.held), STRONG))
        own = np.abs(np.diagonal(matrix)) / STRONG
        return self.pressed / np.where(own > 0, own, self.pressed)

    def solve(self, t: float, y: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return what `Contacts.held` gives (ny + 2 nc + nd,), and (nh,) each: forces times what
        they do to their own gaps, and a, or 0 where that is nothing beside what else accelerates.

        Raises `StepFailure` if no forces keep the contacts from closing.
        """
        matrix, offset, columns = self._system(t, y, self.units)
        forces = complementary(matrix, offset)
        if forces is None:
            names = ", ".join(self.contacts.names[k] for k in self.held)
            raise StepFailure(
                f"no contact forces at t = {t:.6g} keep {names} from closing (much friction may do "
                "that)",
                "take less friction, or another law of contact",
            )
        result = columns[:, 0] + (columns[:, 1:] - columns[:, :1]) @ forces
        left = matrix @ forces + offset
        usual = max(float(np.abs(columns[self._gaps, 0]).max()), self._usual)
        left[np.abs(left) <= PARTING * usual] = 0.0
        return result, forces * np.diagonal(matrix), left

    def derivative(self, t: float, y: FloatArray) -> FloatArray:
        """The state's derivative (ny,) under the contacts' forces."""
        return self.solve(t, y)[0][: len(y)]

    def powers(self, t: float, y: FloatArray) -> FloatArray:
        """What the contacts' forces and the drives do (nc + nd,), W."""
        return self.solve(t, y)[0][len(y) + len(self.contacts.names) :]

    @property
    def _gaps(self) -> slice:
        """Where `Contacts.held` has the gaps' accelerations."""
        states = len(self.start[1])
        return slice(states, states + len(self.contacts.names))

    def _system(
        self, t: float, y: FloatArray, units: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Matrix and offset of a, and the columns that `Contacts.held` gives: under no force, and
        under the unit of each.
        """
        held = list(self.held)
        forces = np.zeros((len(held) + 1, len(self.contacts.names)))
        forces[range(1, len(held) + 1), held] = units
        # One at a time: scalar code, ten times as fast as columns where there are few.
        columns = np.column_stack([self.contacts.held(t, y, each) for each in forces])
        gaps, rates = self.contacts.gaps(t, y)[held], self.contacts.rates(t, y)[held]
        free = columns[self._gaps][held]
        offset = free[:, 0] + 2 * self.alpha * rates + self.alpha**2 * gaps
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
    sizes = np.array(problem.sizes or (1.0,))
    return replace(
        problem, derivative=derivative, jacobian=partial(_differences, derivative, sizes)
    )


def _differences(derivative: Rate, sizes: FloatArray, t: float, y: FloatArray) -> FloatArray:
    """Derivatives (ny, ny) of a derivative by a state of such sizes, by central differences."""
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
    """Yield what strikes at one moment: contact, speed with which it closed, state after it.

    Of those in `touching` the one that closes fastest strikes, again and again, until none closes
    faster than `nothing`. One that closes more slowly than its `least` (nc,) strikes without
    bouncing, and so does each after `BOUNCES` strikes per contact. Raises `StepFailure` if
    `STRIKES` per contact do not end it.
    """
    where = list(touching)
    for count in range(STRIKES * len(where)):
        rates = contacts.rates(t, y)[where]
        first = int(np.argmin(rates))
        speed = -float(rates[first])
        if not speed > nothing:
            return
        bounces = speed >= least[where[first]] and count < BOUNCES * len(where)
        y = contacts.impact(t, y, where[first], 1.0 if bounces else 0.0)
        yield where[first], speed, y
    names = ", ".join(contacts.names[k] for k in where)
    raise StepFailure(
        f"the impacts among {names} at t = {t:.6g} come to no end", "take less restitution"
    )


def still(
    contacts: Contacts,
    t: float,
    y: FloatArray,
    touching: Sequence[int],
    nothing: float,
    alpha: float,
) -> list[int]:
    """Those in `touching` that are to be held: they neither part, faster than `nothing`, nor would
    without a force.
    """
    rates = contacts.rates(t, y)
    slow = [k for k in touching if rates[k] <= nothing]
    if not slow:
        return []
    _, pushes, parts = Holding(contacts, tuple(slow), (t, y), alpha).solve(t, y)
    return [k for k, push, part in zip(slow, pushes, parts, strict=True) if push > 0 or part <= 0]


def check_depth(contacts: Contacts, t: float, y: FloatArray) -> None:
    """Raise `StepFailure` if a contact is deeper than `TOLERANCE`."""
    gaps = contacts.gaps(t, y)
    deepest = int(np.argmin(gaps))
    if gaps[deepest] < -TOLERANCE:
        depth = -gaps[deepest] * (contacts.sizes[deepest] if contacts.sizes else 1.0)
        raise StepFailure(
            f"contact {contacts.names[deepest]} starts {depth:.3g} deep",
            "move its bodies apart in the initial state",
        )
