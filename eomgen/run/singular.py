"""Singular positions of a mechanism with constraints, at which a run stops."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from eomgen.run.failure import EndedRunError, StepFailure
from eomgen.run.integrators.interface import Advance
from eomgen.run.margins import NEAR, NEAR_SOLVED, SINGULAR, Seen, rank_margin, stays_away
from eomgen.run.passage import Passage
from eomgen.run.projection import Projection, without
from eomgen.run.solved_loops import SolvedLoops

FloatArray = NDArray[np.float64]

BEFORE_END = 0.3
"""A margin from which, in closed form, a step may lead to where the loops cannot be closed."""
SEARCH = 60
"""Evaluations of that search."""
REGULAR = 1e-4
"""A margin of the rank where margins are 0 that shows that the mechanism is not singular, but what
was taken as independent."""
ELSEWHERE = "take another start, or lengths that do not line up"
FLAT = "as where a disc lies flat or a rope leaves its disc"
OTHERS = "take other coordinates: loops = 'projected' in the scene, and --route aba"
"""Remedies."""


class SingularPositionError(StepFailure):
    """The mechanism, or what was taken as independent, is singular at a time."""

    def __init__(
        self, held: Projection | SolvedLoops, t: float, y: FloatArray, margins: FloatArray
    ) -> None:
        least, dead, remedy = int(np.argmin(margins)), True, OTHERS
        if isinstance(held, SolvedLoops) and least >= len(held.names):
            angle = held.angles[least - len(held.names)]
            reason = (
                f"at t = {t:.6g} s {angle}, which follows from the state in closed form, leaves "
                "the turn in which it is counted"
            )
        elif held.jacobian is without or rank_margin(held.jacobian(t, y)) > REGULAR:
            reason = (
                f"at t = {t:.6g} s what was taken as independent is at a dead point: the other "
                f"coordinates do not follow from it by constraint {held.names[least]}"
            )
            if isinstance(held, Projection):
                reason += f", or this has no direction, {FLAT}"
                remedy = f"{ELSEWHERE}, or {OTHERS}"
        else:
            dead = isinstance(held, SolvedLoops)
            remedy = OTHERS if dead else ELSEWHERE
            reason = (
                f"the mechanism is singular at t = {t:.6g} s: constraint {held.names[least]} "
                "follows from the others there, as at a change point, or has no direction, "
                f"{FLAT}"
            )
        super().__init__(reason, remedy)
        self.dead = dead

    def __reduce__(self) -> tuple[type, tuple[str, ...]]:
        return StepFailure, (self.reason, self.remedy)


def watched(
    projection: Projection | SolvedLoops,
    advances: Iterator[Advance],
    t: float,
    y: FloatArray,
    passage: Passage | None = None,
) -> Iterator[Advance]:
    """The steps of a run from (t, y), which ends where the mechanism is singular, unless a
    `passage` leads on from there.

    The margins are evaluated after each step. Where their least has a small minimum it is searched
    within the steps around it, so that no singular position is passed over. Raises `StepFailure`
    there.
    """
    seen = projection.seen or Seen()
    seen.begin(t, _least(projection, t, y))
    watch = _Watch(projection, seen)
    while True:
        beyond = None
        try:
            for advance in advances:
                if passage and not advance.margins:
                    beyond = passage.beyond(seen, (t, y), advance)
                    if beyond:
                        break
                watch.take(advance)
                t, y = advance.t, advance.y
                yield advance
        except (EndedRunError, SingularPositionError):
            raise
        except StepFailure as failure:
            beyond = passage.beyond(seen, (t, y), None) if passage else None
            if beyond is None:
                raise watch.explained(failure) from None
        if beyond is None:
            return
        steps, advances = beyond
        for advance in steps:
            t, y = advance.t, advance.y
            yield advance
        watch.begin(t, y)


class _Watch:
    """The margins of a run, as its steps are taken."""

    def __init__(self, projection: Projection | SolvedLoops, seen: Seen) -> None:
        self._projection, self._seen = projection, seen
        self._last: Advance | None = None

    def begin(self, t: float, y: FloatArray) -> None:
        """Begin with a state that ends no step."""
        self._seen.begin(t, _least(self._projection, t, y))
        self._last = None

    def take(self, advance: Advance) -> None:
        """Take account of a step. Raises `StepFailure` if it ends or passes where the mechanism is
        singular.
        """
        projection, seen = self._projection, self._seen
        if isinstance(projection, SolvedLoops) and not np.isfinite(advance.y).all():
            raise StepFailure("the loops cannot be closed", OTHERS)
        if advance.margins:
            seen.begin(advance.margins.start, advance.margins.before)
            seen.add(advance.t, advance.margins.here)
        else:
            here = _checked(projection, advance.t, advance.y)
            if not advance.t > seen.t:  # a strike
                self.begin(advance.t, advance.y)
                return
            if self._last is not None and seen.turns(advance.t, here):
                _search(projection, seen.start, self._last, advance)
            seen.add(advance.t, here)
        self._last = advance

    def explained(self, failure: StepFailure) -> StepFailure:
        """The failure of a step, which the margins may explain."""
        bound = BEFORE_END if isinstance(self._projection, SolvedLoops) else NEAR
        if self._seen.here >= bound:
            return failure
        reason = f"the mechanism is nearly singular there, and the step fails: {failure.reason}"
        near = StepFailure(reason, f"{ELSEWHERE}, or {OTHERS}")
        near.dead = True
        return near


def _search(
    projection: Projection | SolvedLoops, start: float, last: Advance, advance: Advance
) -> None:
    """Look for a singular position in two steps, of which the first begins at `start`, by golden
    section. It ends where none can be.
    """

    def margin(t: float) -> float:
        return _least(projection, t, (last if t < last.t else advance).within(t))

    a, b = start, advance.t
    at_a, at_b = margin(a), margin(b)
    ratio = (5**0.5 - 1) / 2
    c, d = b - ratio * (b - a), a + ratio * (b - a)
    at_c, at_d = margin(c), margin(d)
    for _ in range(SEARCH):
        least, times = min(at_c, at_d), (a, c, d, b)
        if least < _limit(projection) or stays_away(least, times, (at_a, at_c, at_d, at_b)):
            break
        if at_c < at_d:
            b, at_b, d, at_d = d, at_d, c, at_c
            c = b - ratio * (b - a)
            at_c = margin(c)
        else:
            a, at_a, c, at_c = c, at_c, d, at_d
            d = a + ratio * (b - a)
            at_d = margin(d)
    best = c if at_c < at_d else d
    _checked(projection, best, (last if best < last.t else advance).within(best))


def _checked(projection: Projection | SolvedLoops, t: float, y: FloatArray) -> float:
    """The least margin. Raises `SingularPositionError` if it counts as 0."""
    margins = projection.margins(t, y)
    least = float(margins.min())
    if least < _limit(projection):
        raise SingularPositionError(projection, t, y, margins)
    return least


def _least(projection: Projection | SolvedLoops, t: float, y: FloatArray) -> float:
    return float(projection.margins(t, y).min())


def _limit(projection: Projection | SolvedLoops) -> float:
    return NEAR_SOLVED if isinstance(projection, SolvedLoops) else SINGULAR
