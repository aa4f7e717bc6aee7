"""Explicit steps of equal length in three languages: the same bits over random inputs."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from languages import Given, results

from eomgen.engine import equal_steps, explicit, quaternions, sums, system
from eomgen.engine.adaptive import MADE
from eomgen.engine.equal_steps import EVENT
from eomgen.engine.explicit import Step
from eomgen.subset.text import Text

TEXT = Text.of(equal_steps, explicit, quaternions, sums, system)
SEEDED = np.random.default_rng(3)
N, POSITIONS, OTHERS = 5, np.array([1, 3]), np.array([0, 2, 4])


class Python:
    """Functions of `System`, `Method`, `Constrained` and `Events`."""

    def derivative(self, t: float, y: Any) -> Any:
        return y * y[::-1] - t * y

    def changed(self, t: float, y: Any, h: float, step: Step) -> int:
        slope = self.derivative(t, y)
        step.change = h * slope
        step.slope = slope
        step.place = y + 0.0
        return 2 if y[0] > -1.0 else 0

    def clear(self) -> None: ...

    def is_raised(self) -> bool:
        return False

    def may_jump(self, t: float, y: Any, change: Any) -> bool:
        return bool(change[0] > y[2] * t)

    def projected(self, t: float, y: Any) -> bool:
        y[1] *= 1.0 + 1e-3 * t
        return bool(y[1] < 2.0)

    def event(self, method: Any, t: float, y: Any, end: Any) -> int:
        if y[3] < 0.05:
            return MADE
        y[3] = t
        end[0] -= 0.01
        return EVENT

    def keep_step(self, t: float, y: Any, margin: Any) -> bool:
        margin[0] = y[0]
        return True


GIVEN = Given(
    Python(),
    """enum { STATES = 5, POSITIONS = 2, OTHERS = 3 };
struct Step;
typedef struct { int none; } System;
typedef System Method;
typedef System Constrained;
typedef System Events;
static void derivative(System *s, double t, const double *y, double *out) {
    (void)s;
    for (int j = 0; j < 5; j++) out[j] = y[j] * y[4 - j] - t * y[j];
}
static int64_t changed(Method *m, double t, const double *y, double h, struct Step *step);
static void clear(Constrained *h) { (void)h; }
static int64_t is_raised(Constrained *h) { (void)h; return 0; }
static int64_t may_jump(Constrained *h, double t, const double *y, const double *change) {
    (void)h;
    return change[0] > y[2] * t;
}
static int64_t projected(Constrained *h, double t, double *y) {
    (void)h;
    y[1] *= 1.0 + 1e-3 * t;
    return y[1] < 2.0;
}
static int64_t event(Events *e, Method *m, double t, double *y, double *end) {
    (void)e, (void)m;
    if (y[3] < 0.05) return 0;
    y[3] = t;
    *end -= 0.01;
    return 3;
}
static int64_t keep_step(Constrained *h, double t, const double *y, double *margin) {
    (void)h, (void)t;
    *margin = y[0];
    return 1;
}
""",
    """const [STATES, POSITIONS, OTHERS] = [5, 2, 3];
const system = {
  derivative: (t, y, out) => y.forEach((x, j) => (out[j] = x * y[4 - j] - t * x)),
  changed: (t, y, h, step) => {
    system.derivative(t, y, step.slope);
    step.slope.forEach((x, j) => (step.change[j] = h * x));
    y.forEach((x, j) => (step.place[j] = x + 0));
    return y[0] > -1 ? 2 : 0;
  },
  clear: () => {},
  is_raised: () => 0,
  may_jump: (t, y, change) => change[0] > y[2] * t,
  projected: (t, y) => { y[1] *= 1 + 1e-3 * t; return y[1] < 2; },
  event: (method, t, y, end) => {
    if (y[3] < 0.05) return 0;
    y[3] = t;
    end[0] -= 0.01;
    return 3;
  },
  keep_step: (t, y, margin) => { margin[0] = y[0]; return 1; },
};
""",
    """static int64_t changed(Method *m, double t, const double *y, double h, Step *step) {
    derivative(m, t, y, step->slope);
    for (int j = 0; j < 5; j++) step->change[j] = h * step->slope[j], step->place[j] = y[j] + 0.0;
    return y[0] > -1.0 ? 2 : 0;
}
""",
)


def some(*shape: int) -> Any:
    """Random numbers, some of them 0."""
    found = SEEDED.normal(size=shape)
    return np.where(SEEDED.random(shape) < 0.1, -0.0, found)


def step() -> Step:
    """Room for a step."""
    return Step(some(N), some(N), some(N))


def split() -> explicit.Split:
    """Some positions."""
    return explicit.Split(POSITIONS, OTHERS, some(2, 3))


def course(many: int, most: int, allowed: float) -> equal_steps.Course:
    """Steps that may be made."""
    places = np.array([3, 0, 2, 4] * many)
    given = some(N), np.full(N, allowed), some(N), some(N)
    return equal_steps.Course(0.1, 0.52, 0.1, 0.09, 1, most, *given, many, places)


def kept(most: int) -> equal_steps.Kept:
    """Room for steps."""
    rows = [some(most, N), some(most, N)]
    return equal_steps.Kept(9, most, some(most), *rows, np.zeros(most, np.int64), some(most))


STEPS: dict[str, tuple[dict[str, Any], list[list[Any]]]] = {
    "runge_kutta euler": ({"method": explicit.EULER}, [[]]),
    "runge_kutta rk4": ({"method": explicit.RUNGE_KUTTA_4}, [[]]),
    "semi_implicit_euler": ({}, [[POSITIONS]]),
    "leapfrog": ({}, [[split()] for _ in range(5)]),
    "composed 4": ({"of": explicit.LEAPFROG_4}, [[]]),
    "composed 6": ({"of": explicit.LEAPFROG_6}, [[]]),
}


@pytest.mark.every(2)
@pytest.mark.parametrize("name", STEPS)
def test_steps(name: str) -> None:
    """A step from random states."""
    known, firsts = STEPS[name]
    cases = [
        [GIVEN, *first, 0.3, some(N), h, step()] for first in firsts for h in (0.1, -0.05, 1e300)
    ]
    python, *others = results(TEXT, name.split()[0], cases, known, given=GIVEN)
    assert others == [python, python]


def test_rates_sums_and_lengths() -> None:
    """The matrix of rates, sums, and quaternions, of which one has no length."""
    given = replace(GIVEN, c_after="")
    rates = [[given, POSITIONS, OTHERS, some(N), some(2, 3)] for _ in range(3)]
    added = [[sums.Sum(some(N) * 10.0**i, some(N) * 1e-17), some(N)] for i in range(-9, 9, 3)]
    turned = [[1, np.array([0, 1, 3, 4]), some(N) * size] for size in (1.0, 1e90, 0.0, 1e200)]
    for name, cases in (
        ("constant_rates", rates), ("add_compensated", added), ("normalised", turned)
    ):  # fmt: skip
        python, *others = results(TEXT, name, cases, given=given)
        assert others == [python, python]


def test_many_steps() -> None:
    """They end at once, after some, or at the last; for each reason."""
    cases: list[list[Any]] = []
    for many, most, allowed in ((0, 6, np.inf), (1, 3, 1e9), (0, 3, 0.01), (1, 0, np.inf)):
        for factor in (0.1, 1.0, 1e200, np.nan):
            at = sums.Sum(factor * some(N), some(N) * 1e-17)
            given = [GIVEN, GIVEN, GIVEN, 0.2, at, course(many, most, allowed), step(), kept(most)]
            cases.append(given)
    python, *others = results(TEXT, "equal_steps", cases, given=GIVEN)
    assert others == [python, python]
    assert len({case[-1] for case in python}) == 3


def test_sums_lose_nothing() -> None:
    """10,000 tenths are 1000 to the last digit."""
    total = sums.Sum(np.zeros(1), np.zeros(1))
    for _ in range(10_000):
        sums.add_compensated(total, np.array([0.1]))
    assert total.value[0] == 1000.0
