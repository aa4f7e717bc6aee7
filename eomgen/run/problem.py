"""The initial-value problem of a mechanism, as integrators need it."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eomgen.base.errors import RunError
from eomgen.engine import quaternions
from eomgen.run.compiled import Compiled, Series
from eomgen.run.intervals import Interval
from eomgen.run.localised import Scrutiny
from eomgen.run.origin import Origin
from eomgen.run.projection import Projection
from eomgen.run.rows import all_finite
from eomgen.run.solved_loops import SolvedLoops

FloatArray = NDArray[np.float64]
"""An array of 64-bit floats, such as a state."""


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


USUAL_LENGTH = (quaternions.SHORTEST, quaternions.LONGEST)
"""Bounds of lengths whose squares neither overflow nor underflow."""
SHORTEST = 1e-150
"""A quaternion shorter than this gives no orientation: its square underflows."""


@dataclass(frozen=True, eq=False)
class Contacts:
    """The nc rigid contacts of a mechanism; a contact touches if its gap is 0.

    names, effects  names of the contacts, and of the effects to which their works belong
    gaps            (t, y) -> (nc,), m or rad, positive if apart
    rates           (t, y) -> (nc,), their time derivatives
    impact          (t, y, contact, bounce) -> (ny,), the state after an impact of contact number
                    `contact`, whose restitution is multiplied by `bounce` (0: perfectly plastic)
    held            (t, y, forces (nc,)) -> (ny + 2 nc + nd,): under normal forces of the contacts
                    (N or N m) and the friction they cause, the derivative of the state, the
                    second derivatives of the gaps, and the powers of the contacts and of the
                    drives, W; all affine in the forces
    drives          effects (nd) that drive joints: their powers depend on the contact forces
    sizes           size of the mechanism in the unit of each gap, to which tolerances are
                    relative, see `contacts.TOLERANCE`; 1 if not given
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
    """The switching functions of a derivative, which is smooth while none of them crosses 0.

    of_state  (t, y) -> (ns,), those that depend on the state; None if there are none
    timed     whether these depend on time, too
    angles    indices of the states that are angles, rad
    of_time   those that depend on time alone, as a function of an interval; None if there are none
    """

    of_state: Callable[[float, FloatArray], FloatArray] | None = None
    timed: bool = False
    angles: tuple[int, ...] = ()
    of_time: Callable[[Interval], Sequence[Interval]] | None = None


@dataclass(frozen=True, eq=False)
class Problem:
    """The initial-value problem y' = f(t, y), y(t_start) = initial.

    name        name in messages and files
    states      names of the ny states, in order
    positions   indices of the states that are positions; the others are velocities, momenta and
                states of controllers
    derivative  f(t, y) -> (ny,), in SI units per second
    jacobian    df/dy(t, y) -> (ny, ny), exact
    initial     (ny,), kept as a read-only copy
    quaternions indices of the four components of each unit quaternion among the states
    contacts    rigid contacts; None if there are none
    explain     see `Explain`
    sizes       (ny,), size of each state in its unit, to which the default atol is relative; 1 if
                not given
    noise       returns (ny,), for the length of a run in s, the greatest change of each state in a
                step at the start by rounding errors of the derivative (`run.noise`); None if not
                known
    operations  number of operations in a call of a function, by its name, as far as known
    columns     whether the Jacobian is computed along all directions at once
    timed       whether the derivative depends on time beside the state
    corners     whether the derivative has corners or jumps, as with one-sided forces: a long step
                might pass over what begins and ends within it
    switching   the switching functions of these corners; None if not known
    origin      what the motion depends on, to check runs that continue; None if not known
    compiled    steps of `derivative` in compiled code; None if there are none
    series      makes the Taylor series of the solutions, by the name of the method that takes them;
                raises `RunError` where that is not possible
    projection  onto the constraints; None if there are none
    solved_loops the constraints that are kept in closed form; None if there are none
    sampling    controllers that sample; None if there are none
    scrutiny    what is checked beside that; None for an ordinary run
    implicit_step (t, y, h) -> (ny,), the change of the state in a step that is implicit in stiff
                forces; None if the module does not have it

    Raises `RunError` if `initial` does not have one finite number for each state, or if a
    quaternion in it is 0.
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
    timed: bool = True
    compiled: Compiled | None = None
    series: Mapping[str, Callable[[], Series]] = field(default_factory=dict)
    projection: Projection | None = None
    solved_loops: SolvedLoops | None = None
    scrutiny: Scrutiny | None = None
    sampling: Any = None  # a `run.sampling.Sampling`, which knows problems
    implicit_step: Callable[[float, FloatArray, float], FloatArray] | None = None

    def __post_init__(self) -> None:
        initial = np.array(self.initial, dtype=np.float64)
        if initial.shape != (len(self.states),):
            raise RunError(
                f"initial: has shape {initial.shape}, but {self.name} has "
                f"{len(self.states)} states; give one number for each"
            )
        if not all_finite(initial):
            state, value = next(
                pair
                for pair in zip(self.states, initial.tolist(), strict=True)
                if not math.isfinite(pair[1])
            )
            raise RunError(f"initial: {state} = {value} is not finite")
        for indices in self.quaternions:
            if math.hypot(*(float(initial[i]) for i in indices)) < SHORTEST:
                raise RunError(
                    f"initial: the quaternion that starts at {self.states[indices[0]]} has no "
                    "length; "
                    "give 1, 0, 0, 0 for no rotation"
                )
        assert len(set(self.positions)) == len(self.positions)
        assert all(0 <= index < len(self.states) for index in self.positions)
        initial.flags.writeable = False
        object.__setattr__(self, "initial", initial)

    def having(self, **functions: Any) -> "Problem":
        """The same problem with other functions; its initial state is not checked again."""
        made = object.__new__(type(self))
        made.__dict__.update(self.__dict__, **functions)
        return made

    @property
    def leading_positions(self) -> int:
        """The number of positions if these are the first states; else 0."""
        count = len(self.positions)
        return count if self.positions == tuple(range(count)) else 0

    def projected(self, t: float, y: FloatArray) -> FloatArray:
        """The state `y` at t with normalised quaternions, on the constraints if there are any.

        Raises `StepFailure` if the constraints cannot be met near the state.
        """
        y = self.unit(y)
        return y if self.projection is None else self.projection.onto(t, y, self.unit)

    def unit(self, y: FloatArray) -> FloatArray:
        """The state `y` (ny,) with normalised quaternions; those that are not finite stay as is."""
        if not self.quaternions:
            return y
        values: Any = y.tolist()
        if not quaternions.normalised(len(self.quaternions), self._places, values):
            values = y.tolist()
            for indices in self.quaternions:
                length = math.hypot(*(values[i] for i in indices))
                if math.isfinite(length):
                    for i in indices:
                        values[i] /= length
        return np.array(values)

    @cached_property
    def _places(self) -> Any:
        return [i for indices in self.quaternions for i in indices]
