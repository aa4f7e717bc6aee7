"""Clusters: the frames between which constraints act, each with the frame that carries it.

A constraint acts between some frames of the tree. Relative to the nearest frame that carries them
all, its base, it restricts the velocities of the frames on the paths there and no others. Paths
that share a frame make one cluster.
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

from eomgen.dynamics.articulated import along
from eomgen.dynamics.constraints import rows_of
from eomgen.dynamics.forces import at_parent
from eomgen.dynamics.kinematics import Link
from eomgen.dynamics.loads import wrench_of
from eomgen.dynamics.mechanism_state import MechanismState
from eomgen.scalars.protocol import Scalar
from eomgen.scene.constraints.base import Row
from eomgen.scene.effects.base import JointLoad
from eomgen.scene.joints.base import WORLD


@dataclass(frozen=True)
class Cluster:
    """Frames, parents first, that constraints connect; `base` carries them, -1 is the world."""

    base: int
    frames: tuple[int, ...]


def clusters_of(d: MechanismState) -> tuple[Cluster, ...]:
    """The clusters of a mechanism's constraints, in the order of their first frames."""
    links = d.kinematics.links
    found: list[tuple[int, set[int]]] = []
    for row in rows_of(d):
        base, frames = span(d, row)
        while True:  # merge with those that share frames, until none does
            shared = [other for other in found if other[1] & frames]
            if not shared:
                break
            found = [other for other in found if other not in shared]
            base = common(links, [base, *(other for other, _ in shared)])
            ends = frames.union(*(more for _, more in shared))
            frames = {k for end in ends for k in path(links, end, base)}
        if frames:
            found.append((base, frames))
    ordered = [Cluster(base, tuple(sorted(frames))) for base, frames in found]
    return tuple(sorted(ordered, key=lambda cluster: cluster.frames))


def span(d: MechanismState, row: Row) -> tuple[int, set[int]]:
    """The base of a row, and the frames whose velocities it restricts."""
    links = d.kinematics.links
    owner = {i: k for k, link in enumerate(links) for i in link.v}
    bodies: dict[str, int] = {}
    joints: list[int] = []
    for load in row.loads:
        if isinstance(load, JointLoad):
            i = d.joint_indices[load.joint].v[load.coordinate]
            joints += [owner[i]] if i in owner else []
        else:
            on = load.body
            bodies[on] = -1 if on == WORLD else d.linkage.mounts[d.index[on]].frame
    ends = [*bodies.values(), *joints]
    bases = [*bodies.values(), *(links[k].parent for k in joints)]
    if len(bodies) == 1:  # a reaction on the world is left out
        bases.append(-1)
    base = common(links, bases) if bases else -1
    return base, {k for end in ends for k in path(links, end, base)}


def jacobian_of(d: MechanismState) -> list[list[Scalar]]:
    """J: for each row its derivative by each velocity of the state, (nv,).

    The wrenches of a row's loads are carried inwards to its base only: beyond, they cancel.
    """
    return [_derivatives(d, row) for row in rows_of(d)]


def _derivatives(d: MechanismState, row: Row) -> list[Scalar]:
    links, (base, _) = d.kinematics.links, span(d, row)
    found = [d.scalars.number(0.0)] * d.moved
    for load in row.loads:
        if isinstance(load, JointLoad):
            i = d.joint_indices[load.joint].v[load.coordinate]
            if i < d.moved:
                found[i] = found[i] + load.force
            continue
        frame, wrench = wrench_of(d, load)
        while frame != base:
            link = links[frame]
            for axis, i in link.free:
                found[i] = found[i] + along(axis, wrench.moment, wrench.force)
            wrench, frame = at_parent(link, wrench), link.parent
    return found[: d.nv]


def path(links: Sequence[Link], end: int, base: int) -> list[int]:
    """The frames from `end` inwards to `base`, without it."""
    found = []
    while end != base:
        found.append(end)
        end = links[end].parent
    return found


def common(links: Sequence[Link], frames: Collection[int]) -> int:
    """The nearest frame that carries all of the given ones or is one of them; -1 is the world."""
    paths = [[k, *_above(links, k)] for k in frames]
    shared = set(paths[0]).intersection(*paths[1:])
    return next(k for k in paths[0] if k in shared)


def _above(links: Sequence[Link], k: int) -> Iterable[int]:
    while k >= 0:
        k = links[k].parent
        yield k
