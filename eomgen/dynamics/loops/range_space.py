"""Constraints by the range-space method, for any recursion (Featherstone 2008, 8.5).

    A λ = -(J v̇₀ + β),    A = J M⁻¹ Jᵀ,    v̇ = v̇₀ + M⁻¹ Jᵀ λ

v̇₀ is the acceleration without constraints. M⁻¹ is applied by the recursion of the route, so that
the tree's mass matrix is not needed. A has a row for each constraint. It is symmetric, and positive
definite if these are independent; its factors L D Lᵀ are written out.
"""

from collections.abc import Sequence
from functools import cached_property

from eomgen.dynamics.loops.clusters import accelerations_at_rest, jacobian_of
from eomgen.dynamics.loops.constraints import (
    Symmetric,
    factored,
    inner,
    position_rates,
    rates,
    relative,
    residuals,
)
from eomgen.dynamics.loops.freedoms import Forward, Response
from eomgen.dynamics.tree.mechanism_state import MechanismState
from eomgen.scalars.protocol import Scalar


class RangeSpace:
    """The constraints of a mechanism at a state.

    free, respond  forward dynamics and M⁻¹ without constraints
    """

    def __init__(self, d: MechanismState, free: Forward, respond: Response) -> None:
        self._d, self._free, self._respond = d, free, respond
        self._scalars = d.scalars

    @cached_property
    def _jacobian(self) -> list[list[Scalar]]:
        return jacobian_of(self._d)

    @cached_property
    def _responses(self) -> list[list[Scalar]]:
        """M⁻¹ Jᵀ, a column (nv,) for each row of J."""
        return [self._respond(row) for row in self._jacobian]

    @cached_property
    def _matrix(self) -> list[list[Scalar]]:
        """The lower triangle of A."""
        J, count = self._jacobian, range(len(self._jacobian))
        return [
            [inner(J[i], self._responses[j], self._scalars) for j in count[: i + 1]] for i in count
        ]

    @cached_property
    def _factors(self) -> Symmetric:
        names = [name for name, _ in self._d.model.rows]
        return factored(self._matrix, names, self._scalars)

    def _impulses(self, along: Sequence[Scalar]) -> list[Scalar]:
        """λ with A λ = -`along`."""
        return self._factors.solved([-x for x in along])

    def margins(self) -> list[Scalar]:
        """What is left of each row of A beside those before it, by the rows of its kind."""
        return relative(self._d, self._factors.d, [row[-1] for row in self._matrix])

    def _changed(self, by: Sequence[Scalar], impulses: Sequence[Scalar]) -> list[Scalar]:
        """`by` + M⁻¹ Jᵀ λ."""
        found = list(by)
        for impulse, response in zip(impulses, self._responses, strict=True):
            found = [x + impulse * y for x, y in zip(found, response, strict=True)]
        return found

    def _along(self, v: Sequence[Scalar]) -> list[Scalar]:
        """J v."""
        return [inner(row, v, self._scalars) for row in self._jacobian]

    def forward(self, tau: Sequence[Scalar] | None) -> list[Scalar]:
        """v̇ under the effects and generalised forces `tau`."""
        free = self._free(tau)
        return self._changed(free, self._multipliers(free))

    def multipliers(self) -> list[Scalar]:
        """λ of the rows under the effects, N or N m."""
        return self._multipliers(self._free(None))

    def _multipliers(self, free: Sequence[Scalar]) -> list[Scalar]:
        bend = accelerations_at_rest(self._d)
        return self._impulses([a + b for a, b in zip(self._along(free), bend, strict=True)])

    def response(self, impulse: Sequence[Scalar]) -> list[Scalar]:
        """The change of the velocities by generalised impulses; the constraints stay met."""
        free = self._respond(impulse)
        return self._changed(free, self._impulses(self._along(free)))

    def position(self) -> list[Scalar]:
        """q after one Newton step towards g = 0, the nearest in the metric of M."""
        still = [self._scalars.number(0.0)] * self._d.nv
        change = self._changed(still, self._impulses(residuals(self._d)))
        pairs = zip(self._d.values.q, position_rates(self._d, change), strict=True)
        return [x + dx for x, dx in pairs]

    def velocity(self) -> list[Scalar]:
        """v with ġ = 0, the nearest in the metric of M."""
        return self._changed(self._d.values.v, self._impulses(rates(self._d)))
