"""A cluster of frames as one joint: its motions, and the solution of its equation.

    D a = r,    r = Tᵀ (forces) - Uᵀ (acceleration of the base)

with columns of motion T, their wrenches U at the base, and D = Tᵀ I T. Where the dependent
velocities follow safely from the independent ones, the columns are those of the independent ones
and D is factored. Elsewhere the columns are those of all velocities of the cluster, and multipliers
keep the constraints: D a = r + Jᵀ λ, J a + β = 0.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from eomgen.dynamics.loops.clusters import Cluster
from eomgen.dynamics.loops.constraints import Symmetric as Factored
from eomgen.dynamics.loops.constraints import factored, inner
from eomgen.dynamics.tree.articulated import ArticulatedInertia
from eomgen.dynamics.tree.forces import Wrench
from eomgen.dynamics.tree.motion import Motion
from eomgen.dynamics.tree.vectors import AXES, ENTRIES, symmetric
from eomgen.scalars.protocol import Scalar, Scalars


class Equation(Protocol):
    """The equation of a cluster."""

    def solved(self, right: Sequence[Scalar], *, still: bool) -> list[Scalar]:
        """The accelerations along the columns; `still` for velocities that change at once."""

    def terms(self, rows: Sequence[Sequence[Scalar]]) -> Iterator[tuple[list[Scalar], Scalar]]:
        """Rows u and numbers d with Σ u uᵀ / d = U P Uᵀ, where P r solves for a right side r."""


@dataclass(frozen=True, eq=False)
class Independent:
    """D a = r with D factored."""

    factors: Factored

    def solved(self, right: Sequence[Scalar], *, still: bool) -> list[Scalar]:
        """D⁻¹ r."""
        return self.factors.solved(right)

    def terms(self, rows: Sequence[Sequence[Scalar]]) -> Iterator[tuple[list[Scalar], Scalar]]:
        """Those of L⁻¹ Uᵀ."""
        return zip(reduced(self.factors, rows), self.factors.d, strict=True)


class Held:
    """D a = r + Jᵀ λ and J a + β = 0, by the range-space method."""

    def __init__(
        self,
        factors: Factored,
        jacobian: Sequence[Sequence[Scalar]],
        rest: Sequence[Scalar],
        names: Sequence[str],
        scalars: Scalars,
    ) -> None:
        self._factors, self._jacobian, self._rest = factors, jacobian, rest
        self._scalars = scalars
        self.responses = [factors.solved(row) for row in jacobian]
        count = range(len(jacobian))
        self.matrix = [
            [inner(jacobian[i], self.responses[j], scalars) for j in count[: i + 1]] for i in count
        ]
        self.small = factored(self.matrix, names, scalars)

    def impulses(self, along: Sequence[Scalar]) -> list[Scalar]:
        """λ that changes J a by -`along`."""
        return self.small.solved([-x for x in along])

    def multipliers(self, right: Sequence[Scalar], *, still: bool = False) -> list[Scalar]:
        """λ for a right side."""
        free = self._factors.solved(right)
        along = [inner(row, free, self._scalars) for row in self._jacobian]
        if not still:
            along = [a + b for a, b in zip(along, self._rest, strict=True)]
        return self.impulses(along)

    def solved(self, right: Sequence[Scalar], *, still: bool) -> list[Scalar]:
        """a."""
        free = self._factors.solved(right)
        return self.changed(free, self.multipliers(right, still=still))

    def changed(self, a: Sequence[Scalar], impulses: Sequence[Scalar]) -> list[Scalar]:
        """a + D⁻¹ Jᵀ λ."""
        found = list(a)
        for impulse, response in zip(impulses, self.responses, strict=True):
            found = [x + impulse * y for x, y in zip(found, response, strict=True)]
        return found

    def terms(self, rows: Sequence[Sequence[Scalar]]) -> Iterator[tuple[list[Scalar], Scalar]]:
        """P = D⁻¹ - D⁻¹ Jᵀ (J D⁻¹ Jᵀ)⁻¹ J D⁻¹."""
        yield from zip(reduced(self._factors, rows), self._factors.d, strict=True)
        columns = list(zip(*rows, strict=True))
        across = [
            [inner(column, response, self._scalars) for column in columns]
            for response in self.responses
        ]
        for u, d in zip(reduced(self.small, across), self.small.d, strict=True):
            yield u, -d


def reduced(factors: Factored, rows: Sequence[Sequence[Scalar]]) -> list[list[Scalar]]:
    """L⁻¹ times a matrix, given by its rows."""
    found = [list(row) for row in rows]
    for i, row in enumerate(factors.lower):
        for j, entry in row.items():
            found[i] = [a - entry * b for a, b in zip(found[i], found[j], strict=True)]
    return found


@dataclass(frozen=True, eq=False)
class Joint:
    """A cluster as a joint.

    velocities  indices in v of the velocities along whose columns it is solved
    columns     for each of them the motion of each frame of the cluster, relative to the base
    inertias    of these frames, with all that they carry outside of the cluster
    at_base     U: the wrench of each column at the base; () if the world is the base
    """

    cluster: Cluster
    velocities: tuple[int, ...]
    columns: Sequence[dict[int, Motion]]
    inertias: dict[int, ArticulatedInertia]
    at_base: Sequence[Wrench]
    equation: Equation


def without(
    p: ArticulatedInertia, columns: Sequence[Wrench], equation: Equation
) -> ArticulatedInertia:
    """I - U P Uᵀ."""
    J, G, H = p.J, p.G, p.H
    for u, d in equation.terms([[*wrench.moment, *wrench.force] for wrench in columns]):
        w = [x / d for x in u]
        J = symmetric([J[i][j] - w[i] * u[j] for i, j in ENTRIES])
        H = symmetric([H[i][j] - w[3 + i] * u[3 + j] for i, j in ENTRIES])
        a, b, c = (
            (G[i][0] - w[i] * u[3], G[i][1] - w[i] * u[4], G[i][2] - w[i] * u[5]) for i in AXES
        )
        G = (a, b, c)
    return ArticulatedInertia(J, G, H)
