"""Accelerations of a linearly implicit step: forward dynamics with the resistance of stiff loads.

Semi-implicit Euler with stiff forces linear in the step (Hairer and Wanner, Solving Ordinary
Differential Equations II, IV.7; Baraff and Witkin, "Large steps in cloth simulation", SIGGRAPH 98):

    (M + h D + h² K) a = F - V - G - h K v,     v⁺ = v + h a,     q⁺ = q ⊕ h v⁺

K = Σ k Jᵀ J and D = Σ d Jᵀ J are sums over the resistances of effects, where J v is the speed
along unit loads. What is left out of the exact derivatives is how J turns, and how a force along
one direction depends on motion along another: what remains is symmetric, and not negative. So the
equations have a solution for any h, and the error stays one of order h. Contacts and stops give
the change of their force from here to where the step leads in place of h K v, since they push on
one side only.

On a body a resistance is a 6 x 6 matrix that adds to its inertia, and the sums over subtrees go as
those of composite bodies do (Featherstone 2008, 6.2). Resistances between two bodies have a matrix
beside those of either, which is carried to the body from which both branch off, and fill entries of
the matrix between the branches.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement

from eomgen.dynamics.dynamics import Dynamics
from eomgen.dynamics.loops.range_space import RangeSpace
from eomgen.dynamics.tree import forces as fc
from eomgen.dynamics.tree.composite import Entries, Factors, ancestors, factorised, solved
from eomgen.dynamics.tree.kinematics import Link, MotionAxis
from eomgen.dynamics.tree.loads import power_of, wrench_of
from eomgen.dynamics.tree.vectors import add, cross, dot, scale
from eomgen.scalars.protocol import Scalar
from eomgen.scene.effects.base import JointLoad, Load

Block = list[list[Scalar]]
"""6 x 6, moments before forces, angular before linear motion, in world axes at frames' origins."""

Blocks = dict[tuple[int, int], Block]
"""Blocks of pairs of frames, the later one first."""


@dataclass(frozen=True)
class _Row:
    """A resistance at a state: its wrenches on frames, in world axes, and its forces along free
    velocities; what it adds to the matrix for each unit of Jᵀ J; and its force on the right side.
    """

    wrenches: Mapping[int, fc.Wrench]
    along: tuple[tuple[int, Scalar], ...]
    weight: Scalar
    force: Scalar


def resisted(d: Dynamics, h: Scalar) -> list[Scalar]:
    """The accelerations (nv,) of a step of length h, s; with constraints those that keep them."""
    step = _Step(d, h)
    if d.model.constraints:
        return RangeSpace(d, lambda _: step.accelerations(), step.response).forward(None)
    return step.accelerations()


class _Step:
    """The equations of a step."""

    def __init__(self, d: Dynamics, h: Scalar) -> None:
        self._d, self._links = d, d.in_world.links
        self._rows = list(self._resistances(h))
        self._factors = self._factored()

    def accelerations(self) -> list[Scalar]:
        """a, as if there were no constraints."""
        d, links = self._d, self._links
        right = [force - bias for force, bias in zip(d.applied_force, d.bias(), strict=True)]
        sums = [fc.no_wrench(d.scalars)] * len(links)
        for row in self._rows:
            for k, wrench in row.wrenches.items():
                sums[k] = fc.total(sums[k], _scaled(row.force, wrench))
            for i, force in row.along:
                right[i] = right[i] - row.force * force
        parts = fc.generalised(d.in_world, fc.carried(d.in_world, sums), d.moved)
        return self.response([a - b for a, b in zip(right, parts[: d.nv], strict=True)])

    def response(self, impulse: Sequence[Scalar]) -> list[Scalar]:
        """(M + h D + h² K)⁻¹ f of generalised impulses."""
        return solved(self._factors, impulse)

    def _resistances(self, h: Scalar) -> Iterator[_Row]:
        d = self._d
        for effect in d.model.effects:
            for one in effect.resistances(d, h):
                wrenches: dict[int, fc.Wrench] = {}
                along: list[tuple[int, Scalar]] = []
                for load in one.loads:
                    if isinstance(load, Load):
                        self._add(wrenches, load)
                    else:
                        along += self._free(load)
                stiffness = h * one.stiffness
                force = stiffness
                if one.change is not None:
                    force = -one.change
                elif not d.scalars.is_zero(stiffness):
                    force = stiffness * power_of(d, one.loads)
                yield _Row(wrenches, tuple(along), h * (one.damping + stiffness), force)

    def _free(self, load: JointLoad) -> list[tuple[int, Scalar]]:
        i = self._d.joint_indices[load.joint].v[load.coordinate]
        return [(i, load.force)] if i < self._d.nv else []

    def _add(self, wrenches: dict[int, fc.Wrench], load: Load) -> None:
        k, wrench = wrench_of(self._d, load, self._d.in_world)
        if k >= 0:
            wrenches[k] = fc.total(wrenches[k], wrench) if k in wrenches else wrench

    def _factored(self) -> Factors:
        """The factors of M + h D + h² K, which may have entries between branches of the tree."""
        d = self._d
        depths = list(map(len, ancestors(d.kinematics)))
        order = sorted(range(d.nv), key=lambda i: (-depths[i], i))
        rank = {i: n for n, i in enumerate(order)}
        entries = dict(d.mass_entries)

        def entered(i: int, j: int, value: Scalar) -> None:
            pair = (i, j) if rank[i] <= rank[j] else (j, i)
            entries[pair] = entries[pair] + value if pair in entries else value

        for row in self._rows:
            for n, (i, a) in enumerate(row.along):
                for j, b in row.along[n:]:
                    entered(i, j, row.weight * a * b)
        for stop, blocks in _blocks(self._links, self._rows).items():
            for i, j, value in _between(self._links, blocks, stop):
                entered(i, j, value)
        names = [c.name for c in d.model.velocities]
        return factorised(entries, _filled(entries, order, rank), names, d.scalars, order)


def _filled(
    entries: Entries, order: Sequence[int], rank: Mapping[int, int]
) -> tuple[tuple[int, ...], ...]:
    """For each unknown those after it in the order that it is coupled to, once those before it are
    eliminated. Entries that fill in are put in as zeros by `factorised`.
    """
    found: list[set[int]] = [set() for _ in order]
    for i, j in entries:
        if i != j:
            found[i].add(j)
    for k in order:
        later = sorted(found[k], key=rank.__getitem__)
        for n, i in enumerate(later):
            found[i].update(later[n + 1 :])
    return tuple(tuple(sorted(each, key=rank.__getitem__)) for each in found)


def _blocks(links: Sequence[Link], rows: Sequence[_Row]) -> dict[int, Blocks]:
    """The sums of w wᵀ times the weight of each row, by the frame from which its bodies branch off,
    -1 for the world. That frame and those that carry it do not feel the row.
    """
    found: dict[int, Blocks] = {}
    for row in rows:
        parts = sorted(row.wrenches.items(), reverse=True)
        own = found.setdefault(_common(links, list(row.wrenches)), {})
        for (a, first), (b, second) in combinations_with_replacement(parts, 2):
            left, right = ([*w.moment, *w.force] for w in (first, second))
            weighted = [row.weight * x for x in left]
            block = [[x * y for y in right] for x in weighted]
            _put(own, a, b, _mirrored(block) if a == b else block)
    return found


def _common(links: Sequence[Link], frames: Sequence[int]) -> int:
    """The last frame that carries two frames or is one of them; -1 for a single one."""
    if len(frames) < 2:
        return -1
    a, b = frames
    while a != b:
        a, b = min(a, b), links[max(a, b)].parent
    return a


def _put(blocks: Blocks, a: int, b: int, block: Block) -> None:
    """Add a block of frames a and b."""
    if a < b:
        a, b, block = b, a, _transposed(block)
    blocks[a, b] = _sum(blocks[a, b], block) if (a, b) in blocks else block


def _between(links: Sequence[Link], blocks: Blocks, stop: int) -> Iterator[tuple[int, int, Scalar]]:
    """The entries of Σ sᵀ X s over pairs of free axes of frames that carry the blocks' frames, one
    of the two (i, j) and (j, i) of each. Frames are in order from the leaves to `stop`.
    """
    for a in reversed(range(len(links))):
        for b in reversed(range(a + 1)):
            block = blocks.pop((a, b), None)
            if block is None or stop in (a, b):
                continue
            for n, (axis, i) in enumerate(links[a].free):
                f = [_part(axis, column) for column in _transposed(block)]
                reach, above = fc.Wrench((f[0], f[1], f[2]), (f[3], f[4], f[5])), b
                while above != stop:
                    others = links[above].free
                    for other, j in others[: n + 1] if above == a else others:
                        yield i, j, _part(other, [*reach.moment, *reach.force])
                    reach, above = fc.at_parent(links[above], reach), links[above].parent
            parent = links[a].parent
            if parent == stop:
                continue
            block = _moved(links[a], block)
            if a == b:
                block = _mirrored(_transposed(_moved(links[a], _transposed(block))))
            elif parent == b:
                block = _mirrored(_sum(block, _transposed(block)))
            _put(blocks, parent, parent if a == b else b, block)


def _part(axis: MotionAxis, six: Sequence[Scalar]) -> Scalar:
    """sᵀ x of six numbers."""
    x = six[:3] if axis.angular else six[3:]
    return dot(axis.direction, (x[0], x[1], x[2]))


def _moved(link: Link, block: Block) -> Block:
    """A block whose rows are wrenches at a link's origin, as at its parent's: n + r x f."""
    columns = []
    for column in _transposed(block):
        force = (column[3], column[4], column[5])
        moment = add((column[0], column[1], column[2]), cross(link.arm, force))
        columns.append([*moment, *force])
    return _transposed(columns)


def _mirrored(block: Block) -> Block:
    """A symmetric block by its upper triangle."""
    return [[block[min(i, j)][max(i, j)] for j in range(6)] for i in range(6)]


def _transposed(block: Block) -> Block:
    return [list(column) for column in zip(*block, strict=True)]


def _sum(a: Block, b: Block) -> Block:
    return [[x + y for x, y in zip(*rows, strict=True)] for rows in zip(a, b, strict=True)]


def _scaled(k: Scalar, f: fc.Wrench) -> fc.Wrench:
    return fc.Wrench(scale(k, f.moment), scale(k, f.force))
