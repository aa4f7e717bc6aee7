"""What steps pass over, in three languages: the same bits along random motions."""

from typing import Any

import numpy as np
import pytest
from campaign import some
from languages import Given, results

from eomgen.engine.adaptive import Bounds
from eomgen.engine.branches import PASSED_OVER, PASSES_NOTHING, UNFOLLOWED
from eomgen.engine.printed import text
from eomgen.engine.roots import Search
from eomgen.run.branches import switches, watch

MANY, STATES = 5, 3


class Waves:
    """States that are polynomials of time, functions of them that jump or bend, and gaps."""

    def states_at(self, n: int, times: Any, to: Any) -> None:
        """At some times."""
        for i, t in enumerate(times[:n].tolist()):
            to[i] = t * (2.0 - t), t * t * t - t, 8.0 * t

    def switching_at(self, t: float, y: Any, to: Any) -> None:
        """Functions with none, one and many zeros, and one that is no number from a time on."""
        far = t - 8.0
        to[:] = y[0] - 0.8, y[1] + 0.3, y[2] - 7.0 * t - 0.4, y[2] * (3.0 - y[2]), far
        if t > 1.9:
            to[1] = np.nan

    def slope_at(self, t: float, y: Any, to: Any) -> None:
        """Rates with jumps where functions cross 0."""
        to[:] = (1.0 if y[0] > 0.8 else 0.0), (2.0 if y[1] > -0.3 else y[0]), t * t

    def gaps_at(self, s: float, gap: Any, rate: Any) -> None:
        """Of two contacts."""
        gap[:] = 1.0 - s, (s - 0.6) * (s - 0.6) + 1e-3
        rate[:] = -1.0, 2.0 * (s - 0.6)


C = """
enum { STATES = 3 };
typedef struct { int none; } Along;
typedef Along Apart;
static void states_at(Along *of, int64_t n, const double *times, double *to) {
    for (int64_t i = 0; i < n; i++) {
        const double t = times[i];
        to[3 * i] = t * (2.0 - t), to[3 * i + 1] = t * t * t - t, to[3 * i + 2] = 8.0 * t;
    }
}
static void switching_at(Along *of, double t, const double *y, double *to) {
    to[0] = y[0] - 0.8, to[1] = y[1] + 0.3, to[2] = y[2] - 7.0 * t - 0.4;
    to[3] = y[2] * (3.0 - y[2]), to[4] = t - 8.0;
    if (t > 1.9) to[1] = NAN;
}
static void slope_at(Along *of, double t, const double *y, double *to) {
    to[0] = y[0] > 0.8 ? 1.0 : 0.0, to[1] = y[1] > -0.3 ? 2.0 : y[0], to[2] = t * t;
}
static void gaps_at(Apart *of, double s, double *gap, double *rate) {
    gap[0] = 1.0 - s, gap[1] = (s - 0.6) * (s - 0.6) + 1e-3;
    rate[0] = -1.0, rate[1] = 2.0 * (s - 0.6);
}
"""
JAVASCRIPT = """
const STATES = 3;
const system = {
  states_at: (n, times, to) => {
    for (let i = 0; i < n; i++) {
      const t = times[i];
      to.set([t * (2.0 - t), t * t * t - t, 8.0 * t], 3 * i);
    }
  },
  switching_at: (t, y, to) => {
    to.set([y[0] - 0.8, y[1] + 0.3, y[2] - 7.0 * t - 0.4, y[2] * (3.0 - y[2]), t - 8.0]);
    if (t > 1.9) to[1] = NaN;
  },
  slope_at: (t, y, to) => to.set([y[0] > 0.8 ? 1.0 : 0.0, y[1] > -0.3 ? 2.0 : y[0], t * t]),
  gaps_at: (s, gap, rate) => {
    gap.set([1.0 - s, (s - 0.6) * (s - 0.6) + 1e-3]);
    rate.set([-1.0, 2.0 * (s - 0.6)]);
  },
};
"""
WAVES = Given(Waves(), C, JAVASCRIPT)


def same(name: str, cases: list[list[Any]]) -> list[list[str]]:
    """What a function leaves and returns, which is the same in all languages."""
    python, c, javascript = results(text(), name, cases, given=WAVES)
    assert python == c
    assert python == javascript
    return python


def case(seeded: np.random.Generator) -> list[Any]:
    """A step, after another one or not, with some switches known or without."""
    start = float(seeded.uniform(0.0, 1.5))
    end = start + float(10 ** seeded.uniform(-3, 0.3))
    along, room = Waves(), int(seeded.choice([1, 8, 32]))
    of = watch(MANY, STATES, (2,)[: seeded.integers(2)], bool(seeded.integers(2)), room=room)
    ends = np.zeros((2, STATES))
    along.states_at(2, np.array([start, end]), ends)
    if seeded.integers(3):
        of.here, of.earlier = start, start - (end - start)
        along.switching_at(start, ends[0], of.first)
        of.before[:] = of.first + 1e-2 * seeded.normal(size=MANY)
    if not seeded.integers(4):
        of.marked, of.marks[:4] = 3, (0.0, 0.3, 0.31, 1.0)
    last = float(seeded.choice([-np.inf, start - 0.1, start - 1e-3]))
    found = switches(STATES, room=40, last=last, unseen=0.3)
    found.many = int(seeded.integers(2))
    found.times[0] = start + 0.4 * (end - start)
    bounds = Bounds(np.full(STATES, 10 ** seeded.uniform(-9, 0)), 1e-3, 1.0)
    follows = bool(seeded.integers(5))
    return [of, found, WAVES, bounds, Search(), start, end, *ends, follows]


def test_steps_pass_over_the_same() -> None:
    """Whatever is found, it is the same, with all that is left behind."""
    seeded = np.random.default_rng(3)
    found = same("passed_over", [case(seeded) for _ in range(some(150, 5000))])
    answers = {int(bits[-1][:4], 16) for bits in found}
    assert answers == {{0: 0x0000, 1: 0x3FF0, 2: 0x4000}[x] for x in (0, PASSED_OVER, UNFOLLOWED)}
    assert PASSES_NOTHING == 0


@pytest.mark.parametrize("length", [0.3, 0.9, 1.2])
def test_contacts_stay_apart_in_the_same_steps(length: float) -> None:
    """One comes near and goes, another closes in the longest step."""
    found = same("stay_apart", [[WAVES, 2, length]])
    assert (found[0][-1][:4] == "3ff0") == (length < 0.5)
