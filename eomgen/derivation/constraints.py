"""The constraints of a mechanism, over symbols: their equations, differentiated, and their forces.

A multiplier is a symbol, and the forces of a constraint are loads with these symbols. They do no
work in the motions that the constraints allow, so that the motion is found without them.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import sympy as sp

from eomgen.derivation.definitions import needed_by
from eomgen.derivation.dots import dotted
from eomgen.derivation.effects import AnyLoad, DerivedEffect, named_loads
from eomgen.derivation.impacts import power
from eomgen.derivation.linkage import Linkage, linkage_of
from eomgen.derivation.mechanism import (
    AXES,
    NamingMechanism,
    Notes,
    crossed,
    omega_symbols,
    position_symbols,
    rotation_symbols,
    velocity_symbols,
)
from eomgen.derivation.poses import poses
from eomgen.derivation.rotations import quaternion_rates, rate
from eomgen.derivation.steps import Definition
from eomgen.derivation.symbols import Expr, real
from eomgen.model.model import Model
from eomgen.scene.constraints.base import Constraint, Row
from eomgen.scene.effects.base import JointLoad, Load
from eomgen.scene.joints.base import WORLD


@dataclass(frozen=True)
class DerivedRow:
    """One row of a constraint.

    position  g; None if only velocities are restricted
    speed     ġ over the motion of the bodies
    slopes    the entries of J that are not 0: a velocity's name, and the derivative of ġ by it
    bend      β, what g̈ is where v̇ = 0
    """

    name: str
    position: Expr | None
    speed: Expr
    slopes: tuple[tuple[str, Expr], ...]
    bend: Expr

    @property
    def multiplier(self) -> Expr:
        """λ."""
        return multiplier(self.name)


@dataclass(frozen=True)
class DerivedConstraint:
    """A constraint by its formulas.

    definitions  the points that its rows use
    speeds       their time derivatives, as far as the rows use them
    bodies       the bodies whose pose and motion it uses
    force        its loads by the multipliers
    """

    constraint: Constraint
    definitions: tuple[Definition, ...]
    speeds: tuple[Definition, ...]
    bodies: tuple[str, ...]
    rows: tuple[DerivedRow, ...]
    force: DerivedEffect


def multiplier(row: str) -> Expr:
    """The multiplier of a row."""
    return real(f"lambda_{row}")


def derived_constraints(model: Model) -> tuple[DerivedConstraint, ...]:
    """All constraints of a model, in order, without rows that follow from others."""
    linkage, found = linkage_of(model), []
    for constraint in model.constraints:
        notes = Notes(constraint.name)
        list(constraint.rows(_mechanism(model, notes)))
        notes = Notes(constraint.name, totals=notes.counts)
        rows = list(constraint.rows(_mechanism(model, notes)))
        names = [name for name, _ in constraint.row_names(model.dimensions)]
        kept = [(n, row) for n, row in zip(names, rows, strict=True) if n not in model.dropped]
        touched = [x.body for _, row in kept for x in row.loads if isinstance(x, Load)]
        bodies = tuple(dict.fromkeys(b for b in (*notes.bodies, *touched) if b != WORLD))
        motion, moving = _Motion.of(linkage, bodies).with_points(notes.definitions)
        derived = tuple(_row(name, row, motion) for name, row in kept)
        speeds = needed_by([row.bend for row in derived], moving)
        force = _force(model, constraint, kept, bodies)
        points = tuple(notes.definitions)
        found.append(DerivedConstraint(constraint, points, speeds, bodies, derived, force))
    return tuple(found)


def tree_of(model: Model) -> Model:
    """The tree alone, without its constraints."""
    return replace(model, constraints=(), dropped=(), groups=(), pivots=(), blocks=())


def _mechanism(model: Model, notes: Notes) -> Any:
    return NamingMechanism(model, notes)


def _force(
    model: Model,
    constraint: Constraint,
    rows: Sequence[tuple[str, Row]],
    bodies: tuple[str, ...],
) -> DerivedEffect:
    loads = _joined([_times(x, multiplier(name)) for name, row in rows for x in row.loads])
    definitions: list[Definition] = []
    loads = named_loads(model, constraint.name, loads, definitions)
    effect: Any = constraint
    return DerivedEffect(effect, tuple(definitions), tuple(loads), False, (), (), bodies)


def _times(load: AnyLoad, size: Expr) -> AnyLoad:
    if isinstance(load, JointLoad):
        return replace(load, force=load.force * size)
    force, torque = (tuple(x * size for x in part) for part in (load.force, load.torque))
    return replace(load, force=force, torque=torque)


def _joined(loads: Sequence[AnyLoad]) -> list[AnyLoad]:
    """Loads on bodies, those at one point of a body as their sum; nothing acts on the world."""
    found: dict[object, AnyLoad] = {}
    for load in loads:
        if isinstance(load, JointLoad):
            key: object = (load.joint, load.coordinate)
            before = found.get(key)
            both = load.force if before is None else before.force + load.force
            found[key] = replace(load, force=both)
        elif load.body != WORLD:
            key = (load.body, load.at)
            other = found.get(key)
            if not isinstance(other, Load):
                found[key] = load
                continue
            force = tuple(a + b for a, b in zip(other.force, load.force, strict=True))
            torque = _sum(other.torque, load.torque)
            found[key] = replace(other, force=force, torque=torque)
    return list(found.values())


def _sum(a: Sequence[Expr], b: Sequence[Expr]) -> tuple[Expr, ...]:
    if not a or not b:
        return tuple(a or b)
    return tuple(x + y for x, y in zip(a, b, strict=True))


def _row(name: str, row: Row, motion: "_Motion") -> DerivedRow:
    drift = sp.S.Zero if row.drift is None else row.drift
    speed = power(motion.model, row.loads) + drift
    whole = motion.over_velocities(speed)
    slopes, bend = [], motion.rate(drift)
    still = dict.fromkeys(motion.velocities, sp.S.Zero)
    there = whole.xreplace(still)
    for v, a in motion.velocities.items():  # the speed is linear in the velocities
        slope = whole.xreplace({**still, v: sp.S.One}) - there
        if slope == 0:
            continue
        bend += v * motion.rate(slope)
        if a is None:
            slopes.append((v.name, slope))
        else:
            bend += slope * a
    return DerivedRow(name, row.residual, speed, tuple(slopes), bend)


@dataclass(frozen=True)
class _Motion:
    """How what constraints depend on moves.

    speeds      the motion of bodies and frames over that of their parents, in order
    velocities  of all coordinates, each with its derivative if that is prescribed
    rates       the time derivative of each symbol of a pose
    """

    model: Model
    speeds: tuple[Definition, ...]
    velocities: Mapping[Expr, Expr | None]
    rates: Mapping[Expr, Expr]

    @classmethod
    def of(cls, linkage: Linkage, bodies: Sequence[str]) -> "_Motion":
        definitions, _ = poses(linkage, bodies)
        model, size = linkage.model, linkage.model.dimensions
        bodied = {b.name for b in model.bodies}
        moving: set[Expr] = set()
        rates: dict[Expr, Expr] = {real("t"): sp.S.One}
        rates |= coordinate_rates(model)
        known = {symbol for symbol, _ in definitions}
        for frame in linkage.frames:
            name = linkage.name(frame)
            moving |= {real(dotted(f"o_{frame.name},{axis}")) for axis in AXES[:size]}
            moving |= {*omega_symbols(name, size), *velocity_symbols(name, size)}
            for axis in AXES[:size]:
                pair = real(f"o_{frame.name},{axis}"), real(dotted(f"o_{frame.name},{axis}"))
                rates |= [pair] if pair[1] in known else []
            if name in bodied:
                rates |= zip(position_symbols(name, size), velocity_symbols(name, size),
                             strict=True)  # fmt: skip
                rates |= _rotation_rates(name, size)
        for symbol, value in definitions:
            if symbol not in moving and symbol not in rates:
                rates[symbol] = rate(value, rates)
        velocities: dict[Expr, Expr | None] = {real(c.name): None for c in model.velocities}
        for c in model.prescribed:
            if not c.locked:
                velocities[real(c.velocity.name)] = real(c.velocity.acceleration)
        speeds = tuple(pair for pair in definitions if pair[0] in moving)
        return cls(model, speeds, velocities, rates)

    def with_points(self, points: Sequence[Definition]) -> tuple["_Motion", list[Definition]]:
        """The same with symbols for the time derivatives of further symbols, and what these are."""
        rates, found = dict(self.rates), list[Definition]()
        for symbol, value in points:
            speed = real(dotted(symbol.name))
            found.append((speed, rate(value, rates)))
            rates[symbol] = speed
        return replace(self, rates=rates), found

    def over_velocities(self, speed: Expr) -> Expr:
        """A speed over the velocities of the coordinates."""
        for symbol, value in reversed(self.speeds):
            speed = speed.xreplace({symbol: value})
        return speed

    def rate(self, expression: Expr) -> Expr:
        """The time derivative of what depends on poses and time."""
        return rate(expression, self.rates)


def coordinate_rates(model: Model) -> Iterator[tuple[Expr, Expr]]:
    """Each coordinate and its time derivative: ½ q ∘ ω for a quaternion q."""
    for body in model.bodies:
        count = body.plain
        yield from (
            (real(x.name), real(v.name))
            for x, v in zip(body.positions[:count], body.velocities[:count], strict=True)
        )
        if len(body.positions) > count:
            q = [real(c.name) for c in body.positions[count:]]
            spin = [real(v.name) for v in body.velocities[count:]]
            yield from zip(q, quaternion_rates(q, spin), strict=True)


def _rotation_rates(body: str, size: int) -> Iterator[tuple[Expr, Expr]]:
    """ψ̇ = ω in the plane, Ẇ = Ω × W in space."""
    omega = omega_symbols(body, size)
    if size == 2:
        yield real(f"psi_{body}"), omega[0]
        return
    entries = rotation_symbols(body, size)
    for j in range(3):
        column = tuple(entries[:, j])
        yield from zip(column, crossed(omega, column), strict=True)
