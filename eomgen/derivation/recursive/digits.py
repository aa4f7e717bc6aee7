"""How many digits a route loses on a model, measured in numbers before code is written."""

import math
import random
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from eomgen.derivation.recursive.dynamics import Dynamics, Values
from eomgen.derivation.recursive.numbers import FloatScalars
from eomgen.derivation.recursive.vectors import Scalars
from eomgen.effects import Driven, Gravity
from eomgen.model import Model

TRIALS, ALIGNED, PUSHED, NUDGES = 2, 2, 1, 3
"""States at random, at multiples of 45 degrees, and under forces; how often numbers are changed."""
ROUTES = ("closed", "ldl", "aba", "orthogonal")
EPSILON = sys.float_info.epsilon
ALL = -math.log10(sys.float_info.epsilon)
"""The digits of a double."""

Accelerations = Callable[[Values], Sequence[float]]
"""v̇ at values of a model."""


def digits_lost(
    model: Model, closed: Accelerations | None = None, exactly: Scalars | None = None
) -> Mapping[str, float]:
    """The decimal digits that routes lose on v̇, relative to its largest component or 1, at the
    worst of some seeded states, random and aligned ones; 0 to `ALL`.

    closed   v̇ by the closed form, which is judged, too
    exactly  scalars of many digits, by which all are judged, and `orthogonal`, too; what half a
             unit in the last place of all numbers given would change counts as nothing. Without
             them `orthogonal` is what the others are compared with.

    Of the effects uniform gravity and drives act, or with a closed form all, the scene's own
    parameters hold, and inputs are 0; where there are other effects, forces of about 1 N or N m on
    all velocities stand for them at some more states. A route that gives no number at a state loses
    all digits; a state where there is none at all says nothing.
    """
    still = model
    if closed is None:
        kept = tuple(e for e in model.effects if isinstance(e, Gravity | Driven))
        still = replace(model, effects=kept)
    rng = random.Random(6)
    worst: dict[str, float] = {}
    pushed = PUSHED if len(still.effects) < len(model.effects) else 0
    for trial in range(TRIALS + ALIGNED + pushed):
        q = [rng.uniform(-1.5, 1.5) for _ in model.coordinates]
        if TRIALS <= trial < TRIALS + ALIGNED:
            q = _aligned(model, rng)
        v = [rng.uniform(-1.5, 1.5) for _ in model.velocities]
        tau = [rng.uniform(-1.0, 1.0) for _ in v] if trial >= TRIALS + ALIGNED else None
        inputs = {i.name: 0.0 for i in model.inputs}
        states = {x.name: x.initial for x in model.states}
        values = Values(model.defaults, inputs, q, v, states)
        try:
            d = Dynamics(still, values, FloatScalars(), "own")
            true, allowed = (
                (d.orthogonal_forward(tau), EPSILON)
                if exactly is None
                else _exactly(still, values, tau, exactly)
            )
        except (ArithmeticError, ValueError):
            continue  # no v̇ there to lose digits of
        forward: dict[str, Callable[[], Sequence[float]]] = {
            "aba": partial(d.articulated_forward, tau),
            "ldl": partial(d.factored_forward, tau),
            "orthogonal": partial(d.orthogonal_forward, tau),
        }
        if closed is not None:
            forward["closed"] = partial(closed, values)
        for route, found in forward.items():
            off = _off(found, true) / allowed
            worst[route] = max(worst.get(route, 0.0), off)
    return {route: _digits(worst.get(route, 1.0)) for route in ROUTES}


def _aligned(model: Model, rng: random.Random) -> list[float]:
    """Coordinates where levers vanish and axes meet."""
    q = [
        rng.randrange(-4, 5) * (math.pi / 4) if c.unit == "rad" else rng.choice((0.0, 1.0))
        for c in model.coordinates
    ]
    for indices in model.quaternions:
        for n, i in enumerate(indices):
            q[i] = float(n == 0)
    return q


def _exactly(
    model: Model, values: Values, tau: Sequence[float] | None, scalars: Scalars
) -> tuple[list[Any], float]:
    """v̇ in many digits, and what it is off where all numbers are by half a unit in the last place,
    in parts of its size; at least `EPSILON`.
    """
    rng = random.Random(7)

    def forward(nudge: float) -> list[Any]:
        def near(x: float) -> Any:
            return scalars.number(x) * (1 + scalars.number(nudge * rng.uniform(-1, 1)))

        given = (values.parameters, values.inputs, values.states)
        named = [{name: near(x) for name, x in own.items()} for own in given]
        q, v = ([near(x) for x in own] for own in (values.q, values.v))
        near_by = Values(named[0], named[1], q, v, named[2], scalars.number(0.0))
        forces = None if tau is None else [near(x) for x in tau]
        return Dynamics(model, near_by, scalars, "own").articulated_forward(forces)

    true = forward(0.0)
    apart = max(_apart(forward(EPSILON / 2), true) for _ in range(NUDGES))
    return true, max(EPSILON, apart / _size(true))


def _off(found: Callable[[], Sequence[float]], true: Sequence[Any]) -> float:
    """What a route's v̇ is off, in parts of its size; infinite where it gives no number."""
    try:
        off = _apart(found(), true) / _size(true)
    except (ArithmeticError, ValueError):
        return math.inf
    return off if off == off else math.inf


def _size(values: Sequence[Any]) -> float:
    return max([1.0, *(float(abs(x)) for x in values)])


def _apart(one: Sequence[Any], other: Sequence[Any]) -> float:
    """The greatest difference; nan if one of them is."""
    apart = [float(abs(a - b)) for a, b in zip(one, other, strict=True)]
    return math.nan if any(map(math.isnan, apart)) else max(apart, default=0.0)


def _digits(times: float) -> float:
    return min(ALL, math.log10(times)) if times > 1.0 else 0.0
