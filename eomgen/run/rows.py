"""The rows of a run: times and states that are kept."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import overload

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Row = tuple[float, FloatArray]
"""A time, s, and the state (ny,) there."""
FEW = 64
"""Numbers that Python adds up sooner than NumPy begins to look at them."""


def all_finite(values: FloatArray) -> bool:
    """Whether all numbers are finite; a finite sum says so, too."""
    few = values.size <= FEW and math.isfinite(sum(values.ravel().tolist()))
    return few or bool(np.isfinite(values).all())


@dataclass(frozen=True, eq=False)
class Rows(Sequence[Row]):
    """Rows at times t (n,), s, with states y (n, ny), as arrays."""

    t: FloatArray
    y: FloatArray

    def __len__(self) -> int:
        return len(self.t)

    @overload
    def __getitem__(self, i: int) -> Row: ...
    @overload
    def __getitem__(self, i: slice) -> "Rows": ...
    def __getitem__(self, i: int | slice) -> "Row | Rows":
        if isinstance(i, slice):
            return Rows(self.t[i], self.y[i])
        return float(self.t[i]), self.y[i]

    def __iter__(self) -> Iterator[Row]:
        return zip(self.t.tolist(), self.y, strict=True)


@dataclass
class Record:
    """The rows of a run so far; `last` is the time of the last one, s, and `count` their number."""

    last: float = -np.inf
    count: int = 0
    _pairs: list[Row] = field(default_factory=list)
    _parts: list[Rows] = field(default_factory=list)

    def add(self, t: float, y: FloatArray) -> None:
        """Keep a row."""
        self._pairs.append((t, y))
        self.last, self.count = t, self.count + 1

    def extend(self, rows: Sequence[Row]) -> None:
        """Keep several rows."""
        if not rows:
            return
        if isinstance(rows, Rows):
            self._gather()
            self._parts.append(rows)
        else:
            self._pairs.extend(rows)
        self.last, self.count = rows[-1][0], self.count + len(rows)

    def arrays(self) -> tuple[FloatArray, FloatArray]:
        """The times (n,), s, and the states (n, ny)."""
        self._gather()
        if len(self._parts) == 1:
            return self._parts[0].t, self._parts[0].y
        t, y = ([getattr(part, name) for part in self._parts] for name in ("t", "y"))
        return np.concatenate(t), np.concatenate(y)

    def _gather(self) -> None:
        if self._pairs:
            t, y = zip(*self._pairs, strict=True)
            self._parts.append(Rows(np.array(t), np.array(y)))
            self._pairs.clear()
