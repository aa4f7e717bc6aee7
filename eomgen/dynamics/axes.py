"""Axes and origins of frames chosen so that what is fixed between them is as simple as can be.

A fixed rotation before a turn is R_i(a) R_m(b) R_k(c) with k the axis of the turn: the turn may
start from another angle, c, and nothing else changes. A parent that turns about i may have its own
axes turned about i by a, and start from another angle: R_m(b) is left, Denavit's and Hartenberg's
choice. A parent can make it for one of its children; the others keep R_i(a). Likewise the origin
may lie anywhere on the axis of a turn, which takes one component off its offset, and of a slide
anywhere at all.

What is carried is then written in other axes, and rounded, so that what was small beside the rest
of it no longer is. In a scene that has such things (`is_graded`) nothing is written in other axes
but those that quarter turns lead to.
"""

from collections.abc import Sequence
from dataclasses import replace

from eomgen.dynamics.frames import Frame, Mount
from eomgen.dynamics.vectors import (
    AXES,
    ENTRIES,
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
from eomgen.scalars import exact
from eomgen.scalars.exact import Matrix
from eomgen.scalars.protocol import Scalars

SLIGHT = 2.0**-20
"""What is less than this part of what it stands beside is slight: rounding in the rest of it costs
it more digits than six."""


def is_graded(frames: Sequence[Frame], mounts: Sequence[Mount], beside: Sequence[Vec]) -> bool:
    """Whether any rotation, arm or inertia over floats, or vector `beside` them, has components
    that are slight beside others but not 0: axes that all but coincide, a rod that is all but a
    needle.
    """
    rotations = (*(frame.fixed for frame in frames), *(mount.axes for mount in mounts))
    vectors: list[Sequence[float]] = [[float(x) for row in r for x in row] for r in rotations]
    vectors += [frame.offset for frame in frames]
    vectors += [mount.at for mount in mounts]
    vectors += [[mount.inertia[i][j] for i, j in ENTRIES] for mount in mounts]
    vectors += beside
    return any(0.0 < abs(x) < SLIGHT * max(map(abs, vector)) for vector in vectors for x in vector)


def with_simple_origins(
    frames: Sequence[Frame], mounts: Sequence[Mount], scalars: Scalars, *, graded: bool
) -> tuple[list[Frame], list[Mount]]:
    """The same mechanism with offsets of as few components as can be."""
    frames, mounts = list(frames), list(mounts)
    for k, (children, riders) in enumerate(_carried(frames, mounts)):
        frame = frames[k]
        if frame.kind == "spherical" or (graded and not is_straight(frame.fixed)):
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
    back = constant(exact.transposed(frame.fixed), scalars)
    if frame.kind == "prismatic":
        x, y, z = ((-a, -b, -c) for a, b, c in back)
        return zeros(scalars), times((x, y, z), frame.offset)
    image = [row[frame.axis] for row in frame.fixed]
    j = max(AXES, key=lambda i: abs(image[i]))
    distance = frame.offset[j] / scalars.number(exact.opposite(image[j]))
    moved = add(frame.offset, scale(distance, back[frame.axis]))
    # Zero by choice; a program that computed it would see rounding.
    offset = replaced(moved, j, scalars.number(0.0))
    return offset, scale(distance, unit(frame.axis, scalars))


def _parts(offsets: Sequence[Vec], centres: Sequence[Vec], scalars: Scalars) -> int:
    """Components that are not zero; those of an offset, which moves a whole subtree, twice."""
    return sum(
        weight * (not scalars.is_zero(x))
        for weight, vectors in ((2, offsets), (1, centres))
        for vector in vectors
        for x in vector
    )


def with_simple_axes(
    frames: Sequence[Frame], mounts: Sequence[Mount], scalars: Scalars, *, graded: bool
) -> tuple[list[Frame], list[Mount]]:
    """The same mechanism with fixed rotations as simple as they can be."""
    frames, mounts = list(frames), list(mounts)
    carried = _carried(frames, mounts)
    fitted: set[int] = set()
    for k in range(len(frames)):
        frame = frames[k]
        if frame.kind != "revolute" or is_straight(frame.fixed):
            continue
        above = frames[frame.parent] if frame.parent >= 0 else None
        fits = not graded and above is not None and above.kind == "revolute"
        fits = fits and frame.parent not in fitted
        i = above.axis if above is not None and fits else _across(frame)
        a, m, b, c = exact.three_rotations(frame.fixed, i, frame.axis)
        rest = exact.rotation_about(m, b)
        if above is not None and fits:
            fitted.add(frame.parent)
            back = exact.rotation_about(i, exact.opposite(a))
            _rotate_axes(frames, mounts, carried[frame.parent], back, scalars)
            frames[frame.parent] = replace(above, lead=exact.total(above.lead, a))
        else:
            rest = exact.product(exact.rotation_about(i, a), rest)
        frames[k] = replace(frames[k], fixed=rest, lead=exact.total(frames[k].lead, c))
    return frames, mounts


def _across(frame: Frame) -> int:
    """The axis, of the parent's, that a frame's own is farthest from: then R_m(b) is no quarter
    turn, in which a and c would be about one axis, and neither of them sure.
    """
    others = [(frame.axis + 1) % 3, (frame.axis + 2) % 3]
    return min(others, key=lambda i: abs(frame.fixed[i][frame.axis]))


def _rotate_axes(
    frames: list[Frame], mounts: list[Mount], carried: Carried, rotated: Matrix, scalars: Scalars
) -> None:
    """Write what a frame carries in other axes of its own; `rotated` takes vectors into them."""
    children, riders = carried
    node = constant(rotated, scalars)
    for n in children:
        fixed, offset = exact.product(rotated, frames[n].fixed), times(node, frames[n].offset)
        frames[n] = replace(frames[n], fixed=fixed, offset=offset)
    for n in riders:
        axes, at = exact.product(rotated, mounts[n].axes), times(node, mounts[n].at)
        mounts[n] = replace(mounts[n], axes=axes, at=at)


def is_straight(rotation: Matrix) -> bool:
    """Whether a rotation takes coordinate axes to coordinate axes."""
    return all(sum(entry != 0 for entry in row) == 1 for row in rotation)
