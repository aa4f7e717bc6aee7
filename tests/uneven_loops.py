"""Random mechanisms with loops whose masses are spread over many decades: right, or refused."""

import math
import random
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from loop_routes import ROUTES, model_of
from scaled_trees import apart, found, size_of, taken
from spatial_loops import random_loops

from eomgen.base.errors import SceneError
from eomgen.dynamics.dynamics import Dynamics, Values
from eomgen.dynamics.start.constraint_equations import ConstraintEquations, newton
from eomgen.dynamics.start.walks import regular_positions
from eomgen.language.formula import Constant
from eomgen.model.model import Model
from eomgen.scalars.floats import FloatScalars
from eomgen.study.precision.extended import extended, extended_digits
from eomgen.study.verification.free_bodies import FreeBodies

DECADES = 6.0
"""Masses are 10^-6 to 10^6 times what they were."""
STATES, NUDGES = 3, 3
BOUND, TIMES = 1e-10, 1e3
"""Of v̇ relative to its largest component, or that of ω v; and of what half a unit in the last place
of all data changes it by: as for trees in `test_no_silent_error`."""
State = tuple[list[float], list[float], dict[str, float]]
"""q, v and inputs."""
WELL = ("right", "reported", "refused")


@dataclass(frozen=True)
class Outcome:
    """What came of a mechanism: one of `WELL`, or an error that is too large; the route taken, and
    the error of each route beyond what the data decide.
    """

    words: str
    route: str = "none"
    errors: Mapping[str, float] = field(default_factory=dict)


def drawn(seed: int) -> Model:
    """A mechanism with loops in the plane or in space, its masses at random over the decades."""
    dimensions, loops = 2 + seed % 2, 1 + seed // 2 % 3
    model = model_of(random_loops(seed, dimensions, 4 + loops + seed % 3, loops))
    r = random.Random(seed)
    bodies = []
    for body in model.bodies:
        factor = 10.0 ** r.uniform(-DECADES, DECADES)
        inertia = tuple(Constant(factor * model.value(x)) for x in body.inertia_com)
        bodies.append(
            replace(body, mass=Constant(factor * model.value(body.mass)), inertia_com=inertia)
        )
    return replace(model, bodies=tuple(bodies), loops_kept="projected")


def tried(seed: int, routes: tuple[str, ...] = ROUTES) -> Outcome:
    """What came of a mechanism at its start and at other positions of its motion, with the errors
    of `routes` there.
    """
    model = drawn(seed)
    try:
        made = taken(model)
    except SceneError:
        return Outcome("refused")
    words, known = "right", _known(model, seed)
    for (q, v, u), true, allowed in known:
        off = apart(found(made.system, q, v, u), true, size_of(true, model, v))
        bound = BOUND + TIMES * allowed
        if off > bound:
            stated = made.choice.digits is not None and off <= bound + 10.0**-made.choice.digits
            words = "reported" if stated else f"off by {off:.1e}, allowed {bound:.1e}"
        if words not in WELL:
            break
    return Outcome(words, made.choice.derived.route, _errors(model, known, routes))


def errors(model: Model, seed: int, routes: tuple[str, ...]) -> dict[str, float]:
    """The greatest error of routes at the states of a mechanism beyond what the data decide."""
    return _errors(model, _known(model, seed), routes)


def _known(model: Model, seed: int) -> list[tuple[State, Any, float]]:
    """The states, each with `_truth` there."""
    return [(at, *_truth(model, *at)) for at in _states(model, seed)]


def _errors(
    model: Model, known: list[tuple[State, Any, float]], routes: tuple[str, ...]
) -> dict[str, float]:
    worst = dict.fromkeys(routes, 0.0)
    for (q, v, u), true, allowed in known:
        for route in routes:
            d = Dynamics(model, Values(model.defaults, u, q, v), FloatScalars(), "own")
            own = apart(d.forward(route)(None), true, size_of(true, model, v))
            worst[route] = max(worst[route], own - TIMES * allowed)
    return worst


def _states(model: Model, seed: int) -> list[State]:
    """q, v and inputs: the scene's start, and positions along its motion with seeded velocities."""
    rng = np.random.default_rng(seed)
    mechanism = ConstraintEquations.of(model)
    everything = np.ones(len(model.velocities), dtype=bool)
    near = (newton(mechanism, q, everything) for q in regular_positions(model)[::7])
    positions = [q for q in near if q is not None]
    states = [(list(model.initial_q), list(model.initial_v))]
    for _ in range(STATES - 1 if positions else 0):
        q = positions[int(rng.integers(len(positions)))]
        matrix = mechanism.jacobian(q) / mechanism.lengths
        v = rng.uniform(-3.0, 3.0, len(model.velocities))
        v -= np.linalg.lstsq(matrix, matrix @ v, rcond=1e-12)[0]
        states.append((q.tolist(), v.tolist()))
    inputs = {i.name: float(rng.uniform(-9, 9)) for i in model.inputs}
    return [(q, v, inputs) for q, v in states]


def _truth(model: Model, q: list[float], v: list[float], u: dict[str, float]) -> tuple[Any, float]:
    """v̇ by virtual work in 60 digits, and how much of its size it changes by when all data are
    changed by up to half a unit in the last place.
    """
    r = np.random.default_rng(7)

    def exactly(nudge: float) -> Any:
        def near(values: Any) -> Any:
            return extended(values) * (1 + extended(nudge * r.uniform(-1, 1, len(values))))

        with extended_digits():
            p, w = (
                dict(zip(given, near(list(given.values())), strict=True))
                for given in (model.defaults, u)
            )
            return FreeBodies(model, 0.0, near([*q, *v]), w, p).vd

    with extended_digits():
        true = exactly(0.0)
        size = size_of([float(x) for x in true], model, v)
        if not size or not math.isfinite(size):
            return true, 0.0
        moved = [exactly(2.0**-53) for _ in range(NUDGES)]
        off = max(float(max(abs(m - true))) for m in moved)
    return true, off / float(size)
