"""What the frames carry, about its own centre: masses and inertias put together by sums alone."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from eomgen.derivation.recursive.frames import Linkage
from eomgen.derivation.recursive.vectors import (
    AXES,
    Scalar,
    Scalars,
    Symmetric,
    Vec,
    add,
    congruent,
    constant,
    plus,
    scale,
    sub,
    symmetric,
    zeros,
)

LIGHT = 10.0
"""How many times heavier than a body one that it carries must be for it to be light."""


@dataclass(frozen=True)
class Solid:
    """What a frame carries as one body: mass, centre and inertia about it, in the frame's axes."""

    mass: Scalar
    centre: Vec
    inertia: Symmetric


def solids(linkage: Linkage, scalars: Scalars) -> tuple[Solid | None, ...]:
    """What each frame carries, if anything; bodies welded together as one, without cancellation."""
    found: list[Solid | None] = [None] * len(linkage.frames)
    for mount in linkage.mounts:
        inertia = mount.inertia
        if not linkage.planar:
            inertia = congruent(constant(mount.axes, scalars), inertia)
        empty = all(scalars.is_zero(x) for x in (mount.mass, *(inertia[i][i] for i in AXES)))
        if mount.frame >= 0 and not empty:
            one, other = Solid(mount.mass, mount.at, inertia), found[mount.frame]
            found[mount.frame] = one if other is None else _welded(other, one, scalars)
    return tuple(found)


def _welded(a: Solid, b: Solid, scalars: Scalars) -> Solid:
    """Two as one: I = I_a + I_b + (m_a m_b / m) (r² 1 - r rᵀ) with r between the centres."""
    if scalars.is_zero(b.mass) or scalars.is_zero(a.mass):
        heavy = a if scalars.is_zero(b.mass) else b
        return replace(heavy, inertia=plus(a.inertia, b.inertia))
    mass = a.mass + b.mass
    share = b.mass / mass
    x, y, z = way = sub(b.centre, a.centre)
    k = a.mass * share
    xx, yy, zz = k * x * x, k * y * y, k * z * z
    off = (-(k * x * y), -(k * x * z), -(k * y * z))
    more = symmetric([yy + zz, xx + zz, xx + yy, *off])
    inertia = plus(plus(a.inertia, b.inertia), more)
    return Solid(mass, add(a.centre, scale(share, way)), inertia)


def centres(carried: Sequence[Solid | None], scalars: Scalars) -> list[Vec]:
    """The centre of what each frame carries; its origin where that is nothing."""
    return [zeros(scalars) if solid is None else solid.centre for solid in carried]


@dataclass(frozen=True)
class Ranks:
    """Which bodies are heavier than others, by frame: the child that carries more mass than the
    frame itself and any other child, -1 if none; and whether a body is light beside one it carries.
    """

    heaviest: tuple[int, ...]
    light: tuple[bool, ...]


def ranked(linkage: Linkage) -> Ranks:
    """The ranks of a linkage over floats."""
    own = [float(frame.rigid.mass) for frame in linkage.frames]
    whole, most, found, single = list(own), list(own), [-1] * len(own), list(own)
    for k in reversed(range(len(own))):
        parent = linkage.frames[k].parent
        if parent >= 0:
            whole[parent] += whole[k]
            single[parent] = max(single[parent], single[k])
            if whole[k] > most[parent]:
                most[parent], found[parent] = whole[k], k
    light = (one > LIGHT * mass for one, mass in zip(single, own, strict=True))
    return Ranks(tuple(found), tuple(light))
