"""Portions of a run: some steps that a place makes at once, in Python or in compiled code."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from operator import sub
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eomgen.run.compiled import Margins
from eomgen.run.integrators.interface import Advance, Resume
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.rows import Row, Rows

MOST = 1024
"""Greatest number of steps in a portion: after each, progress is shown, and Ctrl-C is heard."""
COUNTED = Advance._fields[6:14]
"""What steps count."""
FEWER, MORE = 8, 2
"""By how much smaller portions become where Python has to look, and larger where it need not."""


@dataclass(frozen=True, eq=False)
class Portion:
    """Steps in order, m of them, from time t on.

    ends      (m,), their times, s
    states    (m, ny), the states there
    rows      the rows in them
    sampled   (m,), numbers of rows so far
    counts    (m,) each, what the steps have counted so far, by the names of `Advance`
    within    (i, time) -> the state at a time in step i
    resume    i -> what a later run needs to continue after step i; None if it cannot
    margins   (m + 1,), the least margins of constraints at the start and at their ends; None if
              these are not known
    checked   as in `Advance`
    """

    problem: Problem
    t: float
    ends: FloatArray
    states: FloatArray
    rows: Rows | list[Row]
    sampled: NDArray[np.int64] | list[int]
    counts: Mapping[str, Any]
    within: Callable[[int, float], FloatArray]
    resume: Callable[[int], Resume] | None
    margins: FloatArray | None = None
    checked: bool = False

    def advances(self, each: bool) -> Iterator[Advance]:
        """The steps as one `Advance`, or as one for each."""
        m, made, row = len(self.ends), 0, 0
        chosen = range(m) if each else range(m - 1, m)
        sums = (self.sampled, *map(self.counts.get, COUNTED))
        parts = zip(*(_differences(so_far, m, each) for so_far in sums), strict=True)
        for i, (rows, *counts) in zip(chosen, parts, strict=True):
            made_of = (float(self.ends[i]), self.states[i], self.rows[row : row + rows])
            how = self.problem, partial(self.within, i), i + 1 - made, *counts, self.checked
            resume = partial(self.resume, i) if self.resume else None
            # By keywords this takes several times as long.
            yield Advance._make((*made_of, *how, resume, self._margins(i), None, (), None))
            made, row = i + 1, row + rows

    def _margins(self, i: int) -> Margins | None:
        if self.margins is None:
            return None
        start = float(self.ends[i - 1]) if i else self.t
        return Margins(start, float(self.margins[i]), float(self.margins[i + 1]))


@dataclass
class Size:
    """How many steps C makes at once: fewer where Python has to look at them."""

    most: int = MOST

    def fits(self, passes: bool) -> bool:
        """Take account of whether the last ones needed no look, which is returned."""
        self.most = min(MOST, MORE * self.most) if passes else max(1, self.most // FEWER)
        return passes


def _differences(sums: Any, m: int, each: bool) -> list[int]:
    """What each of m steps adds to these sums, if there are some, or all of them together."""
    if sums is None:
        return [0] * (m if each else 1)
    if not each:
        return [int(sums[-1])]
    values = sums if isinstance(sums, list) else sums.tolist()
    return list(map(sub, values, [0, *values]))
