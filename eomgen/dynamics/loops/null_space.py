"""Constraints by independent velocities: the null-space method.

The rows of J are solved for as many dependent velocities, chosen when the mechanism is assembled.
With v = N v_i + …, v_i the independent velocities, J N = 0 and γ the accelerations at v̇_i = 0,

    v̇ = N v̇_i + γ,    Nᵀ M N v̇_i = Nᵀ (F - h - M γ),    J_dᵀ λ = (M v̇ + h - F)_d

The matrix that is solved has a row for each degree of freedom: of a four-bar, one. It is singular
where the dependent velocities do not follow from the independent ones, as at a dead point.
"""

from collections.abc import Callable, Sequence

from eomgen.dynamics.loops.constraints import factored, inner, relative
from eomgen.dynamics.loops.freedoms import Freedoms
from eomgen.dynamics.tree.composite import Entries
from eomgen.dynamics.tree.mechanism_state import MechanismState
from eomgen.scalars.protocol import Scalar


class NullSpace(Freedoms):
    """The constraints of a mechanism at a state; independent coordinates and velocities keep their
    values where a state is put on the constraints.

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
        super().__init__(d, fall)
        self._mass, self._right = mass, right

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


def first_of(pair: tuple[int, Scalar]) -> int:
    """The index of a pair."""
    return pair[0]
