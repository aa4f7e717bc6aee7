"""Runs of mechanisms with controllers that sample, by the rules of `eomgen.engine.sampling`.

Between two ticks at which something samples or changes, the motion is that of constant held values,
and the method makes its own steps; the last one ends at the tick, to the bit. The state there is
that after the sample.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from eomgen.base.errors import RunError
from eomgen.engine.sampling import Clocks, next_tick, sample
from eomgen.run.compiled import Touched
from eomgen.run.integrators.interface import Advance, Begin, Resume
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.rows import Row, Rows

Samples = Callable[[float, FloatArray, FloatArray], FloatArray]
"""What samples set, of t, y and normal numbers."""
Between = Callable[[float, float], Begin]
"""Steps between two times at which something changes, s."""
LARGEST_SEED = 2.0**53


class Function(NamedTuple):
    """A controller in Python, with the numbers of its readings and states: of time, readings and
    states it gives the states and what is held after the sample.
    """

    readings: int
    states: int
    of: Callable[[float, FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class Sampling:
    """The controllers of a module that sample, by name, with what the module says of each; the seed
    of each; what their samples set; and those that are functions of Python.
    """

    controllers: Mapping[str, Mapping[str, Any]]
    seeds: Sequence[float]
    values: Samples
    functions: Mapping[str, Function] = field(default_factory=dict)

    def sample(self, clocks: Clocks, y: FloatArray) -> None:
        """Make the moves and samples of the next tick."""
        sample(_Now(self, clocks), clocks, y)

    def clocks(self, t: float) -> Clocks:
        """The clocks after all samples and moves up to a time, s."""
        of = list(self.controllers.values())
        sizes = [len(c["sets"]) for c in of], [len(c["noises"]) for c in of]
        firsts = [_firsts(each) for each in (*sizes, [len(c["moves"]) for c in of])]
        pairs = [pair for c in of for pair in c["moves"]]
        per_second = float(of[0]["ticks per second"])
        periods, lags = [float(c["period"]) for c in of], [float(c["lag"]) for c in of]
        return Clocks(
            many=len(of),
            sets=firsts[0][-1],
            noises=firsts[1][-1],
            pairs=len(pairs),
            per_second=per_second,
            periods=periods,  # type: ignore[arg-type]  # lists, which are quicker
            lags=lags,  # type: ignore[arg-type]
            seeds=list(self.seeds),  # type: ignore[arg-type]
            made=[_ticks(t, per_second, period, 0.0) for period in periods],  # type: ignore[arg-type]
            moved=[_ticks(t, per_second, *x) for x in zip(periods, lags, strict=True)],  # type: ignore[arg-type]
            first_set=firsts[0],  # type: ignore[arg-type]
            first_noise=firsts[1],  # type: ignore[arg-type]
            first_pair=firsts[2],  # type: ignore[arg-type]
            places=[i for c in of for i in c["sets"]],  # type: ignore[arg-type]
            targets=[a for a, _ in pairs],  # type: ignore[arg-type]
            sources=[b for _, b in pairs],  # type: ignore[arg-type]
            noise=[0.0] * firsts[1][-1],  # type: ignore[arg-type]
        )

    def begun(self, problem: Problem) -> Problem:
        """The problem after the samples at t = 0."""
        clocks, y = self.clocks(-1.0), problem.initial.copy()
        self.sample(clocks, y)
        return problem.having(initial=problem.unit(y))


@dataclass(frozen=True, eq=False)
class _Now:
    """What samples at the next tick set, as the engine asks."""

    of: Sampling
    clocks: Clocks

    def samples(self, t: float, y: FloatArray, noise: Any, values: FloatArray) -> None:
        """Compute it."""
        values[:] = self.of.values(t, y, np.array(noise, dtype=float))
        tick = next_tick(self.clocks)
        for c, name in enumerate(self.of.controllers):
            function = self.of.functions.get(name)
            if function and self.clocks.made[c] * self.clocks.periods[c] == tick:
                first, last = self.clocks.first_set[c : c + 2]
                rest, places = first + function.readings, list(self.clocks.places[first:last])
                before = y[places[function.readings :][: function.states]]
                values[rest:last] = function.of(t, values[first:rest], before)


def _firsts(sizes: Sequence[int]) -> list[int]:
    return [0, *np.cumsum(sizes).tolist()]


def _ticks(t: float, per_second: float, period: float, lag: float) -> float:
    """How many of the ticks `lag`, `lag` + `period`, … are not after a time, s."""
    if t < 0:
        return 0.0
    near = max(0, int((t * per_second - lag) / period) - 1)
    while (lag + near * period) / per_second <= t:
        near += 1
    return float(near)


def sampled(of: Sampling, between: Between, t_start: float, t_end: float) -> Begin:
    """Steps of a run from `t_start` to `t_end`, of which `between` makes those between ticks."""

    def begin(
        problem: Problem,
        t: float,
        made: int,
        resume: Resume | None = None,
        touched: Touched | None = None,
    ) -> Iterator[Advance]:
        clocks = of.clocks(t)
        held = sorted({*clocks.places, *clocks.targets, *clocks.sources})
        start = max(t_start, _last_tick(clocks))
        while True:
            until = next_tick(clocks) / clocks.per_second
            reached = False
            steps = between(start, min(until, t_end))
            for advance in steps(problem, t, made, resume, touched):
                made += advance.steps
                reached = advance.t == until
                rows = _holding(advance.samples, held, problem.initial)
                if reached:
                    y = np.array(advance.y)
                    y[held] = problem.initial[held]
                    of.sample(clocks, y)
                    rows = _after(rows, until, y)
                    problem = problem.having(initial=y)
                    advance = advance._replace(y=y, resume=None)
                yield advance._replace(samples=rows)
            if not reached or not until < t_end:
                return
            start = t = until
            resume = None

    return begin


def _last_tick(of: Clocks) -> float:
    """The time of the last sample or move, s."""
    ticks = [(n - 1) * period for n, period in zip(of.made, of.periods, strict=True)]
    parts = zip(of.moved, of.periods, of.lags, strict=True)
    last: float = max(*ticks, *(lag + (n - 1) * period for n, period, lag in parts))
    return last / of.per_second


def _holding(rows: Sequence[Row], held: Sequence[int], y: FloatArray) -> Sequence[Row]:
    """Rows in which what is held is as in y: between the ends of steps it may be rounded."""
    if isinstance(rows, Rows):
        states = rows.y.copy()
        states[:, held] = y[held]
        return Rows(rows.t, states)
    found = []
    for t, row in rows:
        state = row.copy()
        state[held] = y[held]
        found.append((t, state))
    return found


def _after(rows: Sequence[Row], t: float, y: FloatArray) -> Sequence[Row]:
    """Rows of which that at t has this state."""
    if not rows or rows[-1][0] != t:
        return rows
    if isinstance(rows, Rows):
        states = rows.y.copy()
        states[-1] = y
        return Rows(rows.t, states)
    return [*rows[:-1], (t, y)]


def sampling_of(module: Any, parameters: Any = None, inputs: Any = None) -> Sampling | None:
    """What samples in a module; None if nothing does. Raises `RunError` for a seed that is no whole
    number.
    """
    controllers = getattr(module, "CONTROLLERS", None)
    if not controllers:
        return None
    seeds = module.seeds(0.0, module.initial_state(parameters), parameters, inputs).tolist()
    for name, seed in zip(controllers, seeds, strict=True):
        if not (0 <= seed < LARGEST_SEED and seed == int(seed)):
            raise RunError(
                f"seed of {name}: {seed:g} is not a whole number from 0 to 2^53; give one"
            )
    return Sampling(
        controllers, seeds, lambda t, y, noise: module.samples(t, y, noise, parameters, inputs)
    )
