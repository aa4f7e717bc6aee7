"""Portions of a run: some steps that a place makes at once, in Python or in compiled code."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from operator import sub
from typing import Any, NamedTuple

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


class Portion(NamedTuple):
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
    totals    what a single step has counted, in the order of `COUNTED`, in place of `counts`
    """

    problem: Problem
    t: float
    ends: FloatArray | Sequence[float]
    states: FloatArray | Sequence[FloatArray]
    rows: Rows | list[Row]
    sampled: NDArray[np.int64] | Sequence[int]
    counts: Mapping[str, Any]
    within: Callable[[int, float], FloatArray]
    resume: Callable[[int], Resume] | None
    margins: FloatArray | None = None
    checked: bool = False
    totals: Sequence[int] = ()

    def advances(self, each: bool) -> Iterator[Advance]:
        """The steps as one `Advance`, or as one for each."""
        m = len(self.ends)
        if self.totals:
            yield self._advance(0, self.rows, 1, self.totals)
            return
        counts = [self.counts.get(name) for name in COUNTED]
        if m == 1 or not each:
            made = [0 if so_far is None else int(so_far[-1]) for so_far in counts]
            yield self._advance(m - 1, self.rows, m, made)
            return
        row, parts = 0, (_differences(so_far, m) for so_far in (self.sampled, *counts))
        for i, (rows, *made) in enumerate(zip(*parts, strict=True)):
            yield self._advance(i, self.rows[row : row + rows], 1, made)
            row += rows

    def _advance(
        self, i: int, rows: Rows | list[Row], steps: int, counts: Sequence[int]
    ) -> Advance:
        """The step i, or some that it is the last of."""
        made_of = float(self.ends[i]), self.states[i], rows, self.problem
        resume = partial(self.resume, i) if self.resume else None
        margins = self._margins(i) if self.margins is not None else None
        how = partial(self.within, i), steps, *counts, self.checked, resume, margins
        # By keywords this takes several times as long.
        return Advance._make((*made_of, *how, None, (), None))

    def _margins(self, i: int) -> Margins:
        assert self.margins is not None
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


def _differences(sums: Any, m: int) -> list[int]:
    """What each of m steps adds to these sums, if there are some."""
    if sums is None:
        return [0] * m
    values = sums if isinstance(sums, list) else sums.tolist()
    return list(map(sub, values, [0, *values]))
