"""The decimal digits that a route loses on a model, measured before code is written.

The route's own steps are run in numbers, and compared with extended precision.
"""

import math
import random
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eomgen.codegen.perturbed import perturbed
from eomgen.dynamics.dynamics import Dynamics, Values
from eomgen.dynamics.start.assur import completed
from eomgen.dynamics.start.walks import reached_positions, regular_positions
from eomgen.dynamics.tree.frames import Linkage
from eomgen.dynamics.tree.kinematics import Axes
from eomgen.dynamics.tree.linkage import make_linkage
from eomgen.model.model import Model
from eomgen.scalars.extended import Bits, out_of_bits, sixty_digits
from eomgen.scalars.floats import ArrayScalars

Array = NDArray[np.float64]

KINDS = ("anywhere", "aligned", "in line", "nearly")
"""Kinds of states: random; angles that are multiples of 45 degrees, where arms vanish and axes
meet; some angles 0, the only multiple that is a double, where they do so exactly; and some angles
1e-17 to 1 from 0 or a quarter turn, where arms and angles between axes are small.
"""
EACH, CLOSELY, ROUGHLY = 120, 3, 1
"""States of each kind; and at how many of them routes are compared with extended precision. These
are the states where two routes disagree most; and, closely, where a change of all numbers in their
last place has the greatest effect.
"""
SURE = 100.0
"""This many times the change of v̇ by half a unit in the last place of all numbers is no loss."""
UNEXPLAINED = 1000.0
"""An error of more than this many times that change has another cause, and counts in full."""
TRUSTED = 100.0
"""`orthogonal` is the reference at all states if its error against extended precision is at most so
many times what is allowed.
"""
PUSH = 10.0
"""The greatest size of inputs."""
EPSILON = sys.float_info.epsilon
ALL = -math.log10(EPSILON)
"""The digits of a double."""

Accelerations = Callable[[Values], Sequence[Any]]
"""v̇ at values of a model, numbers or arrays of them for several states."""


@dataclass(frozen=True)
class Route:
    """A route's v̇, by the steps of its program, and the axes in which its recursion works, None
    for a symbolic route.
    """

    accelerations: Accelerations
    axes: Axes | None


def digits_lost(
    model: Model, routes: Mapping[str, Route], *, closely: bool = False
) -> Mapping[str, float]:
    """The decimal digits of v̇ that each route, and `orthogonal`, loses at the worst of some seeded
    states: the largest of `digits_lost_by_kind`.
    """
    found = digits_lost_by_kind(model, routes, closely=closely)
    return {route: max(lost) for route, lost in found.items()}


def digits_lost_by_kind(
    model: Model, routes: Mapping[str, Route], *, closely: bool = False
) -> Mapping[str, tuple[float, ...]]:
    """The decimal digits of v̇ that each route, and `orthogonal`, loses at the worst of some seeded
    states of each of the `KINDS`, half of them at rest; 0 to `ALL`.

    Errors are relative to the largest component of v̇, or to ω v, the size of velocity-dependent
    terms, which may cancel. At a state where this is smaller than usual they are relative to the
    usual size, at most 1, since v̇ may vanish at a state.

    closely  compare routes with extended precision at all states in doubt, and allow for the effect
             of half a unit in the last place of all given numbers. Otherwise compare them with
             `orthogonal`, and with extended precision at one state of each kind, which takes a
             tenth of the time.

    First only uniform gravity and drives act (with a closed form all effects, without inputs); then
    all effects, with inputs of up to `PUSH`. The parameters are the scene's. A route that gives no
    finite number at a state loses all digits; a state where none does is left out.
    """
    rng = random.Random(6)
    if model.constraints:
        positions = reached_positions if model.groups else regular_positions
        closed = positions(model) or (np.array(model.initial_q),)
        q = [
            closed[n * len(closed) // (EACH * len(KINDS))].tolist()
            for n in range(EACH * len(KINDS))
        ]
    else:
        q = [_position(model, kind, rng) for kind in KINDS for _ in range(EACH)]
    v = [[n % 2 * rng.uniform(-1.5, 1.5) for _ in model.velocities] for n in range(len(q))]
    if model.groups:
        q, v = _on_constraints(model, q, v)
    pushes = [{i.name: rng.uniform(-PUSH, PUSH) for i in model.inputs} for _ in q]
    still = model
    if all(route.axes for route in routes.values()):
        kept = tuple(e for e in model.effects if e.uniform or e.prescribes())
        still = replace(model, effects=kept)
    nothing = {i.name: 0.0 for i in model.inputs}
    states = {x.name: x.initial for x in model.extra}
    parts = [(still, [nothing] * len(q))]
    if model.inputs or len(still.effects) < len(model.effects):
        parts.append((model, pushes))
    worst = {route: np.zeros(len(KINDS)) for route in (*routes, "orthogonal")}
    for acting, inputs in parts:
        at = [Values(model.defaults, *rest, states) for rest in zip(inputs, q, v, strict=True)]
        solvers = {name: _solver(name, route, model, acting) for name, route in routes.items()}
        for name, off in _off(acting, at, solvers, closely).items():
            worst[name] = np.maximum(worst[name], off)
    return {route: tuple(map(_digits, off.tolist())) for route, off in worst.items()}


def _on_constraints(
    model: Model, q: Sequence[Sequence[float]], v: Sequence[Sequence[float]]
) -> tuple[list[list[float]], list[list[float]]]:
    """States with coordinates and velocities that follow from the others as the groups give them,
    all at once.
    """
    names = {i.name: i.default for i in model.inputs}
    states = {x.name: x.initial for x in model.extra}

    def at(q: Sequence[Any], v: Sequence[Any] | None = None) -> Dynamics:
        still = [0.0] * len(model.velocities) if v is None else v
        return Dynamics(model, Values(model.defaults, names, q, still, states), ArrayScalars())

    closed = completed(at, model.groups, list(np.array(q).T))
    moving = at(closed, list(np.array(v).T)).constrained("independent").velocity()
    together = (np.array(np.broadcast_arrays(*part, np.empty(len(q)))[:-1]).T.tolist()
                for part in (closed, moving))  # fmt: skip
    first, second = together
    return first, second


def _solver(name: str, route: Route, model: Model, acting: Model) -> Accelerations:
    """v̇ by a route, of a model on which other effects may be `acting`."""
    if acting is model or route.axes is None:
        return route.accelerations
    return _recursion(name, acting, route.axes)


def _recursion(name: str, model: Model, axes: Axes) -> Accelerations:
    """v̇ by a recursion over arrays."""

    def found(values: Values) -> Sequence[Any]:
        # All states at once, so that a value counts as structurally 0 only if it is 0 at all.
        d = Dynamics(model, values, ArrayScalars(), axes)
        return d.forward(name)(None)

    return found


def _position(model: Model, kind: str, rng: random.Random) -> list[float]:
    """Coordinates of a state of a kind; quaternions are unit, and 1 except `anywhere`."""
    q = []
    for c in model.coordinates:
        anywhere = rng.uniform(-1.5, 1.5)
        lined = rng.randrange(-4, 5) * (math.pi / 4) if kind == "aligned" else 0.0
        lined = lined if c.unit == "rad" else rng.choice((0.0, 1.0))
        if kind == "nearly":
            quarter = rng.choice((0.0, 0.0, math.pi / 2)) if c.unit == "rad" else lined
            lined = quarter + _slight(rng)
        usual = kind == "anywhere" or (kind in ("in line", "nearly") and rng.random() < 0.5)
        q.append(anywhere if usual else lined)
    for indices in model.quaternions:
        for n, i in enumerate(indices):
            lined = float(n == 0) if n == 0 or kind != "nearly" else _slight(rng)
            q[i] = q[i] if kind == "anywhere" else lined
        length = math.hypot(*(q[i] for i in indices))
        for i in indices:
            q[i] /= length
    return q


def _slight(rng: random.Random) -> float:
    """1e-17 to 1, of either sign."""
    return rng.choice((-1.0, 1.0)) * math.pow(10.0, rng.uniform(-17.0, 0.0))


def _off(
    model: Model, at: Sequence[Values], solvers: Mapping[str, Accelerations], closely: bool
) -> dict[str, Array]:
    """For each route the largest errors of v̇ at some states of each kind (4,), relative to the size
    of v̇ and to the error that is allowed; infinite if it gives no number.
    """
    together, shape = _together(at), (len(model.velocities), len(at))
    sure = _recursion("orthogonal", model, "own")
    true = _numbers(sure, together, shape)
    named = {name: _numbers(solver, together, shape) for name, solver in solvers.items()}
    found = {"orthogonal": true, **named}
    least = _least(model, true, at)
    change = np.zeros(len(at))
    asked = "aba" if "aba" in found else next(iter(named), "orthogonal")
    doubts = [_shares(found[asked], true, least)]
    if closely:
        nudged = _recursion("orthogonal", perturbed(model), "own")
        change = _shares(_numbers(nudged, _nudged(together, len(at)), shape), true, least)
        doubts.append(change)
    worst = {route: np.zeros(len(KINDS)) for route in found}
    exactly, known_somewhere = _in_many_digits(model, nudge=closely), False
    for n in _doubtful(doubts, CLOSELY if closely else ROUGHLY):
        try:
            long, change_here = exactly(at[n])
        except (ArithmeticError, ValueError):
            continue  # v̇ does not exist at this state
        if not all(math.isfinite(x) for x in map(float, long)):
            continue  # v̇ overflows doubles
        known_somewhere = True
        size = max([float(least[n]), *(float(abs(x)) for x in long)])
        for route, rates in found.items():
            own = rates[:, n]
            off = _apart(own.tolist(), long) if np.isfinite(own).all() else math.inf
            shares = _in_parts(np.array([off / size]), np.array([change_here / size]))
            worst[route][n // EACH] = max(worst[route][n // EACH], shares[0])
    if not known_somewhere:
        return worst
    if closely and worst["orthogonal"].max() > TRUSTED:
        return worst
    known = np.isfinite(true).all(axis=0)
    if not closely:  # states where any route gives a number
        known = np.any([np.isfinite(rates).all(axis=0) for rates in found.values()], axis=0)
    beside = _worst(found, true, least, change, np.asarray(known))
    return {route: np.maximum(off, beside[route]) for route, off in worst.items()}


def _doubtful(doubts: Sequence[Array], count: int) -> list[int]:
    """The indices of the `count` states of each kind with the largest value of each doubt (n,)."""
    found = set()
    for doubt in doubts:
        kinds = np.where(np.isnan(doubt), np.inf, doubt).reshape(len(KINDS), EACH)
        order = np.argsort(-kinds, axis=1, kind="stable")[:, :count]
        found |= {*(order + EACH * np.arange(len(KINDS))[:, None]).ravel().tolist()}
    return sorted(found)


def _together(at: Sequence[Values]) -> Values:
    """Values at several states as arrays."""
    first = at[0]
    return Values(
        first.parameters,
        {name: np.array([x.inputs[name] for x in at]) for name in first.inputs},
        list(np.array([x.q for x in at]).T),
        list(np.array([x.v for x in at]).T),
        first.states,
    )


def _nudged(values: Values, count: int) -> Values:
    """Values at `count` states with each number changed by up to a unit in the last place."""
    rng = np.random.default_rng(7)

    def near(x: Any, count: int | None = count) -> Any:
        return x * (1.0 + rng.uniform(-EPSILON, EPSILON, count))

    # Parameters and extra states are the same at all states.
    given = (values.parameters, values.states)
    fixed, states = ({name: near(x, None) for name, x in own.items()} for own in given)
    inputs = {name: near(x) for name, x in values.inputs.items()}
    return Values(fixed, inputs, [*map(near, values.q)], [*map(near, values.v)], states)


def _numbers(solver: Accelerations, values: Values, shape: tuple[int, ...]) -> Array:
    """v̇ at several states, (nv, count); nan where it cannot be computed."""
    try:
        with np.errstate(all="ignore"):
            rows = [np.broadcast_to(np.asarray(x, dtype=float), shape[1:]) for x in solver(values)]
    except (ArithmeticError, ValueError):
        return np.full(shape, np.nan)
    return np.reshape(rows, shape)


def _worst(
    found: Mapping[str, Array],
    true: Array,
    least: Array,
    change: Array,
    known: NDArray[np.bool_],
) -> dict[str, Array]:
    """For each route the largest errors of v̇ (nv, n) among the states of each kind (4,) where the
    true one is `known` (n,), relative to its size and to the allowed error; infinite if it is nan.
    """
    worst = {}
    for route, rates in found.items():
        off = _in_parts(_shares(rates, true, least), change)
        known_off = np.where(known, np.where(np.isnan(off), np.inf, off), 0.0)
        worst[route] = known_off.reshape(len(KINDS), EACH).max(axis=1)
    return worst


def _in_parts(off: Array, change: Array) -> Array:
    """Errors relative to the allowed error: the rounding of one number, or `change` / `SURE`, where
    `change` is that of v̇ when all numbers change in the last place. Both are relative to v̇.
    """
    allowed = np.fmax(change / SURE, EPSILON)
    return np.asarray(off / np.where(off > UNEXPLAINED * change, EPSILON, allowed))


def _least(model: Model, rates: Array, at: Sequence[Values]) -> Array:
    """The least scale (n,) for errors of v̇ (nv, n): its median size among states at rest, or among
    those in motion, at most 1, and 1 if that is 0 or nan; or ω v, if that is larger.
    """
    sizes, least = np.abs(rates).max(axis=0, initial=0.0), np.ones(len(at))
    for first in (0, 1):
        own = np.sort(sizes[first::2])
        middle = float(own[len(own) // 2])
        least[first::2] = middle if 0.0 < middle < 1.0 else 1.0
    v = np.abs([values.v for values in at])
    angular = [i for i, c in enumerate(model.velocities) if c.unit == "rad/s"]
    made: Array = np.maximum(least, v[:, angular].max(axis=1, initial=0.0) * v.max(axis=1))
    return made


def _shares(rates: Array, true: Array, least: Array) -> Array:
    """The largest difference at each of n states, relative to the size of v̇ there."""
    with np.errstate(all="ignore"):
        off = np.abs(rates - true).max(axis=0, initial=0.0)
        return np.asarray(off / np.maximum(np.abs(true).max(axis=0, initial=0.0), least))


def _in_many_digits(model: Model, *, nudge: bool) -> Callable[[Values], tuple[list[Any], float]]:
    """A function of values at the model's own parameters: v̇ in 60 digits, and with `nudge` its
    change when all numbers change by half a unit in the last place, else 0.
    """
    scalars = Bits()
    own = {0.0: model, EPSILON / 2: perturbed(model)}

    def near(x: float, nudge: float, rng: random.Random) -> Any:
        return scalars.number(x) * (1 + scalars.number(nudge * rng.uniform(-1, 1)))

    @cache
    def made(nudge: float) -> tuple[dict[str, Any], Linkage]:
        rng = random.Random(7)
        parameters = {name: near(x, nudge, rng) for name, x in model.defaults.items()}
        return parameters, make_linkage(own[nudge], parameters, scalars)

    def forward(values: Values, nudge: float) -> list[Any]:
        rng = random.Random(8)
        with sixty_digits():
            parameters, linkage = made(nudge)
            inputs, states = (
                {name: near(x, nudge, rng) for name, x in own.items()}
                for own in (values.inputs, values.states)
            )
            q, v = ([near(x, nudge, rng) for x in own] for own in (values.q, values.v))
            near_by = Values(parameters, inputs, q, v, states, scalars.number(0.0))
            d = Dynamics(own[nudge], near_by, scalars, "own", linkage)
            return out_of_bits(d.vd)

    def exactly(values: Values) -> tuple[list[Any], float]:
        true = forward(values, 0.0)
        return true, _apart(forward(values, EPSILON / 2), true) if nudge else 0.0

    return exactly


def _apart(one: Sequence[Any], other: Sequence[Any]) -> float:
    return max((float(abs(a - b)) for a, b in zip(one, other, strict=True)), default=0.0)


def _digits(times: float) -> float:
    return min(ALL, math.log10(times)) if times > 1.0 else 0.0
