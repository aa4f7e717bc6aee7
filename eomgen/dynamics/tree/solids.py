"""Bodies on each frame as one solid: mass, centre and inertia about that, by sums alone.

Sums of positive terms do not cancel, so that every digit is kept at any ratio of masses.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

from eomgen.dynamics.tree.frames import Linkage
from eomgen.dynamics.tree.vectors import (
    AXES,
    Symmetric,
    Vec,
    add,
    congruent,
    constant,
    dot,
    plus,
    scale,
    sub,
    symmetric,
    zeros,
)
from eomgen.scalars.floats import FloatScalars
from eomgen.scalars.protocol import Scalar, Scalars

DOMINANT = 0.01
"""A body is dominant if its own mass and inertia are at least this part of its neighbours'."""


@dataclass(frozen=True)
class Solid:
    """The bodies of a frame as one: mass (kg), centre (m) and inertia about it (kg m²), in the
    frame's axes.
    """

    mass: Scalar
    centre: Vec
    inertia: Symmetric


def solids(linkage: Linkage, scalars: Scalars) -> tuple[Solid | None, ...]:
    """The solid of each frame, None without mass; bodies welded together are one."""
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
    """Two solids as one: I = I_a + I_b + (m_a m_b / m) (r² 1 - r rᵀ), the parallel-axis theorem
    with r between the centres.
    """
    if scalars.is_zero(b.mass) or scalars.is_zero(a.mass):
        heavy = a if scalars.is_zero(b.mass) else b
        return replace(heavy, inertia=plus(a.inertia, b.inertia))
    mass = a.mass + b.mass
    share = b.mass / mass
    x, y, z = offset = sub(b.centre, a.centre)
    k = a.mass * share
    xx, yy, zz = k * x * x, k * y * y, k * z * z
    off = (-(k * x * y), -(k * x * z), -(k * y * z))
    more = symmetric([yy + zz, xx + zz, xx + yy, *off])
    inertia = plus(plus(a.inertia, b.inertia), more)
    return Solid(mass, add(a.centre, scale(share, offset)), inertia)


def centres(carried: Sequence[Solid | None], scalars: Scalars) -> list[Vec]:
    """The centre of mass of each frame's solid; the origin of a frame without one."""
    return [zeros(scalars) if solid is None else solid.centre for solid in carried]


@dataclass(frozen=True)
class Ranks:
    """The order of masses that the elimination follows, by frame.

    heaviest  the child that carries more mass than the frame itself and than any other child, -1 if
              there is none; on a ball joint it is the heaviest in every pose
    beside    on a ball joint the second such child, where an axis is to lie along the line between
              the two; -1 elsewhere
    dominant  whether a frame's own mass and inertia dominate its neighbours', or are at least of
              their order (`DOMINANT`): forces move it about as if it were alone
    """

    heaviest: tuple[int, ...]
    beside: tuple[int, ...]
    dominant: tuple[bool, ...]

    def without(self, frames: Collection[int]) -> "Ranks":
        """The same without heaviest children of some frames."""
        heaviest, beside = (
            tuple(-1 if k in frames else n for k, n in enumerate(own))
            for own in (self.heaviest, self.beside)
        )
        return replace(self, heaviest=heaviest, beside=beside)


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
    free = _translates_freely(linkage, carried)
    for k in reversed(range(len(own))):
        children = carried[k]
        whole[k] += sum(whole[n] for n in children if not free[n])
        single[k] = max([own[k], *(single[n] for n in children if not free[n])])
        fixed = sorted((*(least[n] for n in children), 0.0, 0.0, 0.0), reverse=True)
        spins = frames[k].kind == "spherical"
        # The mass that still resists when all rotations are free.
        least[k] = 0.0 if frames[k].kind == "prismatic" else max(own[k], fixed[2 if spins else 1])
        weights = least if spins else [0.0 if free[n] else w for n, w in enumerate(whole)]
        order = sorted(children, key=lambda n: -weights[n])
        if order and weights[order[0]] > own[k]:
            heaviest[k] = order[0]
            third = max(own[k], fixed[2])
            # A free body has no joint above it that would need the axes along another line.
            loose = frames[k].parent >= 0 and own[frames[k].parent] == 0.0
            if spins and fixed[1] > third and (loose or fixed[1] ** 2 > fixed[0] * third):
                beside[k] = order[1]
    dominant = _dominant(linkage, carried, single)
    return Ranks(tuple(heaviest), tuple(beside), tuple(dominant))


def _translates_freely(linkage: Linkage, carried: Sequence[Sequence[int]]) -> list[bool]:
    """For each frame whether it begins prismatic joints along all axes. No force passes these."""
    frames, needed = linkage.frames, 2 if linkage.planar else 3
    run = [0] * len(frames)
    for k in reversed(range(len(frames))):
        if frames[k].kind == "prismatic":
            alone = frames[k].rigid.mass == 0.0 and len(carried[k]) == 1
            run[k] = 1 + (run[carried[k][0]] if alone else 0)
    return [n >= needed for n in run]


def _dominant(
    linkage: Linkage, carried: Sequence[Sequence[int]], single: Sequence[float]
) -> Iterator[bool]:
    """For each frame whether its own mass and inertia are at least `DOMINANT` times those of its
    neighbours: the heaviest body it carries, masses on arms, rotors.
    """
    frames, axes = linkage.frames, AXES[2 * linkage.planar :]
    found = solids(linkage, FloatScalars())
    moments = [[solid.inertia[j][j] for j in axes] if solid else [0.0] for solid in found]
    for k, (frame, solid) in enumerate(zip(frames, found, strict=True)):
        if solid is None:
            yield False
            continue
        masses, inertias = [single[k]], [solid.mass * dot(solid.centre, solid.centre)]
        for n in carried[k]:
            arm = frames[n].offset
            inertias += [single[n] * dot(arm, arm), max(moments[n])]
        for joint in (frame, *(frames[n] for n in carried[k])):
            (masses if joint.kind == "prismatic" else inertias).append(joint.armature)
        yield solid.mass >= DOMINANT * max(masses) and min(moments[k]) >= DOMINANT * max(inertias)
