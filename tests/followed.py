"""What a derivation states, followed in numbers, beside the numeric solver."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from eomgen.derivation.dots import dotted
from eomgen.dynamics.closure import Closure, newton
from eomgen.dynamics.dynamics import Dynamics, Values
from eomgen.exposition.constraints import DerivedConstraint
from eomgen.exposition.derivation import used_bodies
from eomgen.exposition.effects import DerivedEffect, derived_effects
from eomgen.exposition.evaluate import Numbers, define, follow
from eomgen.exposition.frames import frames_of
from eomgen.exposition.poses import poses
from eomgen.exposition.recursion import recursive_steps
from eomgen.model.model import Model
from eomgen.scalars.floats import FloatScalars


@dataclass(frozen=True)
class Instant:
    """A model at a random state: the numeric solver, and the values that a reader starts from."""

    solver: Dynamics
    known: Numbers


def instant(model: Model, seed: int = 0, shake: float = 0.3, *, closed: bool = False) -> Instant:
    """A state near the scene's own, random velocities, inputs, extra states; t = 0.4 s. One that is
    `closed` meets the constraints of a model whose constraints do not depend on time.
    """
    rng = np.random.default_rng([seed, 77])
    q = np.array(model.initial_q) + shake * rng.normal(size=len(model.initial_q))
    for four in model.quaternions:
        q[list(four)] /= np.linalg.norm(q[list(four)])
    v = rng.normal(size=len(model.velocities))
    inputs = {i.name: float(rng.normal()) for i in model.inputs}
    states = {x.name: float(rng.normal()) for x in model.extra}
    if closed:
        found = newton(Closure.of(model), q, np.ones(len(v), dtype=bool))
        assert found is not None
        q = found
    values = Values(model.defaults, inputs, q.tolist(), v.tolist(), states, 0.4)
    solver = Dynamics(model, values, FloatScalars())
    if closed:
        v = np.array(solver.constrained("ldl").velocity())
        solver = Dynamics(model, replace(values, v=v.tolist()), FloatScalars())
    known: Numbers = {"t": 0.4, **model.defaults, **inputs, **states}
    known |= {c.name: float(x) for c, x in zip(model.coordinates, q, strict=True)}
    known |= {c.name: float(x) for c, x in zip(model.velocities, v, strict=True)}
    for c, motion in zip(model.prescribed, solver.given, strict=True):
        words = (c.position.name, c.velocity.name, c.velocity.acceleration)
        known |= dict(zip(words, motion, strict=True))
    return Instant(solver, known)


def follow_effects(model: Model, effects: Sequence[DerivedEffect], known: Numbers) -> None:
    """Poses, and what each effect says."""
    needed = dict.fromkeys(body for t in effects for body in used_bodies(t))
    define(poses(model, frames_of(model), needed)[0], known)
    for body in needed if model.dimensions == 3 else ():
        entries = [[known[f"W_{body},{i}{j}"] for j in "xyz"] for i in "xyz"]
        known[f"W_{body}"] = np.array(entries)
    for t in effects:
        define(t.definitions, known)
        define(t.rates, known)


def follow_recursion(
    model: Model, known: Numbers, constraints: Sequence[DerivedConstraint] = ()
) -> tuple[list[float], list[float]]:
    """v̇ and F by the steps of the algorithm, in the order of v, with the forces of constraints
    whose multipliers are known.
    """
    frames = frames_of(model)
    effects = (*derived_effects(model), *(c.force for c in constraints))
    follow_effects(model, effects, known)
    for step in recursive_steps(model, frames, effects):
        follow(step.equations, known)
    rates: dict[str, float] = {}
    forces: dict[str, float] = {}
    for frame in (frame for frame in frames if frame.free):
        several = len(frame.a) > 1
        found: Any = known[dotted(f"omega_{frame.name}") if several else frame.a[0].name]
        rates |= zip((a.name for a in frame.a), found.ravel(), strict=True)
        forces |= zip((a.name for a in frame.a), known[f"F_{frame.name}"].ravel(), strict=True)
    names = [c.acceleration for c in model.velocities]
    return [rates[name] for name in names], [forces[name] for name in names]
