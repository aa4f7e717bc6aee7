"""The states of a motion at given times, by steps whose lengths follow from a tolerance."""

from typing import Annotated

from eomgen.engine.adaptive import Bounds, Progress, explicit_step, interpolate, within
from eomgen.engine.quaternions import normalised
from eomgen.engine.system import System
from eomgen.subset.words import Known, Matrix, Vector, Whole, zeros


def sampled(
    method: Known,
    system: System,
    run: Bounds,
    at: Progress,
    most: int,
    many: int,
    places: Annotated[Whole, "4 * many"],
    y: Annotated[Vector, "STATES"],
    lost: Annotated[Vector, "STATES"],
    k: Annotated[Matrix, "16", "STATES"],
    count: int,
    times: Annotated[Vector, "count"],
    rows: Annotated[Matrix, "count", "STATES"],
) -> int:
    """Fill the rows at times that ascend from `at.t`, the last of which is `run.until`, by steps
    from y with the slope k[0]; both are then those at the end. Returns how many are filled: fewer
    if a step fails, or after `most` derivatives.
    """
    raw = zeros(len(y))
    place = zeros(len(y))
    terms = zeros(7, len(y))
    done = 0
    while done < count and at.derivatives < most:
        if not explicit_step(method, system, run, at, y, lost, k, raw):
            return done
        while done < count and times[done] < at.end:
            interpolate(method, system, at, y, raw, k, terms)
            within(at, y, terms, times[done], place)
            if not normalised(many, places, place):
                return done
            rows[done] = place
            done += 1
        if not normalised(many, places, raw):
            return done
        y[:] = raw
        k[0] = k[method.last]
        at.t = at.end
        while done < count and times[done] <= at.end:
            rows[done] = y
            done += 1
    return done
