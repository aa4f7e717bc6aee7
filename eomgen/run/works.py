"""Where energy goes: the work that each effect does along a run."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from eomgen.run.problem import Contacts, Floats, Problem

if TYPE_CHECKING:  # it loads SciPy, which a module that is generated alone does not need
    from eomgen.run.integrators.interface import Advance

NODES = 5
"""Gauss–Legendre nodes on each step: exact for powers that are polynomials of degree 9."""


@dataclass(frozen=True, eq=False)
class Powers:
    """What is asked of a mechanism to know the work of its effects.

    names           of its effects
    powers          (t, y) -> one for each, W, but for those of rigid contacts
    kinetic_energy  (t, y) -> J, whose jump at an impact is the work of what struck
    """

    names: tuple[str, ...]
    powers: Callable[[float, Floats], Floats]
    kinetic_energy: Callable[[float, Floats], float]


def _gauss() -> tuple[Floats, Floats]:
    """Nodes (5,) on 0 to 1, and the matrix whose product with values there gives the coefficients,
    from the first power on, of the integral from 0 of the polynomial through them.
    """
    nodes = (np.polynomial.legendre.leggauss(NODES)[0] + 1) / 2
    orders = np.arange(NODES)
    return nodes, np.linalg.inv(nodes[:, None] ** orders) / (orders[:, None] + 1)


_AT, _INTEGRAL = _gauss()


class Account:
    """Books the works of effects, step after step; `total` (m,) stands at the last one's end, J.

    The powers are integrated over each step by Gauss's rule. The states there are those of the
    method where it is `dense`; else they are the cubic's that has the step's ends and slopes, of
    order 4 as the best of the methods that need it.
    """

    def __init__(self, powers: Powers, contacts: Contacts | None, dense: bool) -> None:
        booked = contacts.effects if contacts else ()
        self.names = tuple(dict.fromkeys((*powers.names, *booked)))
        self.total = np.zeros(len(self.names))
        self._powers = powers
        self._dense = dense
        self._slots = [self.names.index(effect) for effect in booked]
        self._last: tuple[Problem, Floats, Floats] | None = None

    def book(self, t: float, y: Floats, advance: "Advance") -> list[Floats]:
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
        times = (t + length * _AT).tolist()
        values = np.array([self._at(time, state(time), advance) for time in times])
        integral = length * (_INTEGRAL @ values)

        def until(s: float) -> Floats:
            return np.asarray(self.total + s ** np.arange(1, NODES + 1) @ integral)

        works = [until((time - t) / length) for time, _ in advance.samples]
        self.total = until(1.0)
        return works

    def _at(self, t: float, y: Floats, advance: "Advance") -> Floats:
        """All powers at one time, (m,)."""
        powers = np.zeros(len(self.names))
        powers[: len(self._powers.names)] = self._powers.powers(t, y)
        if advance.contact_powers is not None:
            np.add.at(powers, self._slots, advance.contact_powers(t, y))
        return powers

    def _cubic(self, t: float, y: Floats, advance: "Advance") -> Callable[[float], Floats]:
        """Hermite's cubic through both ends of a step, with the slopes there."""
        problem, length = advance.problem, advance.t - t
        if self._last is not None and self._last[0] is problem and self._last[1] is y:
            slope = self._last[2]
        else:
            slope = problem.derivative(t, y)
        end = problem.derivative(advance.t, advance.y)
        self._last = (problem, advance.y, end)
        change = (advance.y - y) / length

        def state(time: float) -> Floats:
            s = (time - t) / length
            bend = (s - 1) * ((1 - 2 * s) * change + (s - 1) * slope + s * end)
            return problem.unit(y + (time - t) * (change + bend))

        return state
