"""Dependent coordinates and velocities of a recorded tree put in as functions of the others.

Cosines and sines of dependent angles, and of sums of angles with them, are those of the polygons
that determine them: no arc tangent is taken where nothing but these is used.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from eomgen.dynamics.dynamics import Dynamics
from eomgen.dynamics.loops.dependent_coordinates import Turn, angle_of, from_middle, solved
from eomgen.dynamics.loops.dyads import Arrow, turned, turned_back
from eomgen.program.differentiate import substituted
from eomgen.program.scalars import TapeScalars
from eomgen.program.tape import Node, Tape
from eomgen.scalars import exact

Sum = dict[int, float]
"""A sum of steps with factors, by their indices; under -1 a number."""
NUMBER = -1


@dataclass
class Following:
    """Nodes in place of the inputs that follow from others.

    inputs   indices of the inputs that follow
    margins  by the names of angles that follow, how far each is from where it jumps: 1 in the
             middle of its range, 0 at the ends
    """

    tape: Tape
    inputs: set[int]
    margins: dict[str, Node] = field(default_factory=dict)
    _nodes: dict[int, Node] = field(default_factory=dict)
    _turns: list[tuple[int, Sum, Arrow]] = field(default_factory=list)
    _open: list[int] = field(default_factory=list)
    _scanned: int = 0

    def put(self, given: Node, value: Node) -> None:
        """Let an input be a value, which is of inputs that do not follow, or of those before."""
        (self._nodes[given.index],) = self.of([value])

    def put_turn(self, coordinate: Node, angle: Node, direction: Arrow) -> None:
        """Let an angle, a sum with one new coordinate, have a direction."""
        x, y = self.of(direction)
        self._turns.append((coordinate.index, self._sum(angle.index), (x, y)))
        self._open = [i for i in self._open if not self._turned(i)]

    def of(self, nodes: Sequence[Node]) -> list[Node]:
        """Nodes without inputs that follow."""
        steps = self.tape.steps
        while self._scanned < len(steps):
            i, self._scanned = self._scanned, self._scanned + 1
            if steps[i].operation in ("cos", "sin") and not self._turned(i):
                self._open.append(i)
        return substituted(nodes, self._nodes)

    def _turned(self, i: int) -> bool:
        """Whether a cosine or a sine is one of a known direction, which it is replaced by."""
        operation, (angle, *_), *_ = self.tape.steps[i]
        direction = self._direction(self._sum(angle))
        if direction is not None:
            self._nodes[i] = direction[operation == "sin"]
        return direction is not None

    def _direction(self, angle: Sum) -> Arrow | None:
        """The cosine and sine of a sum of angles that follow; None if it has none, or others."""
        if not self.inputs & set(angle):
            return None
        found: Arrow | None = None
        rest = dict(angle)
        for own, known, direction in reversed(self._turns):
            times = rest.get(own, 0.0)
            if abs(times) != 1.0:
                continue
            for i, factor in known.items():
                rest[i] = rest.get(i, 0.0) - times * factor
            if found is None:
                found = direction if times > 0 else (direction[0], -direction[1])
            else:
                found = (turned if times > 0 else turned_back)(direction, found)
        rest = {i: factor for i, factor in rest.items() if factor}
        if found is None or self.inputs & set(rest):
            return None
        return turned(self._cosine_and_sine(rest), found) if rest else found

    def _cosine_and_sine(self, angle: Sum) -> Arrow:
        node = self.tape.constant(angle.get(NUMBER, 0.0))
        for i, factor in angle.items():
            if i == NUMBER:
                continue
            term = Node(self.tape, i)
            node = node + term if factor == 1.0 else node + self.tape.constant(factor) * term
        scalars = TapeScalars(self.tape)
        return scalars.call("cos", node), scalars.call("sin", node)

    def _sum(self, index: int) -> Sum:
        """A node as a sum."""
        found: Sum = {}
        stack = [(index, 1.0)]
        while stack:
            i, factor = stack.pop()
            step = self.tape.steps[i]
            value = self.tape.values.get(i)
            if value is not None:
                found[NUMBER] = found.get(NUMBER, 0.0) + factor * value
            elif step.operation == "neg":
                stack.append((step.operands[0], -factor))
            elif step.operation in ("add", "sub"):
                left, right = step.operands
                stack += [(right, factor if step.operation == "add" else -factor), (left, factor)]
            else:
                found[i] = found.get(i, 0.0) + factor
        return {i: factor for i, factor in found.items() if factor}


def positions(d: Dynamics, q: Sequence[Node], tape: Tape) -> Following:
    """The coordinates of a mechanism's groups by the others; `q` are the inputs, of all."""
    followed = [i for group in d.model.groups for i in group.coordinates]
    following = Following(tape, {q[i].index for i in followed})
    for group in d.model.groups:
        found = solved(d, group)
        for i, value, cut in zip(group.coordinates, found, group.cuts, strict=True):
            if isinstance(value, Turn):
                assert cut is not None
                angle = d.in_world.angles[value.frame]
                _, rest = exact.quarters(angle.fixed)
                whole = angle.moving + d.scalars.number(rest)
                following.put_turn(q[i], whole, value.direction)
                half, (x, _) = tape.constant(0.5), from_middle(d, value, cut)
                following.margins[d.model.coordinates[i].name] = half + half * x
                value = angle_of(d, value, cut)
            following.put(q[i], value)
    return following
