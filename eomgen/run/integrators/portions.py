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
    met       called before the last step is given, which is the part of one up to an event of rigid
              contacts; None if there is none
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
    met: Callable[[], None] | None = None

    def advances(self, each: bool) -> Iterator[Advance]:
        """The steps as one `Advance`, or as one for each; the part of one is apart."""
        m = len(self.ends)
        marks = range(m) if each else range(max(0, m - 1 - (self.met is not None)), m)
        sums = (self.sampled, *(self.counts.get(name) for name in COUNTED))
        row, before = 0, -1
        parts = (_differences(so_far, marks) for so_far in sums)
        for i, (rows, *made) in zip(marks, zip(*parts, strict=True), strict=True):
            advance = self._advance(i, self.rows[row : row + rows], i - before, made)
            yield self._last(advance) if i == m - 1 else advance
            row, before = row + rows, i

    def _last(self, advance: Advance) -> Advance:
        """The last step, if that is the part of one, as such."""
        if self.met is None:
            return advance
        self.met()
        return advance._replace(resume=None, margins=None)

    def _advance(
        self, i: int, rows: Rows | list[Row], steps: int, counts: Sequence[int]
    ) -> Advance:
        """The step i, or some that it is the last of."""
        made_of = float(self.ends[i]), self.states[i], rows, self.problem
        resume = partial(self.resume, i) if self.resume else None
        margins = self._margins(i) if self.margins is not None else None
        how = partial(self.within, i), steps, *counts, resume, margins
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


def _differences(sums: Any, marks: range) -> list[int]:
    """What is added to these sums from each mark to the next, if there are some."""
    if sums is None:
        return [0] * len(marks)
    values = sums[marks.start :] if isinstance(sums, list) else sums[marks.start :].tolist()
    return list(map(sub, values, [0, *values]))
