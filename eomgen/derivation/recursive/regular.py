"""Is there inertia against every motion? Asked before code is written, in numbers."""

import random
from collections.abc import Sequence
from dataclasses import replace

from eomgen.derivation.recursive.articulated import (
    eliminated,
    inertia_along,
    joined,
    moved_to_parent,
    resistance_of,
)
from eomgen.derivation.recursive.composite import composite_bodies
from eomgen.derivation.recursive.instant import Axes, at_instant
from eomgen.derivation.recursive.linkage import make_linkage
from eomgen.derivation.recursive.numbers import FloatScalars
from eomgen.errors import SceneError
from eomgen.joints.base import Geared
from eomgen.language.formula import Constant, Formula
from eomgen.model import Body, Model

TRIALS = 3
VANISHED = 1e-12
"""A pivot below this share of the diagonal entry it came from is rounding."""


def check_regular(model: Model) -> None:
    """Raise `SceneError`, naming the body and what to change, if the mass matrix is singular.

    M is singular where some motion moves no mass, however large the masses are; so all of them are
    taken as 1, which leaves no question of rounding. A pivot of the articulated-body algorithm is
    the inertia that a velocity feels when all that it carries is free; one that vanishes at seeded
    random poses vanishes at all, or at almost all.
    """
    even = replace(model, bodies=tuple(_evened(body, model) for body in model.bodies))
    rng = random.Random(20)
    largest: dict[int, float] = {}
    for _ in range(TRIALS):
        q = [rng.uniform(-1.5, 1.5) for _ in (*model.coordinates, *model.driven)]
        for i, share in _shares(even, q).items():
            largest[i] = max(largest.get(i, 0.0), share)
    for i in sorted(largest, reverse=True):
        if largest[i] < VANISHED:
            raise SceneError(_singular(model, i))


def resistances(model: Model, poses: Sequence[Sequence[float]]) -> list[dict[int, float]]:
    """At each pose, for each velocity, the inertia that it feels when all that it carries is free,
    in parts of the greatest that it feels at any of these poses and a few seeded ones.

    As in `check_regular` all masses are taken as 1: heavy on light is no lock. Where the axes of a
    joint come into line with what they carry, as those of a gimbal do, some motion moves no mass:
    it feels none there, and the mass matrix tells no acceleration.
    """
    model = replace(model, bodies=tuple(_evened(body, model) for body in model.bodies))
    rng = random.Random(20)
    count = len(model.coordinates)
    some = [[rng.uniform(-1.5, 1.5) for _ in range(count)] for _ in range(TRIALS)]
    found = [
        {i: pivot for i, (pivot, _) in _pivots(model, list(q)).items()} for q in (*poses, *some)
    ]
    largest = {i: max(pivots[i] for pivots in found) for i in found[0]}
    return [
        {i: pivot / largest[i] if largest[i] > 0 else 0.0 for i, pivot in pivots.items()}
        for pivots in found[: len(poses)]
    ]


def why_unresisted(model: Model, i: int) -> str:
    """What it means that next to nothing resists velocity `i`, and what to change."""
    body = next(seat.body for seat in model.seats if i in seat.v)
    where = f"'{model.velocities[i].name}' of joint '{body.joint.name}'"
    if model.dimensions == 3:
        return (
            f"next to nothing resists {where}, gimbal lock: a turn about its axis moves no mass; "
            "give it inertia, or take a joint of type 'ball'"
        )
    return f"next to nothing resists {where}: it moves no mass; give it some, or keep away"


def _evened(body: Body, model: Model) -> Body:
    """A body with mass 1 for any, inertia of size 1 for any, a rotor of 1 for any."""

    def size(formula: Formula, unit: float = 1.0) -> Constant:
        return Constant(model.value(formula) / unit if unit else 0.0)

    entries = [abs(model.value(entry)) for entry in body.inertia_com]
    joint = body.joint
    if isinstance(joint, Geared):
        turns = 1.0 if joint.gear_ratio is None else model.value(joint.gear_ratio)
        rotor = Constant(float(model.value(joint.motor_inertia) > 0 and turns != 0.0))
        joint = joint.replaced(motor_inertia=rotor, gear_ratio=None)
    return replace(
        body,
        mass=Constant(float(model.value(body.mass) > 0)),
        inertia_com=tuple(size(entry, max(entries)) for entry in body.inertia_com),
        joint=joint,
    )


def _shares(model: Model, q: list[float]) -> dict[int, float]:
    """For each velocity its pivot over its entry of M."""
    pairs = _pivots(model, q).items()
    return {i: pivot / entry if entry > 0 else 0.0 for i, (pivot, entry) in pairs}


def _pivots(model: Model, q: list[float]) -> dict[int, tuple[float, float]]:
    """For each velocity its pivot and its entry of M; one that is nothing frees nothing more."""
    scalars = FloatScalars()
    linkage = make_linkage(model, model.defaults, scalars)
    axes: Axes = "world" if model.dimensions == 2 else "own"
    instant = at_instant(linkage, q, axes, scalars)
    bodies = composite_bodies(instant, scalars)
    sums = [resistance_of(link, 0.0) for link in instant.links]
    pivots: dict[int, tuple[float, float]] = {}
    for k in reversed(range(len(sums))):
        link, left = instant.links[k], sums[k]
        whole = resistance_of(replace(link, rigid=bodies[k]), 0.0)
        for axis, i in link.free:
            pivot, entry = inertia_along(left, axis), inertia_along(whole, axis) + link.armature
            pivots[i] = (pivot + link.armature, entry)
            if entry > 0 and pivots[i][0] >= VANISHED * entry:
                _, left = eliminated(left, axis, link, scalars)
        if link.parent >= 0:
            moved = moved_to_parent(link, left, scalars)
            sums[link.parent] = joined(sums[link.parent], moved)
    return pivots


def _singular(model: Model, i: int) -> str:
    name = model.velocities[i].name
    body = next(seat.body for seat in model.seats if i in seat.v)
    return (
        f"body '{body.name}': nothing resists '{name}', neither its mass or inertia nor what it "
        "carries; give it some, or a joint that does not move so"
    )
