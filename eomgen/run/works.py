"""The work of each effect along a run."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from eomgen.run.problem import Contacts, FloatArray, Problem

if TYPE_CHECKING:  # it loads SciPy, which generating a module does not need
    from eomgen.run.integrators.interface import Advance

NODES = 5
"""Gauss–Legendre nodes on each step: exact for powers that are polynomials of degree 9."""

ROUGH = 1e-6
"""A step is halved if the rule with every other node differs from the full one by more than this,
relative to power times step. That rule has order 4; the full one has order 6 within the step and 10
at its end. Errors of works are then about 1e-7 within the step, and 1e-12 at its end."""

SLIGHT = 1e-10
"""Smaller differences, relative to the largest work so far, are ignored as rounding errors."""

HALVINGS = 8
"""Greatest number of halvings, for powers that jump."""


@dataclass(frozen=True, eq=False)
class Powers:
    """What a mechanism must give to compute the work of its effects.

    names           names of the effects
    powers          (t, y) -> their powers, W, without those of rigid contacts
    kinetic_energy  (t, y) -> J; its jump at an impact is the work of the contact
    """

    names: tuple[str, ...]
    powers: Callable[[float, FloatArray], FloatArray]
    kinetic_energy: Callable[[float, FloatArray], float]


def _gauss() -> tuple[FloatArray, FloatArray]:
    """Nodes (5,) in 0 to 1, and the matrix (5, 5) from values there to the coefficients, from the
    first power on, of the integral from 0 of the interpolating polynomial.
    """
    nodes = (np.polynomial.legendre.leggauss(NODES)[0] + 1) / 2
    orders = np.arange(NODES)
    return nodes, np.linalg.inv(nodes[:, None] ** orders) / (orders[:, None] + 1)


_AT, _INTEGRAL = _gauss()
_FEWER = np.zeros(NODES)
_FEWER[::2] = np.linalg.inv(_AT[::2][:, None] ** np.arange(3)).T @ (1 / np.arange(1, 4))
_ERROR = _FEWER - _INTEGRAL.sum(axis=0)
"""Weights of the difference between the rule with every other node and the full rule."""


class Account:
    """The works of effects, accumulated step by step; `total` (m,) is at the end of the last, J.

    The powers are integrated over each step by Gaussian quadrature, or over parts of the step where
    they vary faster than the state: the method's step does not resolve a drive, for example, that
    moves a body without changing the state. States within the step come from the method's dense
    output if it is `dense`, else from the cubic Hermite interpolant, of order 4.
    """

    def __init__(self, powers: Powers, contacts: Contacts | None, dense: bool) -> None:
        booked = contacts.effects if contacts else ()
        self.names = tuple(dict.fromkeys((*powers.names, *booked)))
        self.total = np.zeros(len(self.names))
        self._largest = 0.0
        self._powers = powers
        self._dense = dense
        self._slots = [self.names.index(effect) for effect in booked]
        self._drives = [self.names.index(effect) for effect in contacts.drives] if contacts else []
        self._last: tuple[Problem, FloatArray, FloatArray] | None = None

    def book(self, t: float, y: FloatArray, advance: "Advance") -> list[FloatArray]:
        """Add a step or an impact from state `y` at `t`; return the works at its samples."""
        if advance.struck is not None:
            energy = self._powers.kinetic_energy
            slot = self._slots[advance.struck]
            self.total = self.total.copy()
            self.total[slot] += energy(advance.t, advance.y) - energy(t, y)
        length = advance.t - t
        if not advance.steps or length <= 0:
            return [self.total for _ in advance.samples]
        state = advance.within if self._dense else self._cubic(t, y, advance)
        times = [time for time, _ in advance.samples]
        works: list[FloatArray] = []

        def powers(time: float) -> FloatArray:
            return self._at(time, state(time), advance)

        slight = SLIGHT * self._largest
        for start, end, integral in _parts(powers, t, advance.t, slight):
            while len(works) < len(times) and times[len(works)] <= end:
                s = (times[len(works)] - start) / (end - start)
                works.append(np.asarray(self.total + s ** np.arange(1, NODES + 1) @ integral))
            self.total = self.total + integral.sum(axis=0)
        self._largest = max(self._largest, float(np.abs(self.total).max(initial=0.0)))
        return works

    def _at(self, t: float, y: FloatArray, advance: "Advance") -> FloatArray:
        """All powers at a time, (m,), W."""
        powers = np.zeros(len(self.names))
        powers[: len(self._powers.names)] = self._powers.powers(t, y)
        if advance.contact_powers is not None:
            found = advance.contact_powers(t, y)
            count = len(self._slots)
            np.add.at(powers, self._slots, found[:count])
            powers[self._drives] = found[count:]
        return powers

    def _cubic(self, t: float, y: FloatArray, advance: "Advance") -> Callable[[float], FloatArray]:
        """The cubic Hermite interpolant of a step, from the states and slopes at its ends."""
        problem, length = advance.problem, advance.t - t
        if self._last is not None and self._last[0] is problem and self._last[1] is y:
            slope = self._last[2]
        else:
            slope = problem.derivative(t, y)
        end = problem.derivative(advance.t, advance.y)
        self._last = (problem, advance.y, end)
        change = (advance.y - y) / length

        def state(time: float) -> FloatArray:
            s = (time - t) / length
            bend = (s - 1) * ((1 - 2 * s) * change + (s - 1) * slope + s * end)
            return problem.projected(time, y + (time - t) * (change + bend))

        return state


def _parts(
    powers: Callable[[float], FloatArray], start: float, end: float, slight: float
) -> Iterator[tuple[float, float, FloatArray]]:
    """Yield parts of the time from `start` to `end`, each with the coefficients (NODES, m) of the
    works done in it, as polynomials in the fraction of its time, from the first power on. A part
    with an error below `slight`, J, is not divided.
    """
    size = 0.0
    waiting = [(start, end, HALVINGS)]
    while waiting:
        a, b, halvings = waiting.pop()
        values = np.array([powers(time) for time in (a + (b - a) * _AT).tolist()])
        size = max(size, float(np.abs(values).max(initial=0.0)) * (end - start))
        error = np.abs((b - a) * (_ERROR @ values)).max(initial=0.0)
        middle = (a + b) / 2
        if error > max(ROUGH * size, slight) and halvings and a < middle < b:
            waiting += [(middle, b, halvings - 1), (a, middle, halvings - 1)]
        else:
            yield a, b, (b - a) * (_INTEGRAL @ values)
