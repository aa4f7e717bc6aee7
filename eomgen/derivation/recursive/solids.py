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


def heaviest(linkage: Linkage) -> tuple[int, ...]:
    """For each frame which of its children carries more mass than it and any other has; else -1.

    The linkage is one over floats.
    """
    whole = [float(frame.rigid.mass) for frame in linkage.frames]
    most, found = list(whole), [-1] * len(whole)
    for k in reversed(range(len(whole))):
        parent = linkage.frames[k].parent
        if parent >= 0:
            whole[parent] += whole[k]
            if whole[k] > most[parent]:
                most[parent], found[parent] = whole[k], k
    return tuple(found)
