"""Clocks of what samples: whole ticks, so that times of samples are exact and meet where they
should.

A number of a scene stands for the simplest fraction that rounds to it: 0.01 for 1/100. All periods
and delays are whole multiples of one tick. Tick n is at n / `per_second`, one division, so that no
sum of periods rounds, and 7 periods of 0.01 s are one of 0.07 s.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from eomgen.base.errors import RunError, SceneError
from eomgen.model.model import Model
from eomgen.scene.effects.base import EffectTable, simplest

MOST = 10**9
"""Greatest number of ticks in a second: those of 100 days are exact doubles then."""


@dataclass(frozen=True)
class Clock:
    """The ticks of an effect: it samples at every `period`-th, and what it holds changes `lag`
    ticks later, after `waiting` - 1 further samples if it is due with a delay.
    """

    effect: str
    period: int
    lag: int
    waiting: int


def clocks_of(effects: Sequence[EffectTable]) -> tuple[int, tuple[Clock, ...]]:
    """The ticks in a second, and the clock of each effect that samples.

    Raises `SceneError` if their times have no common tick that is long enough.
    """
    found = [(e, s) for e in effects if (s := e.sampling()) is not None]
    times = [(simplest(s.period), simplest(s.delay)) for _, s in found]
    per_second = math.lcm(*(t.denominator for pair in times for t in pair))
    if per_second > MOST:
        raise SceneError(
            f"effects: the periods and delays of {', '.join(e.name for e, _ in found)} have no "
            "common tick of a nanosecond or more; give them fewer digits"
        )
    clocks = []
    for (effect, _), (period, delay) in zip(found, times, strict=True):
        waiting = math.ceil(delay / period)
        lag = delay - (waiting - 1) * period if waiting else delay
        clocks.append(Clock(effect.name, int(period * per_second), int(lag * per_second), waiting))
    return per_second, tuple(clocks)


def check_no_samples(model: Model, what: str) -> None:
    """Raise `RunError` if a controller of a model samples, which some code does not do."""
    if model.sampled:
        raise RunError(
            f"effects: '{model.sampled[0]}' samples, which {what} do not; leave it out, and set "
            "its inputs from outside"
        )
