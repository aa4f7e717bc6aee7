"""Constraints by independent velocities: the null-space method.

The rows of J are solved for as many dependent velocities, chosen when the mechanism is assembled.
With v = N v_i + …, v_i the independent velocities, J N = 0 and γ the accelerations at v̇_i = 0,

    v̇ = N v̇_i + γ,    Nᵀ M N v̇_i = Nᵀ (F - h - M γ),    J_dᵀ λ = (M v̇ + h - F)_d

The matrix that is solved has a row for each degree of freedom: of a four-bar, one. It is singular
where the dependent velocities do not follow from the independent ones, as at a dead point.
"""

from collections.abc import Callable, Sequence
from functools import cached_property

from eomgen.dynamics.loops.clusters import accelerations_at_rest, jacobian_of
from eomgen.dynamics.loops.constraints import (
    Square,
    factored,
    inner,
    position_rates,
    rates,
    relative,
    residuals,
    triangular,
)
from eomgen.dynamics.tree.composite import Entries
from eomgen.dynamics.tree.mechanism_state import MechanismState
from eomgen.scalars.protocol import Scalar


class NullSpace:
    """The constraints of a mechanism at a state.

    mass   the entries of M
    right  F - h with further generalised forces, without the weight of trees on a free joint
    fall   (nv,), the accelerations by that weight
    """

    def __init__(
        self,
        d: MechanismState,
        mass: Entries,
        right: Callable[[Sequence[Scalar] | None], list[Scalar]],
        fall: Sequence[Scalar],
    ) -> None:
        self._d, self._mass, self._right, self._fall = d, mass, right, fall
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

    def _times_mass(self, v: Sequence[Scalar]) -> list[Scalar]:
        """M v."""
        nv = self._d.nv
        rows: list[list[Scalar]] = [[self._zero] * nv for _ in range(nv)]
        for (i, j), entry in self._mass.items():
            rows[i][j] = rows[j][i] = entry
        return [inner(row, v, self._scalars) for row in rows]

    def _independent_solution(self, right: Sequence[Scalar]) -> list[Scalar]:
        """N a (nv,) with Nᵀ M N a = Nᵀ right."""
        N, scalars = self._basis, self._scalars
        moved = [self._times_mass(column) for column in N]
        matrix = [[inner(N[i], moved[j], scalars) for j in range(i + 1)] for i in range(len(N))]
        names = [self._d.model.velocities[k].name for k in self._independent]
        factors = factored(matrix, names, scalars)
        found = factors.solved([inner(column, right, scalars) for column in N])
        total = [self._zero] * self._d.nv
        for x, column in zip(found, N, strict=True):
            total = [y if scalars.is_zero(n) else y + x * n
                     for y, n in zip(total, column, strict=True)]  # fmt: skip
        return total

    def _accelerations(self, right: Sequence[Scalar]) -> list[Scalar]:
        """v̇ without `fall`, for F - h."""
        left = [a - b for a, b in zip(right, self._times_mass(self._bend), strict=True)]
        pairs = zip(self._independent_solution(left), self._bend, strict=True)
        return [a + b for a, b in pairs]

    def forward(self, tau: Sequence[Scalar] | None) -> list[Scalar]:
        """v̇ under the effects and generalised forces `tau`."""
        found = self._accelerations(self._right(tau))
        rates = zip(found, self._fall, self._d.model.velocities, strict=True)
        return [self._scalars.named(a + b, c.acceleration) for a, b, c in rates]

    def multipliers(self) -> list[Scalar]:
        """λ of the rows under the effects, N or N m."""
        right = self._right(None)
        needed = self._times_mass(self._accelerations(right))
        over = [needed[j] - right[j] for j in self._dependent]
        found = self._factors.solved_transposed(over)
        return [x for _, x in sorted(zip(self._order, found, strict=True), key=first_of)]

    def margins(self) -> list[Scalar]:
        """The square of each pivot relative to the rows of J of its kind: 0 where its velocity does
        not follow from the others.
        """
        sizes = [inner(row, row, self._scalars) for row in self._jacobian]
        pairs = zip(self._order, self._factors.squares(sizes), sizes, strict=True)
        ordered = sorted(pairs, key=lambda pair: pair[0])
        return relative(self._d, [x for _, x, _ in ordered], [x for _, _, x in ordered])

    def response(self, impulse: Sequence[Scalar]) -> list[Scalar]:
        """The change of the velocities by generalised impulses; the constraints stay met."""
        return self._independent_solution(impulse)

    def position(self) -> list[Scalar]:
        """q after one Newton step towards g = 0; independent coordinates keep their values."""
        change = self.dependents(residuals(self._d))
        pairs = zip(self._d.values.q, position_rates(self._d, change), strict=True)
        return [x + dx for x, dx in pairs]

    def velocity(self) -> list[Scalar]:
        """v with ġ = 0; independent velocities keep their values."""
        change = self.dependents(rates(self._d))
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


def first_of(pair: tuple[int, Scalar]) -> int:
    """The index of a pair."""
    return pair[0]
