"""Scenes with rigid contacts, for tests: balls and stops as effects of the tests' own, and the law
of impacts over dense matrices.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any, Literal

import numpy as np
from engine import Engine, read

from eomgen.language.formula import parse
from eomgen.model.elaborate import elaborate
from eomgen.pipeline import compile_program, python_module
from eomgen.run.module import load_module
from eomgen.scene.effects.base import (
    Contact,
    EffectTable,
    JointLoad,
    Load,
    Mechanism,
    Scalar,
    Vector,
)

MATERIAL = """\
[parameters]
rest = 0.7
mu = 0.4
creep = 0.01
"""
"""What both effects take for restitution, friction and slip speed."""

OUTPUTS = (
    "mass_matrix", "kinetic_energy", "momentum", "joint_forces", "body_poses", "body_velocities",
)  # fmt: skip


class Balls(EffectTable):
    """Balls of bodies on a plane of the world, n·x = 0, and centred balls on each other.

    Tangents on the plane are turned by `turned` about its normal.
    """

    type: Literal["balls"] = "balls"
    name: str = "balls"
    normal: tuple[float, ...]
    on_plane: tuple[tuple[str, tuple[float, ...], float], ...] = ()
    on_each_other: tuple[tuple[str, str, float, float], ...] = ()
    rough: bool = True
    turned: float = 0.0

    def contacts(self, mechanism: Mechanism) -> tuple[Contact, ...]:
        """In order, first those on the plane."""
        found = []
        normal = tuple(mechanism.number(x) for x in self.normal)
        for i, (body, at, radius) in enumerate(self.on_plane):
            point = tuple(mechanism.number(x) for x in at)
            side = (body, point, tuple(mechanism.number(-radius * x) for x in self.normal))
            gap = _dot(normal, mechanism.position(body, point)) - mechanism.number(radius)
            ways = [tuple(map(mechanism.number, t)) for t in self.tangents_of_plane()]
            found.append(self._contact(mechanism, f"{i}_{body}", gap, normal, ways, [side]))
        zero = (mechanism.number(0.0),) * mechanism.dimensions
        for one, other, r, s in self.on_each_other:
            places = [mechanism.position(body, zero) for body in (one, other)]
            d = tuple(a - b for a, b in zip(*places, strict=True))
            length = mechanism.call("sqrt", _dot(d, d))
            n = tuple(x / length for x in d)
            if len(n) == 2:
                ways = [(-n[1], n[0])]
            else:
                first = _cross(n, tuple(map(mechanism.number, (0.3, -0.5, 0.8))))
                size = mechanism.call("sqrt", _dot(first, first))
                first = tuple(x / size for x in first)
                ways = [first, _cross(n, first)]
            share = length / mechanism.number(r + s)
            levers = [mechanism.number(-r) * share, mechanism.number(s) * share]
            sides = [
                (body, zero, tuple(lever * x for x in n))
                for body, lever in zip((one, other), levers, strict=True)
            ]
            gap = length - mechanism.number(r + s)
            found.append(self._contact(mechanism, f"{one}_{other}", gap, n, ways, sides))
        return tuple(found)

    def tangents_of_plane(self) -> list[tuple[float, ...]]:
        """Unit vectors across the normal."""
        n = np.array(self.normal)
        if len(n) == 2:
            return [(float(-n[1]), float(n[0]))]
        first = np.cross(n, [0.2, 0.9, -0.4])
        first /= np.linalg.norm(first)
        c, s = np.cos(self.turned), np.sin(self.turned)
        second = np.cross(n, first)
        return [tuple((c * first + s * second).tolist()), tuple((c * second - s * first).tolist())]

    def _contact(
        self,
        mechanism: Mechanism,
        name: str,
        gap: Scalar,
        normal: Vector,
        ways: Sequence[Vector],
        sides: Sequence[tuple[str, Vector, Vector]],
    ) -> Contact:
        def loads(force: Vector, *, turns: bool = True) -> tuple[Load, ...]:
            found = []
            for body, at, lever in sides:
                torque = _cross(lever, force) if turns else ()
                found.append(Load(body, force, at, "applied", torque))
                force = tuple(-x for x in force)
            return tuple(found)

        return Contact(
            f"{self.name}_{name}",
            self.name,
            gap,
            loads(normal, turns=False),  # levers run along it
            tuple(loads(way) for way in ways) if self.rough else (),
            *(mechanism.value(parse(x)) for x in ("rest", "mu", "creep")),
        )


class Limit(EffectTable):
    """A stop: a coordinate q of a joint stays below `high`. The gap is `weight` (high - q)."""

    type: Literal["limit"] = "limit"
    name: str = "limit"
    joint: str
    high: float
    weight: str = "1"

    def contacts(self, mechanism: Mechanism) -> tuple[Contact, ...]:
        """One, without friction."""
        weight = mechanism.value(parse(self.weight))
        gap = weight * (mechanism.number(self.high) - mechanism.coordinate(self.joint))
        push = JointLoad(self.joint, -weight)
        material = (mechanism.value(parse(x)) for x in ("rest", "mu", "creep"))
        return (Contact(f"{self.name}_high", self.name, gap, (push,), (), *material),)


def _dot(a: Vector, b: Vector) -> Scalar:
    first, *others = (x * y for x, y in zip(a, b, strict=True))
    for other in others:
        first = first + other
    return first


def _cross(a: Vector, b: Vector) -> Vector:
    if len(a) == 2:
        return (a[0] * b[1] - a[1] * b[0],)
    return tuple(a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3))


@cache
def striking(scene: str, *effects: EffectTable, route: str = "auto") -> Engine:
    """A scene with these effects besides, compiled."""
    model = elaborate(read(scene).replaced(outputs=OUTPUTS))
    every: Any = (*model.effects, *effects)
    model = replace(model, effects=every, route=route)  # type: ignore[arg-type]
    system = compile_program(model).system
    source = python_module(system)
    return Engine(model, system, source, load_module(source, f"striking_{model.name}"))


def touching_velocities(engine: Engine, effect: Balls, y: np.ndarray) -> list[np.ndarray]:
    """Of each contact the matrix from v to the relative velocity of the touching points, world
    axes, from nothing but the velocities of the bodies.
    """
    module, dims = engine.module, engine.model.dimensions
    nv, first = len(engine.model.velocities), len(engine.model.coordinates)
    poses = module.body_poses(0.0, y)
    moves = np.zeros((nv, len(module.BODIES), 3 * (dims - 1)))
    for i in range(nv):
        still = y.copy()
        still[first:] = 0.0
        still[first + i] = 1.0
        moves[i] = module.body_velocities(0.0, still)

    def centre(body: str) -> np.ndarray:
        pose = poses[module.BODIES.index(body)]
        return pose[:2] if dims == 2 else pose[:, 3]

    def outward(body: str, vector: Sequence[float]) -> np.ndarray:
        pose = poses[module.BODIES.index(body)]
        c, s = np.cos(pose.ravel()[2]), np.sin(pose.ravel()[2])
        turn = np.array([[c, -s], [s, c]]) if dims == 2 else pose[:, :3]
        return np.asarray(turn @ np.array(vector))

    def speed(body: str, arm: np.ndarray) -> np.ndarray:
        columns = []
        for move in moves[:, module.BODIES.index(body)]:
            linear, w = move[:dims], move[dims:]
            turning = w[0] * np.array([-arm[1], arm[0]]) if dims == 2 else np.cross(w, arm)
            columns.append(linear + turning)
        return np.array(columns).T

    found = []
    for body, at, radius in effect.on_plane:
        arm = outward(body, at) - radius * np.array(effect.normal)
        found.append(speed(body, arm))
    for one, other, r, s in effect.on_each_other:
        d = centre(one) - centre(other)
        found.append(speed(one, -r / (r + s) * d) - speed(other, s / (r + s) * d))
    return found


def normals(engine: Engine, effect: Balls, y: np.ndarray) -> list[np.ndarray]:
    """Unit normals of the contacts."""
    poses, dims = engine.module.body_poses(0.0, y), engine.model.dimensions
    places = poses[:, :2] if dims == 2 else poses[:, :, 3]
    index = engine.module.BODIES.index
    apart = [places[index(a)] - places[index(b)] for a, b, _, _ in effect.on_each_other]
    return [np.array(effect.normal)] * len(effect.on_plane) + [d / np.linalg.norm(d) for d in apart]


def dense_impact(
    mass: np.ndarray,
    jacobian: np.ndarray,
    normal: np.ndarray,
    v: np.ndarray,
    restitution: float,
    friction: float,
) -> np.ndarray:
    """Velocities after an impact by Chatterjee and Ruina's law: p_I and p_II in full, and κ from
    the quadratic |p_t|² = μ² p_n².
    """
    inverse = jacobian @ np.linalg.solve(mass, jacobian.T)
    u = jacobian @ v
    plastic = -(normal @ u) / (normal @ inverse @ normal) * normal
    stick = np.zeros_like(u)  # where stopping along the normal stops the slip, too
    if np.linalg.matrix_rank(inverse, tol=1e-9) == len(u):
        stick = -np.linalg.solve(inverse, u) - plastic
    extra = normal @ stick
    tangential = stick - extra * normal
    bounced = (1 + restitution) * (normal @ plastic)
    kappa = 1.0
    if np.linalg.norm(tangential) > friction * (bounced + extra):
        a = tangential @ tangential - friction**2 * extra**2
        b, c = -2 * friction**2 * bounced * extra, -((friction * bounced) ** 2)
        roots = np.roots([a, b, c])
        real = roots[np.abs(roots.imag) < 1e-9].real
        kappa = min(x for x in real if x >= 0 and bounced + x * extra >= 0)
    p = bounced * normal + kappa * stick
    return np.asarray(v + np.linalg.solve(mass, jacobian.T @ p))
