"""Where energy goes: the work that each effect does along a run."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from eomgen.run.problem import Contacts, FloatArray, Problem

if TYPE_CHECKING:  # it loads SciPy, which a module that is generated alone does not need
    from eomgen.run.integrators.interface import Advance

NODES = 5
"""Gauss–Legendre nodes on each step: exact for powers that are polynomials of degree 9."""

ROUGH = 1e-6
"""Of the power times the step: where every other node alone gives a work that is off by more, the
step is halved. That rule is of order 4, the whole one of order 6 within the step and 10 at its end,
so that works are then off by some 1e-7 of it there, and by 1e-12 at its end."""

SLIGHT = 1e-10
"""Of the largest work so far: less is not looked into, being rounding at rest."""

HALVINGS = 8
"""As often at most, for powers that jump."""


@dataclass(frozen=True, eq=False)
class Powers:
    """What is asked of a mechanism to know the work of its effects.

    names           of its effects
    powers          (t, y) -> one for each, W, but for those of rigid contacts
    kinetic_energy  (t, y) -> J, whose jump at an impact is the work of what struck
    """

    names: tuple[str, ...]
    powers: Callable[[float, FloatArray], FloatArray]
    kinetic_energy: Callable[[float, FloatArray], float]


def _gauss() -> tuple[FloatArray, FloatArray]:
    """Nodes (5,) on 0 to 1, and the matrix whose product with values there gives the coefficients,
    from the first power on, of the integral from 0 of the polynomial through them.
    """
    nodes = (np.polynomial.legendre.leggauss(NODES)[0] + 1) / 2
    orders = np.arange(NODES)
    return nodes, np.linalg.inv(nodes[:, None] ** orders) / (orders[:, None] + 1)


_AT, _INTEGRAL = _gauss()
_FEWER = np.zeros(NODES)
_FEWER[::2] = np.linalg.inv(_AT[::2][:, None] ** np.arange(3)).T @ (1 / np.arange(1, 4))
_DOUBT = _FEWER - _INTEGRAL.sum(axis=0)
"""Weights of the difference between the rule of every other node and the whole one."""


class Account:
    """Books the works of effects, step after step; `total` (m,) stands at the last one's end, J.

    The powers are integrated over each step by Gauss's rule, over parts of it where they change
    faster than the state: a method's step knows nothing of a drive, for example, that moves a body
    to and fro and nothing else. The states there are those of the method where it is `dense`; else
    they are the cubic's that has the step's ends and slopes, of order 4 as the best of the methods
    that need it.
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
        """Take up the step or strike from state `y` at `t`; return the works at its samples."""
        if advance.struck is not None:
            energy = self._powers.kinetic_energy
            slot = self._slots[advance.struck]
            self.total = self.total.copy()
            self.total[slot] += energy(advance.t, advance.y) - energy(t, y)
        length = advance.t - t
        if not advance.is_step or length <= 0:
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
        """All powers at one time, (m,)."""
        powers = np.zeros(len(self.names))
        powers[: len(self._powers.names)] = self._powers.powers(t, y)
        if advance.contact_powers is not None:
            found = advance.contact_powers(t, y)
            count = len(self._slots)
            np.add.at(powers, self._slots, found[:count])
            powers[self._drives] = found[count:]
        return powers

    def _cubic(self, t: float, y: FloatArray, advance: "Advance") -> Callable[[float], FloatArray]:
        """Hermite's cubic through both ends of a step, with the slopes there."""
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
            return problem.unit(y + (time - t) * (change + bend))

        return state


def _parts(
    powers: Callable[[float], FloatArray], start: float, end: float, slight: float
) -> Iterator[tuple[float, float, FloatArray]]:
    """Yield parts of the time from `start` to `end`, each with the coefficients (NODES, m) of the
    works done in it, from the first power on of the share of it that is over. What is off by less
    than `slight`, J, is let be.
    """
    size = 0.0
    waiting = [(start, end, HALVINGS)]
    while waiting:
        a, b, halvings = waiting.pop()
        values = np.array([powers(time) for time in (a + (b - a) * _AT).tolist()])
        size = max(size, float(np.abs(values).max(initial=0.0)) * (end - start))
        off = np.abs((b - a) * (_DOUBT @ values)).max(initial=0.0)
        middle = (a + b) / 2
        if off > max(ROUGH * size, slight) and halvings and a < middle < b:
            waiting += [(middle, b, halvings - 1), (a, middle, halvings - 1)]
        else:
            yield a, b, (b - a) * (_INTEGRAL @ values)
