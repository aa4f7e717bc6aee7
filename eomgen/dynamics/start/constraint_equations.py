"""The constraints of a mechanism as functions of its coordinates, and Newton's method on them."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eomgen.dynamics.dynamics import Dynamics
from eomgen.dynamics.loops import constraints
from eomgen.dynamics.loops.clusters import jacobian_of
from eomgen.dynamics.tree.frames import Linkage
from eomgen.dynamics.tree.linkage import make_linkage
from eomgen.model.model import Model
from eomgen.model.named import Values
from eomgen.program.program import Output, finish, interpreter
from eomgen.program.scalars import TapeScalars
from eomgen.program.tape import Stage, Tape
from eomgen.scalars.floats import FloatScalars
from eomgen.scene.joints.base import Coordinate

Array = NDArray[np.float64]

STEPS = 60
"""Most steps of Newton's method from one start."""
PATIENCE = 12
"""Steps that must reduce the sum of the residuals' squares by 30 %, or no position is near."""
CLOSED = 1e-12
"""A residual relative to the mechanism's size that is rounding."""
INDEPENDENT = 1e-7
"""A row that leaves less than this of itself beside the others follows from them."""

FINE = 32
"""Bits to which positions are rounded before they are closed by plain sums."""


@dataclass(frozen=True)
class ConstraintEquations:
    """A model's constraints as functions of the coordinates, at a time, s. Residuals and steps are
    in sizes.

    Where a formula has no value, as the asin of 2, residuals and J are nan.
    """

    model: Model
    size: float
    time: float = 0.0

    @classmethod
    def of(cls, model: Model) -> "ConstraintEquations":
        """Those of a model, in its own size."""
        return cls(model, _size(model))

    def dynamics(self, q: Array, v: Sequence[float] | None = None) -> Dynamics:
        """The mechanism at q, at rest unless v is given."""
        model = self.model
        inputs = {i.name: i.default for i in model.inputs}
        states = {x.name: x.initial for x in model.extra}
        speeds = [0.0] * len(model.velocities) if v is None else list(v)
        values = Values(model.defaults, inputs, q.tolist(), speeds, states, self.time)
        return Dynamics(model, values, FloatScalars(), linkage=self._linkage)

    @cached_property
    def _linkage(self) -> Linkage:
        """Frames and mounts, the same at all coordinates."""
        return make_linkage(self.model, self.model.defaults, FloatScalars())

    def residuals(self, q: Array) -> Array:
        """g of each row, (nc,)."""
        try:
            found = np.array(constraints.residuals(self.dynamics(q)))
        except (ArithmeticError, ValueError):
            found = np.full(len(self.model.rows), np.nan)
        return np.asarray(found / self._units)

    def met(self, q: Array, v: Sequence[float]) -> bool:
        """Whether a state meets the constraints, except for rounding."""
        rates = np.array(constraints.rates(self.dynamics(q, v))) / self._units
        speed = max(1.0, float(np.abs(np.array(v) / self.lengths).max(initial=0.0)))
        near = np.abs(self.residuals(q)).max(initial=0.0) <= CLOSED
        return bool(near and np.abs(rates).max(initial=0.0) <= CLOSED * speed)

    def both(self, q: Array) -> tuple[Array, Array]:
        """`residuals` and `jacobian`, for many positions: they are recorded once."""
        nc, names = len(self.model.rows), [c.name for c in self.model.coordinates]
        try:
            found = self._recorded(dict(zip(names, q.tolist(), strict=True)))
        except (ArithmeticError, ValueError):
            return self.residuals(q), self.jacobian(q)
        return np.array(found[:nc]) / self._units, self._in_sizes(found[nc:])

    @cached_property
    def _recorded(self) -> Callable[[Mapping[str, float]], list[float]]:
        """g of each row and the rows of J as a program of the coordinates."""
        model, tape = self.model, Tape()
        scalars = TapeScalars(tape)
        given = (
            model.defaults,
            {i.name: i.default for i in model.inputs},
            {x.name: x.initial for x in model.extra},
        )
        parameters, inputs, states = ({n: scalars.number(x) for n, x in g.items()} for g in given)
        q = [tape.input(c.name, Stage.POSITIONS) for c in model.coordinates]
        still = [scalars.number(0.0)] * len(model.velocities)
        values = Values(parameters, inputs, q, still, states, scalars.number(self.time))
        d = Dynamics(model, values, scalars)
        entries = [*constraints.residuals(d), *(x for row in jacobian_of(d) for x in row)]
        output = Output((len(entries),), tuple(node.index for node in entries))
        return interpreter(finish(tape, {"both": output}, ()), "both", FloatScalars())

    def jacobian(self, q: Array) -> Array:
        """J (nc, nv) in sizes."""
        try:
            entries = [x for row in jacobian_of(self.dynamics(q)) for x in row]
        except (ArithmeticError, ValueError):
            entries = [np.nan] * len(self.model.velocities) * len(self.model.rows)
        return self._in_sizes(entries)

    def _in_sizes(self, entries: Sequence[float]) -> Array:
        shape = len(self.model.rows), len(self.model.velocities)
        matrix = np.array(entries, dtype=np.float64).reshape(shape)
        scaled: Array = matrix * self.lengths / self._units[:, np.newaxis]
        return scaled

    def holding(self, q: Array) -> Array:
        """J (nc, nv) in sizes, 0 in the rows that restrict velocities alone: what positions can be
        closed by. A wheel is put on the ground without rolling there.
        """
        try:
            rows = self.dynamics(q).rows
        except (ArithmeticError, ValueError):
            return self.jacobian(q)
        held = np.array([[row.residual is not None] for row in rows], dtype=bool)
        return np.where(held.reshape(len(rows), 1), self.jacobian(q), 0.0)

    def margin(self, q: Array) -> float:
        """The least margin of the rows: 0 where one of them has no direction."""
        found = [row.margin for row in self.dynamics(q).rows if row.margin is not None]
        return float(min(found, default=1.0))

    def moved(self, q: Array, step: Array) -> Array:
        """q after a step (nv,) of the velocities' directions, in sizes; quaternions stay unit."""
        rates = constraints.position_rates(self.dynamics(q), (step * self.lengths).tolist())
        found: Array = q + np.array(rates, dtype=np.float64)
        for indices in map(list, self.model.quaternions):
            # No library's norm, which has other bits on other machines.
            found[indices] /= math.sqrt(math.fsum(x * x for x in found[indices].tolist()))
        return found

    def upright(self, q: Array) -> bool:
        """Whether no loop is closed with a part turned by half a turn."""
        d = self.dynamics(q)
        return all(cosine > 0 for loop in self.model.loops for cosine in loop.upright(d))

    @property
    def lengths(self) -> Array:
        """The size of each velocity's coordinate: 1 for an angle."""
        return np.array([self.size_of(c) for c in self.model.velocities])

    def size_of(self, coordinate: Coordinate) -> float:
        """The size of a coordinate or velocity: 1 rad, 1 rad/s, or the mechanism's size."""
        return self.size if coordinate.unit in ("m", "m/s") else 1.0

    @property
    def _units(self) -> Array:
        return np.array([self.size if unit == "N" else 1.0 for _, unit in self.model.rows])


def _size(model: Model) -> float:
    """A typical length of the mechanism, m."""
    joints = [*(body.joint for body in model.bodies), *(loop.joint for loop in model.loops)]
    parts = [part for joint in joints for part in (*joint.r_parent, *joint.r_child)]
    return max((abs(model.value(part)) for part in parts), default=0.0) or 1.0


def newton(mechanism: ConstraintEquations, q: Array, free: NDArray[np.bool_]) -> Array | None:
    """The end of Newton's method with damped least-squares steps; None if it does not converge."""
    g = mechanism.residuals(q)
    damping, last, before = 0.0, math.inf, math.inf
    for step_number in range(STEPS):
        size = float(np.abs(g).max())
        if step_number % PATIENCE == 0:
            if size > CLOSED and float(g @ g) > 0.7 * before:
                return None
            before = float(g @ g)
        if size <= CLOSED and size >= 0.5 * last:
            return q
        last = size
        matrix = np.where(free, mechanism.holding(q), 0.0)
        normal = matrix @ matrix.T + damping * np.eye(len(g))
        if not np.isfinite(normal).all():
            return None
        step = -matrix.T @ np.linalg.lstsq(normal, g, rcond=1e-14)[0]
        length = float(np.abs(step).max())
        step *= min(1.0, 0.5 / length) if length else 1.0
        there = mechanism.moved(q, step)
        after = mechanism.residuals(there)
        worse = not float(after @ after) <= float(g @ g)  # also where a formula has no value
        if worse and (size > CLOSED or not np.isfinite(after).all()):
            damping = max(10 * damping, 1e-6)
            last = math.inf
            if damping > 1e6:
                return None
            continue
        q, g, damping = there, after, damping / 10 if damping > 1e-12 else 0.0
    return q if float(np.abs(g).max()) <= 10 * CLOSED else None


def settled(mechanism: ConstraintEquations, q: Array, free: NDArray[np.bool_]) -> Array:
    """A closed position with the same bits on every machine, next to one that `newton` found.

    The last bits of that depend on the machine's library for linear algebra. So the change from the
    start is rounded, by less than 1e-9 of the mechanism's size, and the position is closed again by
    plain sums. Two machines differ only if a change lies within rounding of the middle between two
    rounded ones.
    """
    finest = 2.0 ** (math.frexp(mechanism.size)[1] - FINE)
    grid = np.array([finest if c.unit == "m" else 2.0**-FINE for c in mechanism.model.coordinates])
    start = np.array(mechanism.model.initial_q)
    rounded = start + np.rint((q - start) / grid) * grid
    q, last = mechanism.moved(rounded, np.zeros(len(free))), math.inf
    for _ in range(STEPS):
        g = mechanism.residuals(q)
        size = float(np.abs(g).max())
        if size <= CLOSED and size >= 0.5 * last:
            break
        last = size
        q = mechanism.moved(q, -least(np.where(free, mechanism.holding(q), 0.0), g))
    return q


def least(matrix: Array, right: Array) -> Array:
    """The least x (n,) with matrix x = right, (m,); rows that follow from others to 1e-10 are left
    out. By Gram-Schmidt in plain sums, so that it has the same bits on every machine.
    """
    rows, values = matrix.tolist(), right.tolist()
    norms = [math.fsum(x * x for x in row) for row in rows]
    found, smallest = [0.0] * matrix.shape[1], 1e-20 * max(norms, default=0.0)
    for _ in range(len(rows)):
        i = max(range(len(rows)), key=norms.__getitem__)
        square = math.fsum(x * x for x in rows[i])
        if not square > smallest:
            break
        value, row = values.pop(i) / square, rows.pop(i)
        found = [x + value * y for x, y in zip(found, row, strict=True)]
        for k, other in enumerate(rows):
            part = math.fsum(x * y for x, y in zip(other, row, strict=True)) / square
            rows[k] = [x - part * y for x, y in zip(other, row, strict=True)]
            values[k] -= part * value * square
        norms = [math.fsum(x * x for x in each) for each in rows]
    return np.array(found)
