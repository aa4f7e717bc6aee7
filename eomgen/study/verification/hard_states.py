"""States that are numerically hard, the same for the same seed; see `KINDS`."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from eomgen.dynamics.start.walks import walked_positions
from eomgen.model.model import Model
from eomgen.run.failure import StepFailure
from eomgen.run.module import GeneratedModule, as_problem
from eomgen.run.problem import FloatArray
from eomgen.study.verification.states import random_state
from eomgen.study.whole import own_of, viewed, whole_of

Random = np.random.Generator
Angle = Callable[[Random, int], float]

KINDS = {
    "zero": "nothing moves, every coordinate 0",
    "straight": "every coordinate 0, in motion",
    "nearly straight": "angles of 1e-12 to 1e-3, in motion",
    "folded": "every joint turned by half a turn to and fro, in motion",
    "aligned": "angles multiples of a quarter of pi, in motion",
    "gimbal": "angles within 1e-9 to 1e-3 of an odd quarter turn, attitudes of half a turn",
    "fast": "anywhere, speeds of 1e2 to 1e5",
    "still": "anywhere, at rest",
    "random": "anywhere, in motion",
}
"""Kinds of states. `anywhere`: angles over two turns, displacements within 0.6 m, any orientation;
`in motion`: up to 3 rad/s, 1 m/s (see `states.random_state`). Displacements are 0 in kinds with
special angles. Inputs and extra states are random, except in `zero`.
"""


@dataclass(frozen=True, eq=False)
class State:
    """State number `number` of its kind; `u` are the inputs by name."""

    kind: str
    number: int
    t: float
    y: FloatArray
    u: dict[str, float]

    @property
    def label(self) -> str:
        """The kind and the number."""
        return f"{self.kind} {self.number}"


FAR = 0.01
"""The least margin of states with constraints: nearer to a singular position digits are lost by any
elimination.
"""
CONSTRAINED = ("fast", "still", "random")
"""Kinds for mechanisms with constraints, at positions that meet these."""


def hard_states(
    module: GeneratedModule, nv: int, count: int, seed: int, t_end: float
) -> list[State]:
    """`count` states [q, v, x] of each kind, but one of `zero`, at times within the scene's run.
    `nv` is the number of velocities.
    """
    found = []
    for index, kind in enumerate(KINDS):
        for number in range(1 if kind == "zero" else count):
            rng = np.random.default_rng([seed, index, number])
            y = random_state(module, rng)
            t = float(rng.uniform(0.0, t_end))
            u = {name: float(rng.uniform(-1.0, 1.0)) for name in module.INPUTS}
            if kind == "zero":
                t, u = 0.0, dict.fromkeys(u, 0.0)
            found.append(State(kind, number, t, _made(kind, module, nv, y, rng), u))
    return found


def constrained_states(
    model: Model, module: GeneratedModule, count: int, seed: int, t_end: float
) -> list[State]:
    """`count` states of each kind of `CONSTRAINED` that meet the constraints of a model, at
    positions along its motion, without those near singular positions.
    """
    problem, found, nq = as_problem(module), [], len(model.coordinates)
    seen, held = viewed(module, model), problem.projection or problem.solved_loops
    positions = walked_positions(model) or (np.array(model.initial_q),)
    for index, kind in enumerate(CONSTRAINED):
        for number in range(count):
            rng = np.random.default_rng([seed, index, number])
            y, t = random_state(seen, rng), float(rng.uniform(0.0, t_end))
            y[:nq] = positions[int(rng.integers(len(positions)))]
            u = {name: float(rng.uniform(-1.0, 1.0)) for name in module.INPUTS}
            y = _made(kind, seen, len(model.velocities), y, rng)
            try:
                own = problem.projected(t, own_of(module, model, y))
                y = whole_of(module, model, t, own, None, u)
            except (StepFailure, ValueError):
                continue  # too far from where the constraints are met at this time
            if held is None or held.margins(t, own).min() >= FAR:
                found.append(State(kind, number, t, y, u))
    return found


def _made(kind: str, module: GeneratedModule, nv: int, y: FloatArray, rng: Random) -> FloatArray:
    """A random state changed into one of the given kind."""
    nq = len(module.POSITIONS)
    turning = [i for q in module.QUATERNIONS for i in q]
    plain = [i for i in module.POSITIONS if i not in turning]
    if kind in _ANGLES:
        for order, i in enumerate(plain):
            turns = module.UNITS[module.STATES[i]] == "rad"
            y[i] = _ANGLES[kind](rng, order) if turns else 0.0
        for indices in map(list, module.QUATERNIONS):
            y[indices] = _attitude(kind, rng)
    if kind in ("zero", "still"):
        y[nq : nq + nv] = 0.0
    if kind == "zero":
        y[nq + nv :] = 0.0
    if kind == "fast":
        y[nq : nq + nv] *= 10.0 ** rng.uniform(2.0, 5.0)
    return y


_ANGLES: dict[str, Angle] = {
    "zero": lambda rng, order: 0.0,
    "straight": lambda rng, order: 0.0,
    "nearly straight": lambda rng, order: rng.choice((-1.0, 1.0)) * 10.0 ** rng.uniform(-12, -3),
    "folded": lambda rng, order: np.pi if order % 2 else -np.pi,
    "aligned": lambda rng, order: float(rng.integers(-8, 9)) * (np.pi / 4),
    "gimbal": lambda rng, order: (
        rng.choice((-1.5, -0.5, 0.5, 1.5)) * np.pi
        + rng.choice((-1.0, 1.0)) * 10.0 ** rng.uniform(-9, -3)
    ),
}


def _attitude(kind: str, rng: Random) -> FloatArray:
    """A unit quaternion for a kind of states."""
    axis = np.eye(3)[rng.integers(3)]
    half = 0.0
    if kind == "nearly straight":
        half = 10.0 ** rng.uniform(-12, -3)
    elif kind == "folded":
        return np.array([0.0, *axis])
    elif kind == "aligned":
        half = float(rng.integers(-8, 9)) * (np.pi / 8)
    elif kind == "gimbal":
        half, axis = np.pi / 2 - 10.0 ** rng.uniform(-9, -3), rng.normal(size=3)
        axis = axis / np.linalg.norm(axis)
    return np.array([np.cos(half), *(np.sin(half) * axis)])
