"""Clusters: the frames between which constraints act, each with the frame that carries it.

A constraint acts between some frames of the tree. Relative to the nearest frame that carries them
all, its base, it restricts the velocities of the frames on the paths there and no others. Paths
that share a frame make one cluster.
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

from eomgen.dynamics.loops.constraints import position_rates
from eomgen.dynamics.tree.articulated import along
from eomgen.dynamics.tree.forces import at_parent
from eomgen.dynamics.tree.kinematics import Link
from eomgen.dynamics.tree.loads import power_of, wrench_of
from eomgen.dynamics.tree.mechanism_state import MechanismState
from eomgen.dynamics.tree.motion import Acceleration, Twist, accelerations, velocities
from eomgen.dynamics.tree.observables import arm
from eomgen.dynamics.tree.vectors import add, in_space, sub, times, zeros
from eomgen.model.named import Values
from eomgen.scalars.duals import Dual, Duals
from eomgen.scalars.protocol import Scalar
from eomgen.scene.constraints import LoopJoint, Row
from eomgen.scene.effects.base import JointLoad
from eomgen.scene.joints.base import WORLD, kinds_of


@dataclass(frozen=True)
class Cluster:
    """Frames, parents first, that constraints connect; `base` carries them, -1 is the world."""

    base: int
    frames: tuple[int, ...]


def clusters_of(d: MechanismState) -> tuple[Cluster, ...]:
    """The clusters of a mechanism's constraints, in the order of their first frames."""
    links = d.kinematics.links
    found: list[tuple[int, set[int]]] = []
    for row in d.rows:
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
    return [_derivatives(d, row)[: d.nv] for row in d.rows]


def accelerations_at_rest(d: MechanismState) -> list[Scalar]:
    """β: the second derivative of each g at v̇ = 0.

    Of a pin in the plane, between branches that meet in the world only, the difference of the
    accelerations of two points, which shares parts with the equations of motion. Else by dual
    numbers along q̇ and t.
    """
    points = _of_pins(d)
    names = [name for name, _ in d.model.rows]
    if all(name in points for name in names):
        return [points[name] for name in names]
    pairs = zip(names, _by_duals(d), strict=True)
    return [points.get(name, by_duals) for name, by_duals in pairs]


def _of_pins(d: MechanismState) -> dict[str, Scalar]:
    """Those of such pins, by the names of their rows."""
    found: dict[str, Scalar] = {}
    if d.dimensions == 3 or d.model.driven:
        return found
    rows = {name: row for (name, _), row in zip(d.model.rows, d.rows, strict=True)}
    frames = accelerations(d.in_world, _in_world(d), d.v, None, zeros(d.scalars), d.scalars)
    for loop in d.model.loops:
        own = [name for name, _ in loop.row_names(2)]
        if kinds_of(loop.joint, 2) == ["revolute"] and all(
            span(d, rows[name])[0] < 0 for name in own if name in rows
        ):
            found.update(zip(own, _apart(d, loop, frames), strict=True))
    return found


def _in_world(d: MechanismState) -> tuple[Twist, ...]:
    return d.twists if d.axes == "world" else velocities(d.in_world, d.v, d.scalars)


def _apart(d: MechanismState, loop: LoopJoint, frames: Sequence[Acceleration]) -> list[Scalar]:
    """The acceleration of a planar pin's point of the child minus that of the parent, (2,)."""
    found = []
    ends = ((loop.joint.child, loop.joint.r_child), (loop.joint.parent, loop.joint.r_parent))
    for body, at in ends:
        frame = -1 if body == WORLD else d.linkage.mounts[d.index[body]].frame
        if frame < 0:
            found.append(zeros(d.scalars))
            continue
        own = in_space([d.value(part) for part in at], d.scalars)
        reach = arm(d.linkage, d.in_world, d.index[body], own, d.scalars)
        found.append(add(frames[frame].linear, times(frames[frame].field, reach)))
    return list(sub(*found)[:2])


def _by_duals(d: MechanismState) -> list[Scalar]:
    """Those of all rows, by dual numbers.

    They are taken in world axes, where the spin of a wheel does not turn its rolling point to and
    fro, and of the motion relative to a row's base: that of the base cancels.
    """
    model, values, scalars = d.model, d.values, d.scalars
    dual, one = Duals(scalars), scalars.number(1.0)
    moving = Values(
        {name: dual.still(x) for name, x in values.parameters.items()},
        {name: dual.still(x) for name, x in values.inputs.items()},
        [Dual(x, rate) for x, rate in zip(values.q, position_rates(d), strict=True)],
        [dual.still(x) for x in values.v],
        {name: dual.still(x) for name, x in values.states.items()},
        Dual(values.time, one),
    )
    state = MechanismState(model, moving, dual, "world")
    found = []
    for row in state.rows:
        rate = _inner_rate(state, row)
        found.append((rate if row.drift is None else rate + row.drift).rate)
    return found


def _inner_rate(d: MechanismState, row: Row) -> Scalar:
    """J v of a row: the power of its loads, without what cancels by the motion of its base."""
    if span(d, row)[0] < 0:
        return power_of(d, row.loads)
    total = d.scalars.number(0.0)
    for slope, speed in zip(_derivatives(d, row), d.v[: d.moved], strict=True):
        if not d.scalars.is_zero(slope):
            total = total + slope * speed
    return total


def _derivatives(d: MechanismState, row: Row) -> list[Scalar]:
    """The derivatives of a row by all velocities that move, (moved,)."""
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
            for axis, i in zip(link.axes, link.v, strict=True):
                if i < d.moved:
                    found[i] = found[i] + along(axis, wrench.moment, wrench.force)
            wrench, frame = at_parent(link, wrench), link.parent
    return found


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
