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
    """Which bodies are heavier than others, by frame.

    heaviest  the child that carries more mass than the frame itself and any other child, -1 if
              none; of a ball joint the child that is heaviest whatever way it is moved
    beside    of a ball joint the next such child, where axes are to be along the line between these
              two; -1 elsewhere
    light     whether a body is light beside one it carries
    """

    heaviest: tuple[int, ...]
    beside: tuple[int, ...]
    light: tuple[bool, ...]


def ranked(linkage: Linkage) -> Ranks:
    """The ranks of a linkage over floats."""
    frames = linkage.frames
    own = [float(frame.rigid.mass) for frame in frames]
    whole, single, least = list(own), list(own), list(own)
    heaviest, beside = [-1] * len(own), [-1] * len(own)
    carried: list[list[int]] = [[] for _ in frames]
    for n, frame in enumerate(frames):
        if frame.parent >= 0:
            carried[frame.parent].append(n)
    for k in reversed(range(len(own))):
        children = carried[k]
        whole[k] += sum(whole[n] for n in children)
        single[k] = max([own[k], *(single[n] for n in children)])
        firm = sorted((*(least[n] for n in children), 0.0, 0.0, 0.0), reverse=True)
        spins = frames[k].kind == "spin"
        # What is left of so many points when all turns are free.
        least[k] = 0.0 if frames[k].kind == "slide" else max(own[k], firm[2 if spins else 1])
        weights = least if spins else whole
        order = sorted(children, key=lambda n: -weights[n])
        if order and weights[order[0]] > own[k]:
            heaviest[k] = order[0]
            third = max(own[k], firm[2])
            # Nothing holds the frame of a free body: there no other line asks for the axes.
            free = frames[k].parent >= 0 and own[frames[k].parent] == 0.0
            if spins and firm[1] > third and (free or firm[1] ** 2 > firm[0] * third):
                beside[k] = order[1]
    light = (one > LIGHT * mass for one, mass in zip(single, own, strict=True))
    return Ranks(tuple(heaviest), tuple(beside), tuple(light))
