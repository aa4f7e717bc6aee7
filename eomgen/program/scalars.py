"""The tape's nodes as the abstract scalars of formulas and recursions."""

from eomgen.program.tape import ExactTape, Node, Tape
from eomgen.scalars.exact import Real, in_doubles
from eomgen.scalars.protocol import Scalars


class TapeScalars(Scalars):
    """The operations on nodes of a tape that formulas and recursions need."""

    def __init__(self, tape: Tape) -> None:
        self._tape = tape
        self._exact = isinstance(tape, ExactTape)

    def number(self, value: Real) -> Node:
        """A constant, rounded to a double; on an exact tape a sum of doubles that equals it."""
        first, *others = in_doubles(value) if self._exact else (float(value),)
        node = self._tape.constant(first)
        for part in others:
            node = node + self._tape.constant(part)
        return node

    def call(self, function: str, *arguments: Node) -> Node:
        """A function of formulas."""
        return self._tape.apply(function, *arguments)

    def is_zero(self, value: Node) -> bool:
        """Whether a node is the constant 0."""
        return self._tape.values.get(value.index) == 0.0

    def named(self, value: Node, name: str) -> Node:
        """The same node. Suggests a name unless it is an input, a constant or a negation."""
        if value.step.operation not in ("input", "constant", "neg"):
            self._tape.named(value, name)
        return value
