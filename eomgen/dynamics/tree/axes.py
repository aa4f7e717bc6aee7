"""Axes and origins of frames, chosen so that the fixed transforms have as many zeros as possible.

The fixed rotation before a revolute primitive about axis k is R_i(a) R_m(b) R_k(c). R_k(c) can be
added to the joint's angle. If the parent is revolute about i, R_i(a) can be added to its angle, and
R_m(b) is left: the choice of Denavit and Hartenberg. A parent can do so for one child; the others
keep R_i(a). The origin of a revolute frame may lie anywhere on its axis, which removes one
component of its offset. That of a prismatic frame may lie anywhere.

The bodies on a frame are then written in other axes, and rounded. Components that were small beside
others lose digits in that. In a scene with such components (`is_graded`) axes are changed by
quarter turns only.
"""

from collections.abc import Sequence
from dataclasses import replace

from eomgen.dynamics.tree.frames import Frame, Mount
from eomgen.dynamics.tree.vectors import (
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
"""A component smaller than this part of another one is slight: the rounding of the other would cost
it more than six digits."""


def is_graded(frames: Sequence[Frame], mounts: Sequence[Mount], beside: Sequence[Vec]) -> bool:
    """Whether any rotation, offset or inertia over floats, or any vector of `beside`, has slight
    components that are not 0: axes that almost coincide, a rod that is almost a needle.
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
    """The same mechanism with as few nonzero components of offsets as possible."""
    frames, mounts = list(frames), list(mounts)
    for k, (children, riders) in enumerate(_carried(frames, mounts)):
        frame = frames[k]
        if frame.kind in ("spherical", "fixed") or (graded and not is_straight(frame.fixed)):
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
"""Indices of a frame's child frames and of the mounts on it."""


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
    """Another offset of a frame, and the displacement of its origin, in its own axes."""
    back = constant(exact.transposed(frame.fixed), scalars)
    if frame.kind == "prismatic":
        x, y, z = ((-a, -b, -c) for a, b, c in back)
        return zeros(scalars), times((x, y, z), frame.offset)
    image = [row[frame.axis] for row in frame.fixed]
    j = max(AXES, key=lambda i: abs(image[i]))
    distance = frame.offset[j] / scalars.number(exact.opposite(image[j]))
    moved = add(frame.offset, scale(distance, back[frame.axis]))
    # Exactly zero, where computing it would leave rounding.
    offset = replaced(moved, j, scalars.number(0.0))
    return offset, scale(distance, unit(frame.axis, scalars))


def _parts(offsets: Sequence[Vec], centres: Sequence[Vec], scalars: Scalars) -> int:
    """The number of nonzero components. Those of offsets count twice: they move a subtree."""
    return sum(
        weight * (not scalars.is_zero(x))
        for weight, vectors in ((2, offsets), (1, centres))
        for vector in vectors
        for x in vector
    )


def with_simple_axes(
    frames: Sequence[Frame], mounts: Sequence[Mount], scalars: Scalars, *, graded: bool
) -> tuple[list[Frame], list[Mount]]:
    """The same mechanism with fixed rotations as simple as possible."""
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
    """The parent's axis from which the frame's own is farthest. R_m(b) is then no quarter turn, for
    which a and c would be about one axis, and not unique.
    """
    others = [(frame.axis + 1) % 3, (frame.axis + 2) % 3]
    return min(others, key=lambda i: abs(frame.fixed[i][frame.axis]))


def _rotate_axes(
    frames: list[Frame], mounts: list[Mount], carried: Carried, rotated: Matrix, scalars: Scalars
) -> None:
    """Change a frame's own axes for all that is on it; `rotated` takes vectors into them."""
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
