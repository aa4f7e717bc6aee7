"""Elimination of few unknowns in Python, where numbers in lists are quicker than arrays.

The operations are those of `eomgen.engine.elimination`.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from eomgen.engine.elimination import Factors
from eomgen.subset.structures import with_room
from eomgen.subset.words import Vector

FEW = 20
"""Up to this many unknowns that need pivots lists are quicker."""


def factors_of(n: int, positions: int = 0) -> Factors:
    """Room for the factors of n unknowns, of which as many as there are positions may be eliminated
    first.
    """
    return with_room(_Few if n - positions <= FEW else Factors, n=n)


@dataclass(slots=True)
class _Few(Factors):
    """Factors as rows of numbers; of those of `right`, only what is not 0, with its column."""

    rows: list[list[tuple[int, float]]] = field(default_factory=list)
    below: list[list[float]] = field(default_factory=list)
    rest: list[list[float]] = field(default_factory=list)
    places: list[int] = field(default_factory=list)

    @property
    def eliminated(self) -> Callable[[], bool] | None:
        """As `elimination.eliminated`; None if there are many unknowns."""
        return self._eliminated if self.n - self.first <= FEW else None

    @property
    def solve_by(self) -> Callable[[Vector], None] | None:
        """As `elimination.solve_by`; None if there are many unknowns."""
        return self._solve_by if self.n - self.first <= FEW else None

    def _eliminated(self) -> bool:
        m = self.first
        diagonal = self.diagonal
        right: list[list[float]] = self.right[:m, m:].tolist()
        lower: list[list[float]] = self.columns[:, m:].T.tolist()
        self.rows = [[(j, x) for j, x in enumerate(row) if x] for row in right]
        self.below = [[x / diagonal for x in row[:m]] for row in lower]
        rest = self.rest = [row[m:] for row in lower] if m else lower
        for row, factors in zip(rest, self.below, strict=True):
            for factor, entries in zip(factors, self.rows, strict=True):
                for j, x in entries:
                    row[j] -= factor * x
        size = len(rest)
        order = self.places = list(range(size))
        for k in range(size):
            pivot = max(range(k, size), key=lambda i: abs(rest[i][k]))
            rest[k], rest[pivot] = rest[pivot], rest[k]
            order[k], order[pivot] = order[pivot], order[k]
            upper = rest[k]
            if upper[k] == 0:
                return False
            for row in rest[k + 1 :]:
                factor = row[k] = row[k] / upper[k]
                if factor:
                    row[k + 1 :] = [
                        x - factor * y for x, y in zip(row[k + 1 :], upper[k + 1 :], strict=True)
                    ]
        return True

    def _solve_by(self, values: Vector) -> None:
        given: list[float] = values.tolist()
        m, rest = self.first, self.rest
        first, others = given[:m], given[m:]
        for i, row in enumerate(self.below):
            for factor, x in zip(row, first, strict=True):
                others[i] -= factor * x
        others = [others[i] for i in self.places]
        for i, row in enumerate(rest):
            for k in range(i):
                others[i] -= row[k] * others[k]
        for i in range(len(rest) - 1, -1, -1):
            row = rest[i]
            for k in range(len(rest) - 1, i, -1):
                others[i] -= row[k] * others[k]
            others[i] /= row[i]
        for i, entries in enumerate(self.rows):
            for k, factor in entries:
                first[i] -= factor * others[k]
            first[i] /= self.diagonal
        values[:] = first + others
