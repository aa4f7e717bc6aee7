"""Elimination of few unknowns in Python, where numbers in lists are quicker than arrays."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from eomgen.engine import elimination
from eomgen.engine.elimination import Factors
from eomgen.engine.structures import with_room
from eomgen.subset.words import Vector, in_loops

FEW = 20
"""Up to this many unknowns that need pivots lists are quicker."""


def factors_of(n: int, positions: int = 0) -> Factors:
    """Room for the factors of n unknowns, of which as many as there are positions may be eliminated
    first.
    """
    return with_room(_Few if n - positions <= FEW else Factors, n=n)


@dataclass(slots=True)
class _Few(Factors):
    """Factors, and the same in lists."""

    lists: Any = None

    @property
    def eliminated(self) -> Callable[[], bool] | None:
        """As `elimination.eliminated`; None if there are many unknowns."""
        return self._eliminated if self.n - self.first <= FEW else None

    @property
    def solve_by(self) -> Callable[[Vector], None] | None:
        """As `elimination.solve_by`; None if there are many unknowns."""
        return self._solve_by if self.n - self.first <= FEW else None

    def _eliminated(self) -> bool:
        own = {name: getattr(self, name).tolist() for name in _ARRAYS}
        self.lists = Factors(self.n, **own, first=self.first, diagonal=self.diagonal)
        return _eliminated(self.lists)

    def _solve_by(self, x: Vector) -> None:
        values: Any = x.tolist()
        _solve_by(self.lists, values)
        x[:] = values


_ARRAYS = ("right", "columns", "entries", "ends", "order")
_eliminated, _solve_by = in_loops(elimination.eliminated), in_loops(elimination.solve_by)
