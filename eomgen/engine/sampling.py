"""What samples at the ticks of a clock, and the noise that it measures with.

Tick n is at n / `per_second`, one division. Noise is a function of four whole numbers alone: the
seed, the number of the sensor, that of the sample, and that of the attempt. So it needs no memory,
and is the same in each language, to the bit: nothing here calls a function of a library.
"""

from dataclasses import dataclass
from typing import Annotated, Protocol

from eomgen.subset.words import Vector, Whole, inf, sqrt, uniform, zeros

LN_2 = 0.6931471805599453
HALF_ROOT = 0.7071067811865476


@dataclass(slots=True)
class Clocks:
    """What samples: after each period a sample, and a lag after it moves of states; no moves if the
    lag is 0. Times are in ticks.

    many, per_second       how many sample, and the ticks in a second
    periods, lags, seeds   of each
    made, moved            how many samples and moves each has made so far
    sets, noises, pairs    how many states are set, numbers of noise, and states moved, in all
    first_set, first_noise, first_pair
                           of each, and after the last, its first among these
    places                 indices of the states that are set
    targets, sources       those of the states that are moved
    noise                  the normal numbers of the last samples
    """

    many: int
    sets: int
    noises: int
    pairs: int
    per_second: float
    periods: Annotated[Vector, "many"]
    lags: Annotated[Vector, "many"]
    seeds: Annotated[Vector, "many"]
    made: Annotated[Vector, "many"]
    moved: Annotated[Vector, "many"]
    first_set: Annotated[Whole, "many + 1"]
    first_noise: Annotated[Whole, "many + 1"]
    first_pair: Annotated[Whole, "many + 1"]
    places: Annotated[Whole, "sets"]
    targets: Annotated[Whole, "pairs"]
    sources: Annotated[Whole, "pairs"]
    noise: Annotated[Vector, "noises"]


class Sampled(Protocol):
    """A mechanism with what samples."""

    def samples(
        self,
        t: float,
        y: Annotated[Vector, "STATES"],
        noise: Annotated[Vector, "many"],
        values: Annotated[Vector, "sets"],
    ) -> None:
        """The values that samples at a time and a state set, with these normal numbers."""
        ...


def next_tick(of: Clocks) -> float:
    """The tick of the next sample or move."""
    first = inf
    for c in range(of.many):
        first = min(first, of.made[c] * of.periods[c])
        if of.lags[c] > 0.0:
            first = min(first, of.lags[c] + of.moved[c] * of.periods[c])
    return first


def sample(system: Sampled, of: Clocks, y: Annotated[Vector, "STATES"]) -> None:
    """All moves of the next tick, then all its samples, which see the same state."""
    tick = next_tick(of)
    for c in range(of.many):
        if of.lags[c] > 0.0 and of.lags[c] + of.moved[c] * of.periods[c] == tick:
            for j in range(of.first_pair[c], of.first_pair[c + 1]):
                y[of.targets[j]] = y[of.sources[j]]
            of.moved[c] += 1.0
    due = 0
    for c in range(of.many):
        if of.made[c] * of.periods[c] == tick:
            due += 1
            for j in range(of.first_noise[c], of.first_noise[c + 1]):
                of.noise[j] = normal(of.seeds[c], 1.0 * j, of.made[c])
    if due == 0:
        return
    values = zeros(of.sets)
    system.samples(tick / of.per_second, y, of.noise, values)
    for c in range(of.many):
        if of.made[c] * of.periods[c] == tick:
            for j in range(of.first_set[c], of.first_set[c + 1]):
                y[of.places[j]] = values[j]
            of.made[c] += 1.0


def normal(seed: float, stream: float, number: float) -> float:
    """A normal number, by the polar method: G. Marsaglia, T. A. Bray, SIAM Review 6 (1964) 260."""
    attempt = 0.0
    while True:
        a = 2.0 * uniform(seed, stream, number, attempt) - 1.0
        b = 2.0 * uniform(seed, stream, number, attempt + 1.0) - 1.0
        s = a * a + b * b
        if s > 0.0 and s < 1.0:
            return a * sqrt(-2.0 * logarithm(s) / s)
        attempt += 2.0


def logarithm(x: float) -> float:
    """The natural logarithm of a number between 0 and 1, by 2 artanh((x - 1)/(x + 1))."""
    halvings = 0.0
    while x < HALF_ROOT:
        x = 2.0 * x
        halvings += 1.0
    r = (x - 1.0) / (x + 1.0)
    q = r * r
    total = 1.0 / 23.0
    for i in range(11):
        total = total * q + 1.0 / (21.0 - 2.0 * i)
    return 2.0 * r * total - halvings * LN_2
