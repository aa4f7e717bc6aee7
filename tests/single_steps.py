"""Single steps of adaptive methods in Python."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eomgen.engine.adaptive import Progress
from eomgen.run.integrators.maker import Maker

Array = NDArray[np.float64]


def made(maker: Maker) -> tuple[Progress, Callable[[Any], Array]]:
    """Make a step, at the end of which the maker then is; the states in it at times (m,)."""
    maker.begin()
    start, maker.bounds.until = maker.y, maker.t_bound
    at, raw = Progress(maker.t, length=maker.h_abs), np.empty(len(start))
    assert maker.make(maker.bounds, at, start, maker.lost, raw)
    maker.t, maker.y, maker.h_abs = at.end, raw, at.length

    def dense(times: Any) -> Array:
        place = np.empty((len(times), len(raw)))
        maker.between(at, start, raw, np.array(times)[:, None], place)
        return place.T

    return at, dense
