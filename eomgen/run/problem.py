"""What an integrator needs to know of a mechanism: its derivative, its Jacobian, its start."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eomgen.errors import RunError
from eomgen.run.intervals import Interval
from eomgen.run.origin import Origin

FloatArray = NDArray[np.float64]
"""An array of 64-bit floats; every state vector is one."""


class Explanation(NamedTuple):
    """Why a run cannot start or go on at a state, and what to change."""

    reason: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.reason}; {self.remedy}"


Explain = Callable[[float, FloatArray, FloatArray], Explanation | None]
"""`explain(t, y, initial)`: why the derivative at t, y is not finite, or has grown very large since
the initial state; None if that is not known."""


def unexplained(t: float, y: FloatArray, initial: FloatArray) -> None:
    """An `Explain` without a model: it knows no reason."""


SHORTEST = 1e-150
"""A quaternion shorter than this says no orientation: its square is no number."""


@dataclass(frozen=True, eq=False)
class Contacts:
    """What a mechanism's nc rigid contacts do; a contact touches where its gap is 0.

    names, effects  of each contact, and of the effect that its work is booked under
    gaps            (t, y) -> (nc,), m or rad, > 0 apart
    rates           (t, y) -> (nc,), their time derivatives
    impact          (t, y, contact, bounce) -> (ny,), the state after contact number `contact` has
                    struck, its restitution multiplied by `bounce` (0: perfectly plastic)
    held            (t, y, forces (nc,)) -> (ny + 2 nc + nd,), affine in the forces (N or N m):
                    under normal forces of the contacts, and the friction they cause, the state's
                    derivative, the gaps' second derivatives, the powers (W) of the contacts and
                    of the drives
    drives          effects (nd) that drive joints: what they do depends on the contacts' forces
    sizes           of the mechanism, in each gap's unit: gaps are judged in parts of it, see
                    `contacts.TOLERANCE`; 1 of each if not given
    """

    names: tuple[str, ...]
    effects: tuple[str, ...]
    gaps: Callable[[float, FloatArray], FloatArray]
    rates: Callable[[float, FloatArray], FloatArray]
    impact: Callable[[float, FloatArray, int, float], FloatArray]
    held: Callable[[float, FloatArray, FloatArray], FloatArray]
    drives: tuple[str, ...] = ()
    sizes: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Switching:
    """The switching functions of a derivative, which is smooth as long as none of them passes 0.

    of_state  (t, y) -> (ns,), those that depend on the state; None if there are none
    timed     whether they depend on time, too
    angles    indices of the states that are angles, rad, which sines are taken of
    of_time   those that depend on time alone, over an interval of it; None if there are none
    """

    of_state: Callable[[float, FloatArray], FloatArray] | None = None
    timed: bool = False
    angles: tuple[int, ...] = ()
    of_time: Callable[[Interval], Sequence[Interval]] | None = None


@dataclass(frozen=True, eq=False)
class Problem:
    """The initial-value problem y' = f(t, y), y(t_start) = initial.

    name        what messages and files call it
    states      names of the ny states, in order
    positions   indices of the states that are positions; the others, velocities, momenta and
                the states of controllers, are what a force changes
    derivative  f(t, y) -> (ny,), in SI units per second
    jacobian    df/dy(t, y) -> (ny, ny), exact
    initial     (ny,), kept as a read-only copy
    quaternions indices of the four components of each unit quaternion among the states
    contacts    what must not pass through each other; None where nothing can touch
    explain     see `Explain`
    sizes       (ny,), of each state, in its unit, what the default of atol is a part of; 1 of each
                if not given
    noise       gives (ny,), the most that rounding of the derivative moves each state in a step at
                the start of a run of some s (`run.noise`); None where that is not known
    operations  of one call of a function, by its name, as far as they are known
    columns     whether the Jacobian is computed along all directions at once
    corners     whether the derivative has corners or jumps, as one-sided forces have: a long step
                might leap over what begins and ends within it
    switching   where these corners are; None where that is not known
    origin      what it was made of, which a run that goes on is held to; None if not known

    Raises `RunError` if `initial` has not one finite number per state, or if a quaternion has no
    length there.
    """

    name: str
    states: tuple[str, ...]
    positions: tuple[int, ...]
    derivative: Callable[[float, FloatArray], FloatArray]
    jacobian: Callable[[float, FloatArray], FloatArray]
    initial: FloatArray
    quaternions: tuple[tuple[int, int, int, int], ...] = ()
    contacts: Contacts | None = None
    explain: Explain = unexplained
    corners: bool = False
    switching: Switching | None = None
    sizes: tuple[float, ...] = ()
    origin: Origin | None = None
    noise: Callable[[float], FloatArray] | None = None
    operations: Mapping[str, int] = field(default_factory=dict)
    columns: bool = False

    def __post_init__(self) -> None:
        initial = np.array(self.initial, dtype=np.float64)
        if initial.shape != (len(self.states),):
            raise RunError(
                f"initial: has shape {initial.shape}, but {self.name} has "
                f"{len(self.states)} states; give one number for each"
            )
        for state, value in zip(self.states, initial.tolist(), strict=True):
            if not np.isfinite(value):
                raise RunError(f"initial: {state} = {value} is not finite")
        for indices in self.quaternions:
            if math.hypot(*(float(initial[i]) for i in indices)) < SHORTEST:
                raise RunError(
                    f"initial: the quaternion from {self.states[indices[0]]} on has no length; "
                    "give 1, 0, 0, 0 for no turn"
                )
        assert len(set(self.positions)) == len(self.positions)
        assert all(0 <= index < len(self.states) for index in self.positions)
        initial.flags.writeable = False
        object.__setattr__(self, "initial", initial)

    def unit(self, y: FloatArray) -> FloatArray:
        """Return the state `y` (ny,) with its quaternions scaled to unit length.

        The exact motion stays on that sphere; a step leaves it by its own error, and scaling, which
        goes back to the nearest point, keeps the order of the method: Hairer, Lubich, Wanner,
        Geometric Numerical Integration, section IV.4. What is not finite is left as it is.
        """
        if not self.quaternions:
            return y
        values = y.tolist()
        for indices in self.quaternions:
            length = math.hypot(*(values[i] for i in indices))
            if math.isfinite(length):
                for i in indices:
                    values[i] /= length
        return np.array(values)
