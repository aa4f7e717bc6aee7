"""Random trees under effects of all kinds, against a solver that shares nothing with eomgen: what
an effect does is put in by hand, as forces at points of bodies and at a joint.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from campaign import some
from engine import apart, engine
from scenes import effect
from spatial_newton_euler import BodyMotion, carried, solve, under
from spatial_trees import PLANE, SPACE, SpatialTree, random_spatial_tree, random_state

from eomgen.tables.outputs import OUTPUTS

Load = tuple[int, np.ndarray, np.ndarray]
"""Body, point in its axes, force in world axes."""


@dataclass(frozen=True)
class Moment:
    """What loads depend on: bodies, first and last of them, coordinate and rate of the motor."""

    tree: SpatialTree
    bodies: list[BodyMotion]
    q: float
    v: float
    t: float

    @property
    def last(self) -> int:
        return len(self.bodies) - 1

    def turn(self, k: int, torque: np.ndarray) -> list[Load]:
        """A torque in world axes on a body, as two opposite forces."""
        if not np.any(torque):
            return []
        across = np.cross(torque, [0.3, 0.5, -0.7] if torque[2] == 0 else [1.0, 0.2, 0.0])
        arm = across / np.linalg.norm(across)
        force = np.cross(torque, arm)
        return [(k, self.bodies[k].axes.T @ arm, force), (k, np.zeros(3), -force)]


Hand = Callable[[Moment], Any]
"""A list of loads, or the force at the joint of the motor."""


def effects(tree: SpatialTree, *, rope: bool) -> Iterator[tuple[str, Hand]]:
    """Each effect that acts on a tree, and the loads that it makes; a spring may be a `rope`."""
    n = tree.dimensions
    flat = n == PLANE
    first, last, joint = "b0", f"b{len(tree.bodies) - 1}", f"j{tree.motor}"
    number = 0

    def vector(*parts: Any) -> np.ndarray:
        return np.array([*parts[:n], *[0.0] * (3 - n)])

    def of(kind: str, /, **keys: Any) -> str:
        nonlocal number
        number += 1
        own = {k: x[:n].tolist() if isinstance(x, np.ndarray) else x for k, x in keys.items()}
        return effect(kind, name=f"e{number}", **own)

    at, b = vector(0.2, -0.3, 0.15), vector(-0.3, 0.15, 0.1)
    sun, rock = vector(3.0, 4.0, -5.0), vector(0.7, -2.0, 1.0)
    anchor, inner = vector(2.0, 1.0, 0.3), vector(0.4, -0.6, 0.8)
    centre = np.zeros(3)

    def spring(m: Moment) -> list[Load]:
        (here, speed), (there, its_speed) = m.bodies[0].at(at), m.bodies[-1].at(b)
        unit = (there - here) / np.linalg.norm(there - here)
        stretch = np.linalg.norm(there - here) - 0.4
        pull = (25.0 * stretch + 2.0 * unit @ (its_speed - speed)) * unit
        if rope and (stretch < 0 or pull @ unit < 0):
            pull = 0 * pull
        return [(0, at, pull), (m.last, b, -pull)]

    numbers = {"stiffness": 25.0, "damping": 2.0, "rest_length": 0.4, "tension_only": rope}
    yield of("spring", body_1=first, body_2=last, at_1=at, at_2=b, **numbers), spring
    yield (
        of("spring", body_1="world", body_2=first, at_1=anchor, at_2=at, stiffness=5.0),
        lambda m: [(0, at, 5.0 * (anchor - m.bodies[0].at(at)[0]))],
    )
    yield (
        of("joint_spring", joint=joint, stiffness=3.0, rest=0.4, damping=0.6),
        lambda m: -(3.0 * (m.q - 0.4) + 0.6 * m.v),
    )
    yield (
        of("joint_friction", joint=joint, viscous=0.2, coulomb=0.7, speed=0.3),
        lambda m: -(0.2 * m.v + 0.7 * math.tanh(m.v / 0.3)),
    )
    yield (
        of("joint_stop", joint=joint, low=-0.1, high=0.1, stiffness=50.0),
        lambda m: -50.0 * (m.q - min(max(m.q, -0.1), 0.1)),
    )
    yield (
        of("pd", joint=joint, target="sin(t)", stiffness=4.0, damping=0.5, limit=1.5),
        lambda m: min(max(4.0 * (math.sin(m.t) - m.q) - 0.5 * m.v, -1.5), 1.5),
    )

    def blown(m: Moment) -> list[Load]:
        place, speed = m.bodies[-1].at(at)
        w = speed - [3 * math.sin(m.t) - 0.5 * place[1], 0.4 * place[0] ** 2, 0.0]
        return [(m.last, at, -(0.3 + 0.8 * np.linalg.norm(w)) * w)]

    wind = ["3*sin(t) - 0.5*y", "0.4*x**2", "0"][:n]
    yield of("drag", body=last, at=at, linear=0.3, quadratic=0.8, wind=wind), blown

    def turning(m: Moment) -> list[Load]:
        spin = m.bodies[-1].spin
        return m.turn(m.last, -(0.2 + 0.3 * np.linalg.norm(spin)) * spin)

    yield of("drag", body=last, turning_linear=0.2, turning_quadratic=0.3), turning

    def formula(m: Moment) -> list[Load]:
        p, w = m.bodies[0].at(at)
        return [(0, at, np.array([p[1] * w[0] - m.t, math.sin(p[0]) - 2 * w[1], p[0] * p[2]]))]

    force = ["y*vx - t", "sin(x) - 2*vy", "x*z"][:n]
    yield of("field", body=first, at=at, force=force), formula

    def attracted(m: Moment) -> list[Load]:
        r = m.bodies[-1].at(at)[0] - rock
        return [(m.last, at, -2.0 * r / (r @ r + 0.25) ** 2)]

    law = {"strength": 2.0, "power": 3, "softening": 0.5, "center": rock}
    yield of("field", body=last, at=at, kind="attract", **law), attracted

    def whirled(m: Moment) -> list[Load]:
        r = m.bodies[0].place - sun
        return [(0, centre, 1.5 * np.array([-r[1], r[0], 0]) / np.hypot(r[0], r[1]) ** 3)]

    yield of("field", body=first, kind="vortex", strength=1.5, power=2, center=sun), whirled

    def steered(m: Moment) -> list[Load]:
        speed, d = m.bodies[-1].velocity, rock - m.bodies[-1].place
        size, distance = np.linalg.norm(speed), np.linalg.norm(d)
        near = min(max(1 - (distance - 0.5) / 9.0, 0.0), 1.0)
        cosine = max(speed @ d, 0.0) / (size * distance)
        n = np.cross(speed, d) / np.linalg.norm(np.cross(speed, d))
        return [(m.last, centre, 2.0 * near**2 * cosine**2 * size * np.cross(speed, n))]

    avoid = {"steering": 2.0, "radius": 0.5, "reach": 9.0, "center": rock}
    yield of("field", body=last, kind="avoid", **avoid), steered

    def weights(m: Moment) -> list[Load]:
        ways = [moved.place - sun for moved in m.bodies]
        masses = [body.mass for body in m.tree.bodies]
        return [
            (k, centre, -6.0 * masses[k] * r / np.linalg.norm(r) ** 3) for k, r in enumerate(ways)
        ]

    yield of("point_gravity", mu=6.0, at=sun), weights
    yield (
        of("external_force", body=last, axes="body", at=at, force=inner),
        lambda m: [(m.last, at, m.bodies[-1].axes @ inner)],
    )
    torque = np.array([0, 0, 0.7] if flat else [0.7, -0.2, 0.4])
    yield (
        of("external_torque", body=first, axes="body", torque=0.7 if flat else torque),
        lambda m: m.turn(0, m.bodies[0].axes @ torque),
    )


@pytest.mark.every(2)
@pytest.mark.parametrize("route", ["aba", "ldl"])
@pytest.mark.parametrize("dimensions", [PLANE, SPACE])
def test_random_trees_move_as_under_loads_put_in_by_hand(dimensions: int, route: str) -> None:
    """Springs and ropes, friction, stops, drag in a wind, fields, forces in axes of bodies, PD."""
    rng = np.random.default_rng(11)
    drawn = (random_spatial_tree(seed, dimensions) for seed in range(400, 900))
    suited = ((tree, text) for tree, text in drawn if tree.motor >= 0 and len(tree.bodies) > 1)
    for (tree, text), k in zip(suited, range(some(2, 6)), strict=False):
        texts, hands = zip(*effects(tree, rope=k % 2 == 1), strict=True)
        module = engine("".join((text, *texts)), route, leave_out=tuple(OUTPUTS)).module
        for _ in range(3):
            (q, v), u = random_state(tree, rng), tree.random_inputs(rng)
            t = float(rng.uniform(0, 5))
            plain = solve(tree, q, v, u)
            bodies = [carried(plain, k) for k in range(len(tree.bodies))]
            own = (x[at[tree.motor]][0] for x, at in ((q, tree.q_slices()), (v, tree.v_slices())))
            moment = Moment(tree, bodies, *own, t)
            made = [hand(moment) for hand in hands]
            loads = [load for given in made if isinstance(given, list) for load in given]
            drive = u["drive"] + sum(x for x in made if not isinstance(x, list))
            expected = under(tree, q, v, loads, {**u, "drive": drive})
            rates = module.derivative(t, tree.state(module.STATES, q, v), None, u)
            found = rates[tree.places(module.STATES)][len(q) :]
            assert apart(found, expected) < 1e-10, tree.name
