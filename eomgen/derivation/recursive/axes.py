"""Axes and origins of frames chosen so that what is fixed between them is as simple as can be.

A frame that turns about its axis k may have its own axes turned about k by any fixed angle: the
turn then starts from another angle, and nothing else changes. A fixed rotation between two such
frames is R_i(a) R_m(b) R_k(c) with i the parent's axis and k the frame's own; c goes into the
frame's axes, a into the parent's, and R_m(b) is left: Denavit's and Hartenberg's choice. A parent
can make it for one of its children; the others keep R_i(a). Likewise the origin may lie anywhere on
the axis of a turn, which takes one component off its offset, and of a slide anywhere at all.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from eomgen.derivation.recursive.frames import Array, Frame, Mount, turn_matrix
from eomgen.derivation.recursive.vectors import (
    Scalars,
    Vec,
    add,
    constant,
    replaced,
    scale,
    sub,
    times,
    unit,
    zeros,
)


def with_simple_origins(
    frames: Sequence[Frame], mounts: Sequence[Mount], scalars: Scalars
) -> tuple[list[Frame], list[Mount]]:
    """The same mechanism with offsets of as few components as can be."""
    frames, mounts = list(frames), list(mounts)
    for k, (children, riders) in enumerate(_carried(frames, mounts)):
        frame = frames[k]
        if frame.kind == "spin":
            continue
        offset, shift = _better_origin(frame, scalars)
        offsets = [frames[n].offset for n in children]
        centres = [mounts[n].at for n in riders]
        before = _parts([frame.offset, *offsets], centres, scalars)
        moved = [[sub(a, shift) for a in vectors] for vectors in (offsets, centres)]
        if _parts([offset, *moved[0]], moved[1], scalars) >= before:
            continue
        frames[k] = replace(frame, offset=offset)
        for n in children:
            frames[n] = replace(frames[n], offset=sub(frames[n].offset, shift))
        for n in riders:
            mounts[n] = replace(mounts[n], at=sub(mounts[n].at, shift))
    return frames, mounts


Carried = tuple[list[int], list[int]]
"""Indices of what a frame carries: frames and mounts."""


def _carried(frames: Sequence[Frame], mounts: Sequence[Mount]) -> tuple[Carried, ...]:
    found: tuple[Carried, ...] = tuple(([], []) for _ in frames)
    for n, frame in enumerate(frames):
        if frame.parent >= 0:
            found[frame.parent][0].append(n)
    for n, mount in enumerate(mounts):
        if mount.frame >= 0:
            found[mount.frame][1].append(n)
    return found


def _better_origin(frame: Frame, scalars: Scalars) -> tuple[Vec, Vec]:
    """Another offset of a frame, and how far its origin moves for it, in its own axes."""
    fixed = frame.fixed
    if frame.kind == "slide":
        return zeros(scalars), times(constant(-fixed.T, scalars), frame.offset)
    image = fixed[:, frame.axis]
    j = int(np.argmax(np.abs(image)))
    way = frame.offset[j] / scalars.number(-float(image[j]))
    moved = add(frame.offset, scale(way, constant(fixed.T, scalars)[frame.axis]))
    # Zero by choice; a program that computed it would see rounding.
    offset = replaced(moved, j, scalars.number(0.0))
    return offset, scale(way, unit(frame.axis, scalars))


def _parts(offsets: Sequence[Vec], centres: Sequence[Vec], scalars: Scalars) -> int:
    """Components that are not zero; those of an offset, which moves a whole subtree, twice."""
    return sum(
        weight * (not scalars.is_zero(x))
        for weight, vectors in ((2, offsets), (1, centres))
        for vector in vectors
        for x in vector
    )


def with_simple_axes(
    frames: Sequence[Frame], mounts: Sequence[Mount], scalars: Scalars
) -> tuple[list[Frame], list[Mount]]:
    """The same mechanism with fixed rotations as simple as they can be."""
    frames, mounts = list(frames), list(mounts)
    carried = _carried(frames, mounts)
    fitted: set[int] = set()
    for k in range(len(frames)):
        frame = frames[k]
        if frame.kind != "turn" or _is_signed_permutation(frame.fixed):
            continue
        above = frames[frame.parent] if frame.parent >= 0 else None
        fits = above is not None and above.kind == "turn" and frame.parent not in fitted
        i = above.axis if above is not None and fits else (frame.axis + 1) % 3
        a, m, b, c = _factors(frame.fixed, i, frame.axis)
        _turn_axes(frames, mounts, carried[k], turn_matrix(frame.axis, c), scalars)
        rest = turn_matrix(m, b)
        if fits:
            above = frames[frame.parent]
            fitted.add(frame.parent)
            _turn_axes(frames, mounts, carried[frame.parent], turn_matrix(i, -a), scalars)
            frames[frame.parent] = replace(above, lead=above.lead + a)
        else:
            rest = turn_matrix(i, a) @ rest
        frames[k] = replace(frames[k], fixed=rest)
    return frames, mounts


def _turn_axes(
    frames: list[Frame], mounts: list[Mount], carried: Carried, turned: Array, scalars: Scalars
) -> None:
    """Write what a frame carries in other axes of its own; `turned` takes vectors into them."""
    children, riders = carried
    node = constant(turned, scalars)
    for n in children:
        fixed, offset = turned @ frames[n].fixed, times(node, frames[n].offset)
        frames[n] = replace(frames[n], fixed=fixed, offset=offset)
    for n in riders:
        axes, at = turned @ mounts[n].axes, times(node, mounts[n].at)
        mounts[n] = replace(mounts[n], axes=axes, at=at)


def _is_signed_permutation(matrix: Array) -> bool:
    return bool(np.all((matrix == 0.0) | (np.abs(matrix) == 1.0)))


def _factors(matrix: Array, i: int, k: int) -> tuple[float, int, float, float]:
    """a, m, b, c with matrix = R_i(a) R_m(b) R_k(c)."""
    m = (k + 1) % 3 if i == k else 3 - i - k
    # R_i(-a) brings the image of axis k into the plane that turns about m leave alone.
    image = matrix[:, k]
    p, q = (i + 1) % 3, (i + 2) % 3
    a = math.atan2(-image[p], image[q]) if m == p else math.atan2(image[q], image[p])
    a -= math.copysign(math.pi, a) if abs(a) > math.pi / 2 else 0.0
    rest = turn_matrix(i, -a) @ matrix
    u, v = (m + 1) % 3, (m + 2) % 3
    reached = rest[:, k]
    b = math.atan2(reached[v], reached[u]) if k == u else math.atan2(-reached[u], reached[v])
    last = turn_matrix(m, -b) @ rest
    y, z = (k + 1) % 3, (k + 2) % 3
    return a, m, b, math.atan2(last[z, y], last[y, y])
