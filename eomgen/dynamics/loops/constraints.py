"""Constraints at a state: their rows, what they take for the accelerations, and factored matrices.

J is the matrix of the constraints' rates by the velocities: ġ = J v + drift and g̈ = J v̇ + β, where
β is what g̈ is at v̇ = 0. Each `freedoms.Formulation` solves M v̇ + h = F + Jᵀ λ with g̈ = 0.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from eomgen.dynamics.tree.loads import generalised, power_of, scaled
from eomgen.dynamics.tree.mechanism_state import MechanismState
from eomgen.scalars.protocol import Scalar, Scalars
from eomgen.scene.effects.base import Load


def residuals(d: MechanismState) -> list[Scalar]:
    """g of each row, m or rad; 0 for a row of velocities alone."""
    return [d.scalars.number(0.0) if row.residual is None else row.residual for row in d.rows]


def rates(d: MechanismState) -> list[Scalar]:
    """ġ of each row, m/s or rad/s."""
    found = []
    for row in d.rows:
        rate = power_of(d, row.loads)
        found.append(rate if row.drift is None else rate + row.drift)
    return found


def held(d: MechanismState, multipliers: Sequence[Scalar]) -> list[Scalar]:
    """Jᵀ λ: the generalised forces of the constraints, with the rows of driven velocities."""
    pairs = zip(d.rows, multipliers, strict=True)
    return generalised(d, [x for row, force in pairs for x in scaled(row.loads, force)])


def position_rates(d: MechanismState, v: Sequence[Scalar] | None = None) -> list[Scalar]:
    """q̇ for velocities `v`, by default those of the state: the velocity of each coordinate, or
    ½ q ∘ ω for a quaternion q, with ω in body axes.
    """
    q, v = d.values.q, d.values.v if v is None else v
    rates: list[Scalar] = []
    half = d.scalars.number(0.5)
    for index in d.model.joint_indices:
        rates += [v[j] for _, j in index.plain if j < len(v)]
        if index.quaternion:
            w, x, y, z = (q[i] for i in index.quaternion)
            a, b, c = (half * v[j] for j in index.spin)
            rates += [
                -(x * a + y * b + z * c),
                w * a + y * c - z * b,
                w * b + z * a - x * c,
                w * c + x * b - y * a,
            ]
    return rates


def loads_of(d: MechanismState, multipliers: Sequence[Scalar]) -> list[list[Load]]:
    """The loads on bodies of each constraint of the model; `multipliers` are those of its rows."""
    found: list[list[Load]] = []
    forces = dict(zip((name for name, _ in d.model.rows), multipliers, strict=True))
    for constraint in d.model.constraints:
        names = (name for name, _ in constraint.row_names(d.model.dimensions))
        rows = zip(names, constraint.rows(d), strict=True)
        loads = (x for name, row in rows if name in forces for x in scaled(row.loads, forces[name]))
        found.append([x for x in loads if isinstance(x, Load)])
    return found


def relative(d: MechanismState, pivots: Sequence[Scalar], sizes: Sequence[Scalar]) -> list[Scalar]:
    """Each row's pivot relative to the sum of the sizes of the rows of its constraint that have the
    same unit, since a row may vanish in a singular position; times the row's own margin.
    """
    of = {
        name: (constraint.name, unit)
        for constraint in d.model.constraints
        for name, unit in constraint.row_names(d.model.dimensions)
    }
    kinds = [of[name] for name, _ in d.model.rows]
    sums: dict[tuple[str, str], Scalar] = {}
    for kind, size in zip(kinds, sizes, strict=True):
        sums[kind] = sums[kind] + size if kind in sums else size
    shares = [pivot / sums[kind] for kind, pivot in zip(kinds, pivots, strict=True)]
    own = [row.margin for row in d.rows]
    return [x if m is None else x * m for x, m in zip(shares, own, strict=True)]


# Factors.


def _reduced(right: Sequence[Scalar], lower: Sequence[dict[int, Scalar]]) -> list[Scalar]:
    """x with L x = right."""
    x = list(right)
    for i, row in enumerate(lower):
        for j, entry in row.items():
            x[i] = x[i] - entry * x[j]
    return x


def _back(right: Sequence[Scalar], lower: Sequence[dict[int, Scalar]]) -> list[Scalar]:
    """x with Lᵀ x = right."""
    x = list(right)
    for i in reversed(range(len(x))):
        for j, entry in lower[i].items():
            x[j] = x[j] - entry * x[i]
    return x


@dataclass(frozen=True, eq=False)
class Symmetric:
    """A = L D Lᵀ with unit lower triangular L; entries of L that are 0 are left out."""

    d: Sequence[Scalar]
    lower: Sequence[dict[int, Scalar]]

    def solved(self, right: Sequence[Scalar]) -> list[Scalar]:
        """x with A x = right."""
        x = _reduced(right, self.lower)
        x = [a / d for a, d in zip(x, self.d, strict=True)]
        return _back(x, self.lower)


def factored(
    matrix: Sequence[Sequence[Scalar]], names: Sequence[str], scalars: Scalars
) -> Symmetric:
    """The factors of a symmetric positive definite matrix, given by its lower triangle."""
    pivots: list[Scalar] = []
    lower: list[dict[int, Scalar]] = []
    for i, row in enumerate(matrix):
        work = list(row)
        own: dict[int, Scalar] = {}
        for j in range(i):
            for k, entry in lower[j].items():
                if k in own:
                    work[j] = work[j] - own[k] * pivots[k] * entry
            if not scalars.is_zero(work[j]):
                own[j] = work[j] / pivots[j]
                work[i] = work[i] - own[j] * work[j]
        lower.append(own)
        pivots.append(scalars.named(work[i], f"pivot_{names[i]}"))
    return Symmetric(pivots, lower)


@dataclass(frozen=True, eq=False)
class Block:
    """The inverse ((p, -q), (-r, s)) of two rows and columns that are eliminated together, and
    their determinant.
    """

    determinant: Scalar
    p: Scalar
    q: Scalar
    r: Scalar
    s: Scalar

    @classmethod
    def of(cls, a: Scalar, b: Scalar, c: Scalar, e: Scalar, name: str, scalars: Scalars) -> "Block":
        """That of the rows (a, b) and (c, e)."""
        whole = scalars.named(a * e - b * c, f"pivot_{name}")
        return cls(whole, e / whole, b / whole, c / whole, a / whole)

    def solved(self, x: Scalar, y: Scalar) -> tuple[Scalar, Scalar]:
        """The inverse times (x, y)."""
        return self.p * x - self.q * y, self.s * y - self.r * x

    def solved_transposed(self, x: Scalar, y: Scalar) -> tuple[Scalar, Scalar]:
        """(x, y) times the inverse."""
        return self.p * x - self.r * y, self.s * y - self.q * x


@dataclass(frozen=True, eq=False)
class Square:
    """A = L U with unit lower triangular L, in the given order; entries that are 0 are left out.
    `pivots` has a number for each row, and for each two rows that are eliminated together their
    block, twice; these have no entries for each other in L and U.
    """

    pivots: Sequence[Scalar | Block]
    lower: Sequence[dict[int, Scalar]]
    upper: Sequence[dict[int, Scalar]]

    def solved(self, right: Sequence[Scalar]) -> list[Scalar]:
        """x with A x = right."""
        x = _reduced(right, self.lower)
        for i in reversed(range(len(x))):
            for j, entry in self.upper[i].items():
                x[i] = x[i] - entry * x[j]
            pivot = self.pivots[i]
            if not isinstance(pivot, Block):
                x[i] = x[i] / pivot
            elif self._first(i):
                x[i], x[i + 1] = pivot.solved(x[i], x[i + 1])
        return x

    def solved_transposed(self, right: Sequence[Scalar]) -> list[Scalar]:
        """x with Aᵀ x = right."""
        x = list(right)
        for i, row in enumerate(self.upper):
            pivot = self.pivots[i]
            if not isinstance(pivot, Block):
                x[i] = x[i] / pivot
            elif self._first(i):
                x[i], x[i + 1] = pivot.solved_transposed(x[i], x[i + 1])
            for j, entry in row.items():
                x[j] = x[j] - entry * x[i]
        return _back(x, self.lower)

    def squares(self, sizes: Sequence[Scalar]) -> list[Scalar]:
        """The square of each pivot, in the unit of its row, for the squares of the rows' lengths.
        That of a block is the distance of a row from the other one's line.
        """
        found: list[Scalar] = []
        for i, pivot in enumerate(self.pivots):
            if isinstance(pivot, Block):
                other = sizes[i + 1 if self._first(i) else i - 1]
                found.append(pivot.determinant * pivot.determinant / other)
            else:
                found.append(pivot * pivot)
        return found

    def _first(self, i: int) -> bool:
        """Whether row i is the first of its block."""
        return i + 1 < len(self.pivots) and self.pivots[i] is self.pivots[i + 1]


def triangular(
    matrix: Sequence[Sequence[Scalar]],
    names: Sequence[str],
    scalars: Scalars,
    blocks: Sequence[int] = (),
) -> Square:
    """The factors of a matrix whose rows and columns are in the order of elimination; the rows at
    `blocks` and those after them are eliminated together.
    """
    work = [list(row) for row in matrix]
    pivots: list[Scalar | Block] = []
    lower: list[dict[int, Scalar]] = [{} for _ in work]
    upper: list[dict[int, Scalar]] = []
    while (k := len(pivots)) < len(work):
        own = range(k, k + 2 if k in blocks else k + 1)
        after = range(own.stop, len(work))
        upper += [{j: work[n][j] for j in after if not scalars.is_zero(work[n][j])} for n in own]
        if len(own) == 1:
            pivots.append(scalars.named(work[k][k], f"pivot_{names[k]}"))
        else:
            (a, b), (c, e) = (work[n][k : k + 2] for n in own)
            pivots += [Block.of(a, b, c, e, names[k], scalars)] * 2
        for i in after:
            parts = [work[i][j] for j in own]
            if all(map(scalars.is_zero, parts)):
                continue
            pivot = pivots[k]
            if isinstance(pivot, Block):
                factors: Sequence[Scalar] = pivot.solved_transposed(*parts)
            else:
                factors = [parts[0] / pivot]
            for n, factor in zip(own, factors, strict=True):
                lower[i][n] = factor
                for j, entry in upper[n].items():
                    work[i][j] = work[i][j] - factor * entry
    return Square(pivots, lower, upper)


def inner(a: Sequence[Scalar], b: Sequence[Scalar], scalars: Scalars) -> Scalar:
    """a · b without terms that are 0."""
    total: Scalar | None = None
    for x, y in zip(a, b, strict=True):
        if not (scalars.is_zero(x) or scalars.is_zero(y)):
            total = x * y if total is None else total + x * y
    return scalars.number(0.0) if total is None else total
