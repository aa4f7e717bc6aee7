"""The exact derivatives of inverse dynamics, ∂τ/∂q and ∂τ/∂v.

Differentiating the recursion costs a whole sweep for each column. Here each pair of velocities
takes a few products, in world axes at the frames' own origins. A small rotation about axis j
rotates its subtree and all forces there rigidly, and these do no work on the axes below. The rest
comes from the motion that does not rotate with j. The algorithm is that of S. Singh, R. Russo and
P. Wensing, "Efficient analytical derivatives of rigid-body dynamics using spatial vector algebra",
IEEE RA-L 7 (2022), extended to the three axes of a spherical joint. With S the motion axis j, v_p
and a_p the motion of its parent frame, v that of its own,

    ψ' = v_p x S,   ψ'' = a_p x S + v_p x ψ',   S' = v x S,

    ∂τ_i/∂q_j = S_i · (I ψ'' + B ψ'),          ∂τ_i/∂v_j = S_i · (I (ψ' + S') + B S),   j carries i,
    ∂τ_i/∂q_j = S_i · (S x* F + I ψ'' + B ψ'), ∂τ_i/∂v_j as before,                     i carries j,

where I, F and B x = v x* I x - I (v x x) + x x* I v are sums over the subtree of the axis farther
from the root. B uses only the angular part of x: its force is 2 x x p with the momentum p, its
moment is 2 A x with A = (h·v) 1 - v hᵀ - [ω]x E, where h = Σ m r and E = Σ m r rᵀ.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from eomgen.dynamics.tree.composite import Entries, composite_bodies, force_to_move
from eomgen.dynamics.tree.forces import Wrench, at_parent, carried, inertial, total
from eomgen.dynamics.tree.frames import Rigid
from eomgen.dynamics.tree.kinematics import Link, TreeKinematics
from eomgen.dynamics.tree.motion import Acceleration, Twist, momentum_of
from eomgen.dynamics.tree.vectors import (
    AXES,
    Mat,
    Vec,
    add,
    cross,
    dot,
    plus,
    product,
    scale,
    skew,
    sub,
    symmetric,
    times,
    transposed,
    zeros,
)
from eomgen.scalars.protocol import Scalar, Scalars


@dataclass(frozen=True)
class Sensitivity:
    """Matrices (nv, nv) over free velocities: the entries that the tree's shape allows not to be 0.

    `by_position` is ∂τ/∂q, with a small rotation in its own axes for q of a spherical joint;
    `by_velocity` is ∂τ/∂v.
    """

    by_position: Entries
    by_velocity: Entries


@dataclass(frozen=True)
class Column:
    """What one axis j does: S, ψ', ψ'' and ψ' + S'."""

    axis: Twist
    first: Twist
    second: Twist
    both: Twist


def sensitivity(
    kinematics: TreeKinematics,
    twists: Sequence[Twist],
    accelerating: Sequence[Acceleration],
    base: Vec,
    scalars: Scalars,
) -> Sensitivity:
    """Of M v̇ + V + G at the given motion; `kinematics` and the motion are in world axes.

    `base` is the acceleration of the world.
    """
    assert kinematics.axes == "world"
    links = kinematics.links
    bodies = composite_bodies(kinematics, scalars)
    forces = carried(kinematics, inertial(kinematics, accelerating, scalars))
    drags = _composite_drags(kinematics, twists, scalars)
    columns = [
        columns_of(kinematics, k, twists, accelerating, base, scalars) for k in range(len(links))
    ]
    by_q: dict[tuple[int, int], Scalar] = {}
    by_v: dict[tuple[int, int], Scalar] = {}
    for k, link in enumerate(links):
        drag = drags[k]
        for own, (_, i) in zip(columns[k], link.free, strict=True):
            reach = force_to_move(bodies[k], own.axis.angular, own.axis.linear)
            pull = drag.transposed_times(own.axis)
            rotated = total(
                turned_force(own.axis, forces[k]),
                total(_moved(bodies[k], own.second), drag.times(own.first)),
            )
            sped = total(_moved(bodies[k], own.both), drag.times(own.axis))
            above = k
            while above >= 0:
                for other, (_, j) in zip(columns[above], links[above].free, strict=True):
                    by_q[i, j] = _work(other.second, reach) + dot(pull, other.first.angular)
                    by_v[i, j] = _work(other.both, reach) + dot(pull, other.axis.angular)
                    if above != k:
                        by_q[j, i] = _work(other.axis, rotated)
                        by_v[j, i] = _work(other.axis, sped)
                outer = links[above]
                reach, rotated, sped = (at_parent(outer, f) for f in (reach, rotated, sped))
                above = outer.parent
    return Sensitivity(by_q, by_v)


def coriolis(kinematics: TreeKinematics, twists: Sequence[Twist], scalars: Scalars) -> Entries:
    """The entries of C, by which C v is the velocity force and C + Cᵀ the rate of M; `kinematics`
    and twists are in world axes: C_ij = S_i · (I S_j' + ½ B S_j) with sums over the subtree of the
    axis farther from the root (S. Echeandia and P. Wensing, "Numerical methods to compute the
    Coriolis matrix and Christoffel symbols for rigid-body systems", J. Comput. Nonlinear Dynam. 16,
    2021).
    """
    assert kinematics.axes == "world"
    links, nothing = kinematics.links, zeros(scalars)
    bodies = composite_bodies(kinematics, scalars)
    halves = [
        _Drag(drag.momentum, drag.matrix, scalars.number(1.0))
        for drag in _composite_drags(kinematics, twists, scalars)
    ]
    axes = [
        [
            Twist(axis.direction, nothing) if axis.angular else Twist(nothing, axis.direction)
            for axis, _ in link.free
        ]
        for link in links
    ]
    rates = [
        [_crossed(motion, axis) for axis in own] for motion, own in zip(twists, axes, strict=True)
    ]
    entries: dict[tuple[int, int], Scalar] = {}
    for k, link in enumerate(links):
        for axis, rate, (_, i) in zip(axes[k], rates[k], link.free, strict=True):
            reach = force_to_move(bodies[k], axis.angular, axis.linear)
            pull = halves[k].transposed_times(axis)
            sped = total(_moved(bodies[k], rate), halves[k].times(axis))
            above = k
            while above >= 0:
                outer = links[above]
                for other, slope, (_, j) in zip(axes[above], rates[above], outer.free, strict=True):
                    entries[i, j] = _work(slope, reach) + dot(pull, other.angular)
                    if above != k:
                        entries[j, i] = _work(other, sped)
                reach, sped = at_parent(outer, reach), at_parent(outer, sped)
                above = outer.parent
    return entries


def columns_of(
    kinematics: TreeKinematics,
    k: int,
    twists: Sequence[Twist],
    accelerating: Sequence[Acceleration],
    base: Vec,
    scalars: Scalars,
) -> list[Column]:
    """What each free axis of the joint of link k does, in the axes of `kinematics`."""
    link = kinematics.links[k]
    nothing = zeros(scalars)
    carrier, pushed = Twist(nothing, nothing), Twist(nothing, link.rotation.into(base))
    if link.parent >= 0:
        v, a = twists[link.parent], accelerating[link.parent]
        linear = add(v.linear, cross(v.angular, link.arm))
        carrier = Twist(link.rotation.into(v.angular), link.rotation.into(linear))
        # The spatial acceleration, of a point fixed in space (Featherstone 2008, 2.11).
        reached = add(a.linear, times(a.field, link.arm))
        pushed = Twist(
            link.rotation.into(a.angular),
            link.rotation.into(sub(reached, cross(v.angular, linear))),
        )
    own = Twist(twists[k].angular, twists[k].linear)
    columns = []
    for axis, _ in link.free:
        s = Twist(axis.direction, nothing) if axis.angular else Twist(nothing, axis.direction)
        first = _crossed(carrier, s)
        second = _plus(_crossed(pushed, s), _crossed(carrier, first))
        # v x S = v_p x S for a single axis.
        rate = first if len(link.axes) == 1 else _crossed(own, s)
        columns.append(Column(s, first, second, _plus(first, rate)))
    return columns


@dataclass(frozen=True)
class _Drag:
    """B / 2 of a subtree: its momentum p and its matrix A."""

    momentum: Vec
    matrix: Mat
    two: Scalar

    def times(self, x: Twist) -> Wrench:
        """B x."""
        w = scale(self.two, x.angular)
        return Wrench(times(self.matrix, w), cross(w, self.momentum))

    def transposed_times(self, s: Twist) -> Vec:
        """The angular part of Bᵀ s; the linear part is zero."""
        w, u = scale(self.two, s.angular), scale(self.two, s.linear)
        return add(times(transposed(self.matrix), w), cross(self.momentum, u))


def _composite_drags(
    kinematics: TreeKinematics, twists: Sequence[Twist], scalars: Scalars
) -> list[_Drag]:
    two = scalars.number(2.0)
    found = []
    for link, motion in zip(kinematics.links, twists, strict=True):
        p, matrix = drag_of(link, motion, scalars)
        found.append(_Drag(p, matrix, two))
    for k in reversed(range(len(found))):
        link = kinematics.links[k]
        if link.parent >= 0:
            outer, inner = found[link.parent], found[k]
            moved = plus(inner.matrix, _outer(link.arm, inner.momentum))
            found[link.parent] = _Drag(
                add(outer.momentum, inner.momentum), plus(outer.matrix, moved), two
            )
    return found


def drag_of(link: Link, motion: Twist, scalars: Scalars) -> tuple[Vec, Mat]:
    """The momentum p of a link's own mass, and its matrix A."""
    _, p = momentum_of(link, motion)
    field = product(skew(motion.angular, scalars.number(0.0)), _second_moment(link, scalars))
    return p, plus(_outer(link.rigid.first_moment, motion.linear), _negated(field))


def _second_moment(link: Link, scalars: Scalars) -> Mat:
    """Σ m r rᵀ = ½ tr(J) 1 - J."""
    J = link.rigid.inertia
    half = scalars.number(0.5) * (J[0][0] + J[1][1] + J[2][2])
    return symmetric([half - J[0][0], half - J[1][1], half - J[2][2], -J[0][1], -J[0][2], -J[1][2]])


def _outer(h: Vec, v: Vec) -> Mat:
    """(h·v) 1 - v hᵀ."""
    hv = [h[i] * v[i] for i in AXES]
    a, b, c = (
        tuple(hv[(i + 1) % 3] + hv[(i + 2) % 3] if i == j else -(v[i] * h[j]) for j in AXES)
        for i in AXES
    )
    return ((a[0], a[1], a[2]), (b[0], b[1], b[2]), (c[0], c[1], c[2]))


def _negated(m: Mat) -> Mat:
    a, b, c = ((-row[0], -row[1], -row[2]) for row in m)
    return (a, b, c)


def _plus(a: Twist, b: Twist) -> Twist:
    return Twist(add(a.angular, b.angular), add(a.linear, b.linear))


def _crossed(a: Twist, b: Twist) -> Twist:
    """a x b of motions."""
    return Twist(
        cross(a.angular, b.angular),
        add(cross(a.linear, b.angular), cross(a.angular, b.linear)),
    )


def turned_force(s: Twist, f: Wrench) -> Wrench:
    """s x* f of a motion and a force."""
    return Wrench(
        add(cross(s.angular, f.moment), cross(s.linear, f.force)), cross(s.angular, f.force)
    )


def _moved(body: Rigid, x: Twist) -> Wrench:
    return force_to_move(body, x.angular, x.linear)


def _work(x: Twist, f: Wrench) -> Scalar:
    return dot(x.angular, f.moment) + dot(x.linear, f.force)
