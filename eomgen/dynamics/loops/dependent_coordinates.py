"""Dependent coordinates of planar loops in closed form, over any scalars.

A loop is a polygon with two unknown coordinates: angles of bars, or lengths along guides. Where it
is closed by a pin its two ends are one point; where it is closed by a slider one direction is
known, and one distance. `dyads` solves each kind of polygon. What is found of an angle is its
cosine and sine: these are what equations of motion take.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from eomgen.dynamics.loops import dyads
from eomgen.dynamics.loops.dyads import Arrow, along, minus, opposite, plus, turned, turned_back
from eomgen.dynamics.tree.frames import Frame
from eomgen.dynamics.tree.kinematics import still_rotation
from eomgen.dynamics.tree.mechanism_state import MechanismState
from eomgen.dynamics.tree.vectors import Vec, add, constant, in_space, times, unit, zeros
from eomgen.model.groups import Group
from eomgen.scalars import exact
from eomgen.scalars.protocol import Scalar
from eomgen.scene.constraints.base import Bar, Given, Pair
from eomgen.scene.joints import Prismatic, Revolute
from eomgen.scene.joints.base import WORLD


@dataclass(frozen=True)
class Turn:
    """The cosine and sine of the sum of the angles from the world to a frame, and of the part of
    its fixed angle that is no quarter turn.
    """

    frame: int
    direction: Arrow


@dataclass(frozen=True)
class _Bar:
    """A vector that turns with an unknown frame, in its axes."""

    frame: int
    arm: Arrow


@dataclass(frozen=True)
class _Guide:
    """A length along a known unit vector of the world."""

    frame: int
    line: Arrow


@dataclass(frozen=True)
class _Guided:
    """A vector that turns with an unknown frame, and whose end moves along a unit vector of it by
    the length of an unknown guide.
    """

    frame: int
    arm: Arrow
    guide: int
    line: Arrow


_Term = _Bar | _Guide | _Guided
_Side = tuple[Arrow, list[_Term]]
"""A point: the known part of its position, and the unknown ones."""


def solved(d: MechanismState, group: Group) -> list[Turn | Scalar]:
    """What a group determines at a state whose coordinates before the group are known: for each of
    its coordinates the direction of its frame, or its value.
    """
    constraint = next(c for c in d.model.constraints if c.name == group.constraint)
    part = constraint.loop_part()
    if isinstance(part, Given):
        return [d.value(part.equals)]
    assert part is not None
    return _Polygon(d, group).solved(part)


def angle_of(d: MechanismState, turn: Turn, cut: tuple[int, int]) -> Scalar:
    """The coordinate of a frame whose direction is known, rad: an angle from that of another frame,
    less the angles of the frames before it. See `Group.cuts`.
    """
    (reference, quarters), angles, scalars = cut, d.in_world.angles, d.scalars
    x, y = from_middle(d, turn, cut)
    _, rest = exact.quarters(angles[turn.frame].fixed)
    whole = scalars.number(exact.quarter_turns(quarters, exact.opposite(rest)))
    whole = whole + scalars.call("atan2", y, x)
    if reference >= 0:
        whole = whole + angles[reference].moving
    parent = d.linkage.frames[turn.frame].parent
    return whole - angles[parent].moving if parent >= 0 else whole


def from_middle(d: MechanismState, turn: Turn, cut: tuple[int, int]) -> Arrow:
    """A direction from the middle of the range in which its angle is counted: (-1, 0) where the
    angle jumps.
    """
    (reference, quarters), (x, y) = cut, turn.direction
    if reference >= 0:
        base = d.in_world.angles[reference].moving
        x, y = turned_back((d.scalars.call("cos", base), d.scalars.call("sin", base)), (x, y))
    return ((x, y), (y, -x), (-x, -y), (-y, x))[quarters % 4]


class _Polygon:
    """A group at a state of its mechanism."""

    def __init__(self, d: MechanismState, group: Group) -> None:
        self._d, self._scalars, self._branch = d, d.scalars, group.branch
        self._frames = d.linkage.frames
        self._own = d.in_own_axes.links
        self._unknown = [
            k for i in group.coordinates for k, f in enumerate(self._frames) if i in f.q
        ]

    def solved(self, part: Bar | Pair) -> list[Turn | Scalar]:
        """What the group determines, in the order of its coordinates."""
        if isinstance(part, Bar):
            found = self._rod(part)
        else:
            found = (self._slider if part.slides else self._pin)(part.joint)
        return [found[k] for k in self._unknown]

    # Polygons.

    def _pin(self, joint: Revolute) -> dict[int, Turn | Scalar]:
        """Two ends are one point."""
        d, terms = self._gap(*self._joint_ends(joint))
        scalars, branch = self._scalars, self._branch
        match terms:
            case [_Bar(arm=a) as first, _Bar(arm=b) as second]:
                w = dyads.triangle(d, along(a, a), along(b, b), branch, scalars)
                return self._turns((first, w), (second, minus(d, w)))
            case [_Guide(k, line), _Bar(arm=a) as bar]:
                s, w = dyads.reach(d, line, along(a, a), branch, scalars)
                return {k: s, **self._turns((bar, w))}
            case [_Guide(k, line), _Guide(n, other)]:
                s, r = dyads.parts(d, line, other)
                return {k: s, n: r}
            case [_Guided(frame, arm, guide, line)]:
                square = along(d, d)
                s, w = dyads.reach(opposite(arm), line, square, branch, scalars)
                whole = opposite(w)
                u = dyads.between(whole, d, square, scalars)
                return {guide: s, frame: self._turn(frame, u)}
        raise AssertionError(f"no polygon: {terms}")

    def _rod(self, rod: Bar) -> dict[int, Turn | Scalar]:
        """Two ends keep their distance."""
        first, second = (self._at(body, [self._d.value(x) for x in at]) for body, at in rod.ends)
        d, terms = self._gap(first, second)
        length = self._d.value(rod.length)
        square = length * length
        match terms:
            case [_Bar(arm=a) as bar]:
                w = dyads.triangle(d, along(a, a), square, self._branch, self._scalars)
                return self._turns((bar, w))
            case [_Guide(k, line)]:
                return {k: dyads.reach(d, line, square, self._branch, self._scalars)[0]}
        raise AssertionError(f"no polygon: {terms}")

    def _slider(self, joint: Prismatic) -> dict[int, Turn | Scalar]:
        """Two bodies keep their angle, and a point of one is on a line of the other."""
        parent, child = self._joint_ends(joint)
        a, b = parent[0], child[0]
        line, same = self._direction(joint.parent, joint), self._direction(joint.child, joint)
        turning = [k for k in self._unknown if self._frames[k].kind == "revolute"]
        at_parent = [k for k in turning if k in self._path(a)]
        if len(turning) == 2 and len(at_parent) == 1:
            swings = at_parent[0], next(k for k in turning if k not in at_parent)
            return self._swinging(swings, parent, child, line, same)
        # The direction of the other side is known, and gives that of the last unknown frame.
        last = max(turning, key=lambda k: len(self._path(k)))
        if at_parent:
            u = turned_back(turned(self._relative(last, a), line), turned(self._of(b), same))
            line = turned(u, turned(self._relative(last, a), line))
        else:
            line = turned(self._of(a), line)
            u = turned_back(turned(self._relative(last, b), same), line)
        normal = -line[1], line[0]
        known = {last: self._turn(last, u)}
        d, terms = self._gap(parent, child)
        rest: list[_Bar | _Guide] = []
        for term in terms:
            if isinstance(term, _Guide) or term.frame != last:
                assert not isinstance(term, _Guided)
                rest.append(term)
                continue
            d = minus(d, turned(u, term.arm))
            if isinstance(term, _Guided):
                rest.append(_Guide(term.guide, turned(u, term.line)))
        h = along(normal, d)
        match rest:
            case [_Bar(arm=arm) as bar]:
                w = dyads.leaning(normal, h, along(arm, arm), self._branch, self._scalars)
                return {**known, **self._turns((bar, w))}
            case [_Guide(k, guide)]:
                return {**known, k: h / along(normal, guide)}
        raise AssertionError(f"no polygon: {terms}")

    def _swinging(
        self,
        swings: tuple[int, int],
        parent: tuple[int, Vec],
        child: tuple[int, Vec],
        line: Arrow,
        same: Arrow,
    ) -> dict[int, Turn | Scalar]:
        """A slider between two bars that both turn: a point is at a known distance of a line
        through another, as in a crank shaper.
        """
        i, j = swings
        d, terms = self._gap(parent, child)
        arms = {t.frame: t.arm for t in terms if isinstance(t, _Bar)}
        line = turned(self._relative(i, parent[0]), line)
        # In the axes of frame i frame j is turned by `twist`.
        twist = turned_back(turned(self._relative(j, child[0]), same), line)
        normal = -line[1], line[0]
        h = along(normal, plus(arms[i], turned(twist, arms[j])))
        square = along(d, d)
        # d in the axes of the normal.
        there = h, dyads.root(square - h * h, self._branch, self._scalars)
        u = turned_back(normal, dyads.between(there, d, square, self._scalars))
        return {i: self._turn(i, u), j: self._turn(j, turned(twist, u))}

    # Results.

    def _turns(self, *pairs: tuple[_Bar, Arrow]) -> dict[int, Turn | Scalar]:
        """The directions of bars from their vectors in the world."""
        found: dict[int, Turn | Scalar] = {}
        for bar, w in pairs:
            u = dyads.between(bar.arm, w, along(bar.arm, bar.arm), self._scalars)
            found[bar.frame] = self._turn(bar.frame, u)
        return found

    def _turn(self, frame: int, u: Arrow) -> Turn:
        """A frame's direction without the quarter turns of the fixed part of its angle."""
        count, _ = exact.quarters(self._d.in_world.angles[frame].fixed)
        x, y = u
        return Turn(frame, ((x, y), (y, -x), (-x, -y), (-y, x))[count % 4])

    # Vectors.

    def _joint_ends(self, joint: Prismatic | Revolute) -> tuple[tuple[int, Vec], tuple[int, Vec]]:
        value = self._d.value
        return (
            self._at(joint.parent, [value(x) for x in joint.r_parent]),
            self._at(joint.child, [value(x) for x in joint.r_child]),
        )

    def _at(self, body: str, r: Sequence[Scalar]) -> tuple[int, Vec]:
        """A point of a body, from its centre of mass: its frame, and where in its axes."""
        own = in_space(list(r), self._scalars)
        if body == WORLD:
            return -1, own
        mount = self._d.linkage.mounts[self._d.index[body]]
        return mount.frame, add(mount.at, times(constant(mount.axes, self._scalars), own))

    def _direction(self, body: str, joint: Prismatic) -> Arrow:
        """The line of a slider in the axes of a body's frame."""
        line = exact.direction((*joint.axis[:2], 0.0))
        if body == joint.parent:
            line = exact.image(exact.orientation(joint.orientation_deg), line)
        if body != WORLD:
            line = exact.image(self._d.linkage.mounts[self._d.index[body]].axes, line)
        return self._scalars.number(line[0]), self._scalars.number(line[1])

    def _path(self, frame: int) -> list[int]:
        """The frames from the world to one."""
        found: list[int] = []
        while frame >= 0:
            found.append(frame)
            frame = self._frames[frame].parent
        return found[::-1]

    def _of(self, frame: int) -> Arrow:
        """The direction of a known frame."""
        if frame < 0:
            return self._scalars.number(1.0), self._scalars.number(0.0)
        world = self._d.in_world.world[frame]
        return world[0][0], world[1][0]

    def _relative(self, base: int, frame: int) -> Arrow:
        """The direction of a frame beyond another in the axes of that."""
        return _flat(self._swung(base, frame, unit(0, self._scalars)))

    def _swung(self, base: int, frame: int, a: Vec) -> Vec:
        """A vector of a frame in the axes of one before it."""
        while frame != base:
            a = self._own[frame].rotation.out(a)
            frame = self._frames[frame].parent
        return a

    def _arm(self, base: int, frame: int, a: Vec) -> Vec:
        """A point of a frame from the origin of one before it, in the axes of that."""
        while frame != base:
            arm = self._own[frame].arm
            if frame in self._unknown:  # a guide, at its zero
                arm = self._frames[frame].offset
            a = add(arm, self._own[frame].rotation.out(a))
            frame = self._frames[frame].parent
        return a

    def _origin(self, frame: int) -> Arrow:
        """The origin of a frame in the world, of a guide at its zero."""
        f, base = self._frames[frame], self._frames[frame].parent
        where = self._d.origins[base] if base >= 0 else zeros(self._scalars)
        return _flat(add(where, self._out(base, f.offset)))

    def _out(self, frame: int, a: Vec) -> Vec:
        """A vector of a known frame in the world."""
        return times(self._d.in_world.world[frame], a) if frame >= 0 else a

    def _line(self, frame: int) -> Vec:
        """The direction of a guide in the axes of its parent."""
        f: Frame = self._frames[frame]
        return still_rotation(f, self._scalars).out(unit(f.axis, self._scalars))

    def _side(self, frame: int, at: Vec) -> _Side:
        """A point of a frame."""
        path = self._path(frame)
        unknown = [k for k in path if k in self._unknown]
        if not unknown:
            where = self._d.origins[frame] if frame >= 0 else zeros(self._scalars)
            return _flat(add(where, self._out(frame, at))), []
        first, terms = unknown[0], list[_Term]()
        base = self._origin(first)
        ends = [(first, frame, at)]
        if len(unknown) == 2:
            second = unknown[1]
            f = self._frames[second]
            if f.kind == "prismatic" and self._frames[first].kind == "revolute":
                arm = self._arm(first, frame, at)
                line = self._swung(first, f.parent, self._line(second))
                return base, [_Guided(first, _flat(arm), second, _flat(line))]
            ends = [(first, f.parent, f.offset), (second, frame, at)]
        for k, end, point in ends:
            arm = self._arm(k, end, point)
            if self._frames[k].kind == "revolute":
                terms.append(_Bar(k, _flat(arm)))
            else:
                line = self._out(self._frames[k].parent, self._line(k))
                terms.append(_Guide(k, _flat(line)))
                base = plus(base, _flat(self._out(k, arm)))
        return base, terms

    def _gap(self, parent: tuple[int, Vec], child: tuple[int, Vec]) -> _Side:
        """What is to be added to the known part of the child's end to reach the parent's, and the
        terms that add up to it, guides first.
        """
        (start, own), (end, others) = self._side(*child), self._side(*parent)
        terms = [*own, *map(_reversed, others)]
        return minus(end, start), sorted(terms, key=lambda term: not isinstance(term, _Guide))


def _reversed(term: _Term) -> _Term:
    match term:
        case _Bar(frame, arm):
            return _Bar(frame, opposite(arm))
        case _Guide(frame, line):
            return _Guide(frame, opposite(line))
        case _Guided(frame, arm, guide, line):
            return _Guided(frame, opposite(arm), guide, opposite(line))


def _flat(a: Vec) -> Arrow:
    return a[0], a[1]
