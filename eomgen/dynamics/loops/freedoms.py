"""What constraints leave free: the motions that keep them, and the way back to them.

The rows of J are solved for as many dependent velocities, chosen when the mechanism is assembled:
v = N v_i + …, with v_i the independent velocities and J N = 0.
"""

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Protocol

from eomgen.dynamics.loops.clusters import accelerations_at_rest, jacobian_of
from eomgen.dynamics.loops.constraints import (
    Square,
    inner,
    position_rates,
    rates,
    residuals,
    triangular,
)
from eomgen.dynamics.tree.mechanism_state import MechanismState
from eomgen.scalars.protocol import Scalar

Forward = Callable[[Sequence[Scalar] | None], list[Scalar]]
"""v̇ (nv,) under the effects and further generalised forces (nv,), or None for none."""
Response = Callable[[Sequence[Scalar]], list[Scalar]]
"""M⁻¹ f (nv,) of generalised forces f."""


class Formulation(Protocol):
    """The constraints of a mechanism at a state, and how accelerations are found under them."""

    def forward(self, tau: Sequence[Scalar] | None) -> list[Scalar]:
        """v̇ under the effects and generalised forces `tau`."""

    def multipliers(self) -> list[Scalar]:
        """λ of the rows under the effects, N or N m."""

    def margins(self) -> list[Scalar]:
        """What of each row is independent of others, relative to the rows of its kind: 0 where the
        formulation is singular.
        """

    def response(self, impulse: Sequence[Scalar]) -> list[Scalar]:
        """The change of the velocities by generalised impulses; the constraints stay met."""

    def position(self) -> list[Scalar]:
        """q after one Newton step towards g = 0."""

    def velocity(self) -> list[Scalar]:
        """v with ġ = 0."""


class Freedoms:
    """The motions that keep a mechanism's constraints at a state.

    fall  (nv,), the accelerations of trees on a free joint by uniform gravity
    """

    def __init__(self, d: MechanismState, fall: Sequence[Scalar]) -> None:
        self._d, self._fall = d, fall
        self._scalars, self._zero = d.scalars, d.scalars.number(0.0)
        self._order = [row for row, _ in d.model.pivots]
        self._dependent = [column for _, column in d.model.pivots]
        self._independent = [j for j in range(d.nv) if j not in self._dependent]

    @cached_property
    def _jacobian(self) -> list[list[Scalar]]:
        """J with its rows in the order of elimination."""
        return [self._rows[i] for i in self._order]

    @cached_property
    def _rows(self) -> list[list[Scalar]]:
        """J."""
        return jacobian_of(self._d)

    @cached_property
    def _factors(self) -> Square:
        """Those of the columns of J that belong to dependent velocities."""
        square = [[row[j] for j in self._dependent] for row in self._jacobian]
        names = [self._d.model.rows[i][0] for i in self._order]
        return triangular(square, names, self._scalars, self._d.model.blocks)

    def dependents(self, along: Sequence[Scalar]) -> list[Scalar]:
        """Velocities (nv,) with J v = -`along`, where independent ones are 0."""
        found = [self._zero] * self._d.nv
        ordered = [-along[i] for i in self._order]
        for j, x in zip(self._dependent, self._factors.solved(ordered), strict=True):
            found[j] = x
        return found

    @cached_property
    def _basis(self) -> list[list[Scalar]]:
        """The columns (nv,) of N, one for each independent velocity."""
        columns = []
        for k in self._independent:
            solution = self._factors.solved([-row[k] for row in self._jacobian])
            column = [self._zero] * self._d.nv
            column[k] = self._scalars.number(1.0)
            for j, x in zip(self._dependent, solution, strict=True):
                column[j] = x
            columns.append(column)
        return columns

    @cached_property
    def _bend(self) -> list[Scalar]:
        """γ (nv,) without `fall`."""
        rest = accelerations_at_rest(self._d)
        pairs = zip(self._rows, rest, strict=True)
        return self.dependents([b + inner(row, self._fall, self._scalars) for row, b in pairs])

    def _towards(self, along: Sequence[Scalar]) -> list[Scalar]:
        """Velocities v (nv,) with J v = -`along` by which a state is put on the constraints."""
        return self.dependents(along)

    def position(self) -> list[Scalar]:
        """q after one Newton step towards g = 0."""
        change = position_rates(self._d, self._towards(residuals(self._d)))
        return [x + dx for x, dx in zip(self._d.values.q, change, strict=True)]

    def velocity(self) -> list[Scalar]:
        """v with ġ = 0."""
        change = self._towards(rates(self._d))
        return [v + dv for v, dv in zip(self._d.values.v, change, strict=True)]

    def carried_along(self) -> list[Scalar]:
        """The same by N: v = N v_i, and what time alone moves."""
        own = self._d.values.v
        found = list(own)
        for k, column in zip(self._independent, self._basis, strict=True):
            for j in self._dependent:
                if not self._scalars.is_zero(column[j]):
                    found[j] = found[j] + column[j] * own[k]
        return found
