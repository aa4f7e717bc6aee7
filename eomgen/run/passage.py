"""Runs that go through change points of a mechanism, see `eomgen.run.crossing`."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from eomgen.run.crossing import SAFE, Crossing, crossing, distance
from eomgen.run.integrators.interface import Advance
from eomgen.run.margins import Seen
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.projection import Projection

FAR, AGAIN = 0.25, 4.0
"""A margin of the rank from which on no change point is looked for; by how much it must fall before
one is looked for again."""


@dataclass
class Passage:
    """Leads a run through change points.

    begin   begins the steps of the run at (t, y), after a number of steps
    rows    (a, b) -> the times of its rows after a, up to b
    t_end   its end, s
    times   when change points were passed, s
    """

    problem: Problem
    begin: Callable[[float, FloatArray, int], Iterator[Advance]]
    rows: Callable[[float, float], Sequence[float]]
    t_end: float
    times: list[float] = field(default_factory=list)
    _made: int = 0
    _tried: float = math.inf

    def beyond(
        self, seen: Seen, start: tuple[float, FloatArray], advance: Advance | None
    ) -> tuple[Sequence[Advance], Iterator[Advance]] | None:
        """The steps that take the place of the one from `start`, `advance`, or of one that failed,
        and lead through a singular position, and those of the run that follow; None if there is no
        such position, or no way through.

        The way begins at the end of `advance`, unless that is too near to the change point, or
        beyond it.
        """
        held = _held(self.problem)
        self._made += advance.steps if advance else 0
        if advance:
            here = float(held.margins(advance.t, advance.y).min())
            if not seen.nears(here):
                return None
            margin = distance(held, advance.t, advance.y)
            if margin >= FAR:
                self._tried = math.inf
            if margin >= FAR or margin > self._tried / AGAIN:
                return None
            self._tried = margin
            if margin >= SAFE and (
                found := crossing(self.problem, advance.t, advance.y, None, self.t_end)
            ):
                return self._through(found, advance.t, (advance,))
        found = crossing(self.problem, *start, advance.t if advance else None, self.t_end)
        return self._through(found, start[0], ()) if found else None

    def _through(
        self, found: Crossing, start: float, before: Sequence[Advance]
    ) -> tuple[Sequence[Advance], Iterator[Advance]]:
        self._tried = math.inf
        end = min(found.end, self.t_end)
        if found.at <= end:
            self.times.append(found.at)

        def within(t: float) -> FloatArray:
            y = found.within(t)
            safe = distance(_held(self.problem), t, y) >= SAFE
            return self.problem.projected(t, y) if safe else y

        y = within(end)
        rows = [(t, within(t)) for t in self.rows(start, end)]
        steps = (*before, Advance(end, y, rows, self.problem, within))
        return steps, self.begin(end, y, self._made) if end < self.t_end else iter(())

    def words(self) -> str:
        """What the report says; "" if no change point was passed."""
        if not self.times:
            return ""
        count = len(self.times)
        what = "a change point" if count == 1 else f"{count} change points"
        when = f"at t = {self.times[0]:.6g} s" + ("" if count == 1 else ", the first")
        return f"went through {what} {when}, with the velocity continuous"


def _held(problem: Problem) -> Projection:
    assert problem.projection is not None
    return problem.projection
