"""Random trees with parameters over many decades, and what their data let one know of v̇."""

import math
import random
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from engine import MP
from spatial_trees import random_spatial_tree

from eomgen.base.errors import SceneError
from eomgen.codegen.system import System
from eomgen.dynamics.dynamics import Dynamics, Values
from eomgen.dynamics.start.singularity import check_nonsingular
from eomgen.language.formula import Constant
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.pipeline import Compiled, compile_program
from eomgen.program.program import interpret
from eomgen.program.tape import TIME
from eomgen.scalars.extended import Bits, out_of_bits, sixty_digits
from eomgen.scalars.floats import FloatScalars
from eomgen.scene.reader import parse_scene

SPECIAL = (0.0, np.pi / 2, -np.pi / 2, np.pi, np.pi / 4)
"""Angles at which levers vanish or axes meet; quaternions are then those of no turn."""
MOST_BODIES = 4
NUDGES = 3
"""How often data are changed in their last place to see what that does."""


def drawn(seed: int, dimensions: int, decades: Sequence[float]) -> Model:
    """A random tree whose masses, inertias, arms and gravity are as many decades off; those of one
    body's inertia alike, for it must stay one.

    Raises `SceneError` if the program refuses it.
    """
    while True:
        try:
            model = elaborate(parse_scene(scaled(seed, dimensions, decades)))
            break
        except SceneError as error:
            if "principal moments" not in str(error):
                raise
            seed += 1  # an inertia of several parameters may be that of no body
    check_nonsingular(model)
    # Doubles are what is given of a body, not formulas of them: I + m l² may be m l² to all digits.
    bodies = (
        replace(
            body,
            mass=Constant(model.value(body.mass)),
            inertia_com=_no_needle([model.value(x) for x in body.inertia_com]),
        )
        for body in model.bodies
    )
    return replace(model, bodies=tuple(bodies))


def scaled(seed: int, dimensions: int, decades: Sequence[float]) -> str:
    """The scene of such a tree."""
    tree, _ = random_spatial_tree(seed, dimensions, MOST_BODIES)
    factors: dict[str, float] = {}
    parameters = {}
    for name, value in tree.parameters.items():
        alike = name.rsplit("_", 1)[0] if name[-3:-2] == "_" else name
        if alike not in factors:
            factors[alike] = 10.0 ** decades[len(factors) % len(decades)]
        parameters[name] = value * factors[alike]
    return random_spatial_tree(seed, dimensions, MOST_BODIES, parameters)[1]


def _no_needle(entries: Sequence[float]) -> tuple[Constant, ...]:
    """Moments of inertia of one body within six decades: in rotated axes doubles do not resolve a
    thinner body, whose smallest moment is below half a unit in the last place of the entries.
    """
    moments, products = entries[:3], entries[3:]
    if len(moments) == 3 and min(moments) > 0:
        moments = [max(x, 1e-6 * max(moments)) for x in moments]
    return tuple(map(Constant, (*moments, *products)))


def state(model: Model, seed: int, special: bool) -> tuple[list[float], list[float]]:
    """Positions and velocities, at special places or anywhere."""
    r = random.Random(seed)
    q: list[float] = []
    for c in model.coordinates:
        if c.unit == "rad":
            q.append(r.choice(SPECIAL) if special else r.uniform(-6, 6))
        else:
            q.append(0.0 if special and r.random() < 0.5 else r.gauss(0, 1))
    for i in [i for i, c in enumerate(model.coordinates) if c.name.endswith("qw")]:
        turn = [1.0, 0.0, 0.0, 0.0] if special else [r.gauss(0, 1) for _ in range(4)]
        q[i : i + 4] = (np.array(turn) / np.linalg.norm(turn)).tolist()
    return q, [r.uniform(-3, 3) for _ in model.velocities]


def dynamics(model: Model, p: Any, q: Any, v: Any, u: Any, scalars: Any) -> Dynamics:
    """The recursions at numbers of some kind."""
    values = Values(p, u, list(q), list(v), time=scalars.number(0.0))
    return Dynamics(model, values, scalars, "own")


def taken(model: Model) -> Compiled:
    """The steps of the route that `auto` takes, `closed` left out, and what it reports of its
    digits.

    Raises `SceneError` where it refuses the scene.
    """
    return compile_program(model, jacobian=False, closed=False)


def found(
    system: System, q: Sequence[float], v: Sequence[float], u: dict[str, float]
) -> list[float]:
    """v̇ in doubles by the steps of a system; nan where there is no number."""
    model = system.model
    names = [c.name for c in (*model.coordinates, *model.velocities)]
    given = {**model.defaults, **u, **dict(zip(names, (*q, *v), strict=True)), TIME: 0.0}
    try:
        return interpret(system.program, "derivative", given, FloatScalars())[-len(v) :]
    except (ArithmeticError, ValueError):
        return [math.nan] * len(v)


def truth(
    model: Model, q: Sequence[float], v: Sequence[float], u: dict[str, float]
) -> tuple[list[Any], float]:
    """v̇ in 60 digits, and how much of its size it changes by when all data are changed by up to
    half a unit in the last place: no more than that can be asked of doubles.
    """
    r = random.Random(7)

    bits = Bits()

    def near(value: float, nudge: float) -> Any:
        return bits.number(value) * (1 + bits.number(nudge * r.uniform(-1, 1)))

    def exactly(nudge: float) -> list[Any]:
        with sixty_digits():
            p = {name: near(value, nudge) for name, value in model.defaults.items()}
            w = {name: near(value, nudge) for name, value in u.items()}
            at = ([near(x, nudge) for x in q], [near(x, nudge) for x in v])
            return out_of_bits(dynamics(model, p, *at, w, bits).articulated_forward())

    true = exactly(0.0)
    size = size_of(true, model, v)
    if not size:
        return true, 0.0
    moved = (exactly(2.0**-53) for _ in range(NUDGES))
    return true, max(float(abs(a - b) / size) for m in moved for a, b in zip(m, true, strict=True))


def size_of(true: Sequence[Any], model: Model, v: Sequence[float]) -> Any:
    """The largest component of v̇, or the largest that turning makes of rates, ω v: a ball that
    turns as it is has accelerations of 0, in which terms of that size cancel for any data.
    """
    turning = [x for c, x in zip(model.velocities, v, strict=True) if c.unit == "rad/s"]
    rates = max(map(abs, turning), default=0.0) * max(map(abs, v))
    return max(MP.mpf(rates), *(abs(x) for x in true))


def apart(value: Sequence[float], true: Sequence[Any], size: Any) -> float:
    """The error in parts of a size; infinite where there is no number."""
    if not np.isfinite(value).all():
        return np.inf
    off = max(abs(MP.mpf(float(a)) - b) for a, b in zip(value, true, strict=True))
    return float(off / size) if size else float(off)
