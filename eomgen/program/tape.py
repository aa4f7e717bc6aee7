"""The tape: straight-line arithmetic with hash-consing and constant folding.

A `Node` is an abstract scalar: it adds, subtracts, multiplies, divides, and has sin, cos, sqrt.
Equal operations share one step, constants fold, 0·x and 1·x are simplified, and minus signs move
outwards until an addition or subtraction absorbs them. No expression tree is ever built.
"""

import math
import operator
from collections.abc import Callable, Sequence
from enum import IntEnum
from fractions import Fraction
from typing import Any, NamedTuple

from eomgen.scalars.functions import BY_MATH

TIME = "t"
"""The name of the input that is time; a scene cannot use it."""


class Stage(IntEnum):
    """What a step depends on; a step depends on nothing of a later stage."""

    CONSTANT = 0
    PARAMETERS = 1
    POSITIONS = 2
    VELOCITIES = 3
    INPUTS = 4


FUNCTIONS: dict[str, Callable[..., float]] = dict(BY_MATH)
"""The functions of formulas; each is one operation."""
ARITHMETIC: dict[str, Callable[[Any, Any], Any]] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "div": operator.truediv,
}
_SIMPLIFYING = frozenset(("constant", "neg", "div"))
"""Operations whose results the folding rules of arithmetic look at."""
COUNTED = (*ARITHMETIC, "neg", *FUNCTIONS)
"""Operations that count towards the cost, one each."""


class Step(NamedTuple):
    """One operation on earlier steps. `value` is a constant's number or an input's name."""

    operation: str
    operands: tuple[int, ...]
    stage: Stage
    value: float | str | None = None


class Node:
    """A scalar on a tape, written with + - * / and unary minus."""

    __slots__ = ("index", "tape")

    def __init__(self, tape: "Tape", index: int) -> None:
        self.tape = tape
        self.index = index

    @property
    def step(self) -> Step:
        """The step that computes this node."""
        return self.tape.steps[self.index]

    def __add__(self, other: "Node") -> "Node":
        tape = self.tape
        return Node(tape, tape.combined("add", self.index, other.index))

    def __sub__(self, other: "Node") -> "Node":
        tape = self.tape
        return Node(tape, tape.combined("sub", self.index, other.index))

    def __mul__(self, other: "Node") -> "Node":
        tape = self.tape
        return Node(tape, tape.combined("mul", self.index, other.index))

    def __truediv__(self, other: "Node") -> "Node":
        tape = self.tape
        return Node(tape, tape.combined("div", self.index, other.index))

    def __neg__(self) -> "Node":
        return Node(self.tape, self.tape.applied("neg", self.index))


class Tape:
    """Steps in order; grows only through `constant`, `input` and `apply`."""

    def __init__(self) -> None:
        self.steps: list[Step] = []
        self.names: dict[int, str] = {}
        self.values: dict[int, float] = {}
        """The value of each step that is a constant."""
        self.minus: dict[int, int] = {}
        """The operand of each step that is a negation."""
        self._simplifying: set[int] = set()
        """Steps of which arithmetic may be simplified: these, and quotients by parameters."""
        self._known: dict[tuple[Any, ...], int] = {}

    @classmethod
    def continued(cls, steps: Sequence[Step]) -> "Tape":
        """A tape on which these steps are recorded, each at its place."""
        tape = cls()
        tape.steps = list(steps)
        for index, (operation, operands, _, value) in enumerate(steps):
            key = (operation, *operands) if operands else (operation, value)
            tape._known.setdefault(key, index)
            if operation in _SIMPLIFYING:
                tape._note(index)
        return tape

    def _add(self, key: tuple[Any, ...], step: Step) -> int:
        """Append a new step and return its index."""
        index = self._known[key] = len(self.steps)
        self.steps.append(step)
        if step[0] in _SIMPLIFYING:
            self._note(index)
        return index

    def _note(self, index: int) -> None:
        """Note a constant, a negation or a quotient by parameters."""
        operation, operands, _, value = self.steps[index]
        if operation == "constant":
            self.values[index] = float(value or 0.0)
        elif operation == "neg":
            self.minus[index] = operands[0]
        elif self.steps[operands[1]][2] != Stage.PARAMETERS:
            return
        self._simplifying.add(index)

    def number(self, value: float) -> int:
        """The step of a constant."""
        number = float(value) + 0.0
        index = self._known.get(("constant", number))
        if index is None:
            step = Step("constant", (), Stage.CONSTANT, number)
            index = self._add(("constant", number), step)
        return index

    def constant(self, value: float) -> Node:
        """The node of a constant."""
        return Node(self, self.number(value))

    def input(self, name: str, stage: Stage) -> Node:
        """The node of a quantity that is given by name at run time."""
        key = ("input", name)
        index = self._known.get(key)
        if index is None:
            index = self._add(key, Step("input", (), stage, name))
        return Node(self, index)

    def named(self, node: Node, name: str) -> Node:
        """Suggest a variable name for a node; a later suggestion does not replace the first."""
        self.names.setdefault(node.index, name)
        return node

    def apply(self, operation: str, *nodes: Node) -> Node:
        """The node of an operation on nodes, simplified if a folding rule applies."""
        return Node(self, self.applied(operation, *[node.index for node in nodes]))

    def applied(self, operation: str, *operands: int) -> int:
        """The step of an operation on steps, simplified if a folding rule applies."""
        if operation in ARITHMETIC:
            return self.combined(operation, *operands)
        fold = _FOLD.get(operation)
        if fold is not None:
            folded = fold(self, *operands)
            if folded is not None:
                return folded
        if operation in FUNCTIONS:
            values = [self.values.get(i) for i in operands]
            number = None if None in values else self.folded(FUNCTIONS[operation], *values)
            if number is not None:
                return self.number(number)
        key = (operation, *operands)
        index = self._known.get(key)
        if index is None:
            steps = self.steps
            stage = max([steps[i][2] for i in operands])
            index = self._add(key, Step(operation, operands, stage))
        return index

    def combined(self, operation: str, a: int, b: int) -> int:
        """The same of one of the operations of `ARITHMETIC`."""
        simplifying = self._simplifying
        if a in simplifying or b in simplifying or a == b:
            folded = _FOLD[operation](self, a, b)
            if folded is not None:
                return folded
        if a > b and (operation == "add" or operation == "mul"):
            a, b = b, a
        key = (operation, a, b)
        index = self._known.get(key)
        if index is None:
            steps = self.steps
            stage, other = steps[a][2], steps[b][2]
            index = self._add(key, Step(operation, (a, b), stage if stage >= other else other))
        return index

    def folded(self, function: Callable[..., float], *values: float | None) -> float | None:
        """The value of a function of constants; None if it is not finite.

        Then the operation is recorded, and the error appears at run time.
        """
        try:
            value = function(*values)
        except (ArithmeticError, ValueError):
            return None
        return value if math.isfinite(value) else None


class ExactTape(Tape):
    """A tape that folds constants only where the result needs no rounding.

    A program recorded on it and run in extended precision uses exactly the numbers of the scene.
    """

    def folded(self, function: Callable[..., float], *values: float | None) -> float | None:
        """A sum, difference, product or quotient that is exactly a double; else None."""
        number = super().folded(function, *values)
        if number is None or function not in ARITHMETIC.values():
            return None
        return number if function(*map(Fraction, values)) == number else None  # type: ignore[arg-type]


def _folded(tape: Tape, operation: str, a: float, b: float) -> int | None:
    number = tape.folded(ARITHMETIC[operation], a, b)
    return None if number is None else tape.number(number)


# Folding rules: each returns the step that an operation simplifies to, or None.


def _fold_add(tape: Tape, a: int, b: int) -> int | None:
    va, vb = tape.values.get(a), tape.values.get(b)
    if va is not None and vb is not None:
        return _folded(tape, "add", va, vb)
    if va == 0.0:
        return b
    if vb == 0.0:
        return a
    minus_a, minus_b = tape.minus.get(a), tape.minus.get(b)
    if minus_b is not None:
        return tape.applied("sub", a, minus_b)
    if minus_a is not None:
        return tape.applied("sub", b, minus_a)
    return None


def _fold_sub(tape: Tape, a: int, b: int) -> int | None:
    va, vb = tape.values.get(a), tape.values.get(b)
    if va is not None and vb is not None:
        return _folded(tape, "sub", va, vb)
    if vb == 0.0:
        return a
    if va == 0.0:
        return tape.applied("neg", b)
    if a == b:
        return tape.number(0.0)
    minus_a, minus_b = tape.minus.get(a), tape.minus.get(b)
    if minus_b is not None:
        return tape.applied("add", a, minus_b)
    if minus_a is not None:
        return tape.applied("neg", tape.applied("add", minus_a, b))
    return None


def _fold_mul(tape: Tape, a: int, b: int) -> int | None:
    va, vb = tape.values.get(a), tape.values.get(b)
    if va is not None and vb is not None:
        return _folded(tape, "mul", va, vb)
    if va is not None or vb is not None:
        value, other = (va, b) if va is not None else (vb, a)
        if value == 0.0:
            return tape.number(0.0)
        if value == 1.0:
            return other
        if value is not None and value < 0.0:
            return tape.applied("neg", tape.applied("mul", tape.number(-value), other))
    minus_a, minus_b = tape.minus.get(a), tape.minus.get(b)
    if minus_a is not None:
        return tape.applied("neg", tape.applied("mul", minus_a, b))
    if minus_b is not None:
        return tape.applied("neg", tape.applied("mul", minus_b, a))
    for quotient, factor in ((a, b), (b, a)):  # (x / k) k, k of parameters
        step = tape.steps[quotient]
        if (
            step.operation == "div"
            and step.operands[1] == factor
            and tape.steps[factor].stage == Stage.PARAMETERS
        ):
            return step.operands[0]
    return None


def _fold_div(tape: Tape, a: int, b: int) -> int | None:
    va, vb = tape.values.get(a), tape.values.get(b)
    if va is not None and vb is not None:
        return _folded(tape, "div", va, vb)
    if va == 0.0:
        return tape.number(0.0)
    if vb == 1.0:
        return a
    if vb is not None and vb < 0.0:
        return tape.applied("neg", tape.applied("div", a, tape.number(-vb)))
    if va is not None and va < 0.0:
        return tape.applied("neg", tape.applied("div", tape.number(-va), b))
    minus_a, minus_b = tape.minus.get(a), tape.minus.get(b)
    if minus_a is not None:
        return tape.applied("neg", tape.applied("div", minus_a, b))
    if minus_b is not None:
        return tape.applied("neg", tape.applied("div", a, minus_b))
    return None


def _fold_neg(tape: Tape, a: int) -> int | None:
    value, minus = tape.values.get(a), tape.minus.get(a)
    if value is not None:
        return tape.number(-value)
    if minus is not None:
        return minus
    operation, operands, _, _ = tape.steps[a]
    if operation == "sub":
        return tape.applied("sub", operands[1], operands[0])
    return None


def _fold_sin(tape: Tape, a: int) -> int | None:
    minus = tape.minus.get(a)
    return None if minus is None else tape.applied("neg", tape.applied("sin", minus))


def _fold_cos(tape: Tape, a: int) -> int | None:
    minus = tape.minus.get(a)
    return None if minus is None else tape.applied("cos", minus)


_FOLD: dict[str, Callable[..., int | None]] = {
    "add": _fold_add,
    "sub": _fold_sub,
    "mul": _fold_mul,
    "div": _fold_div,
    "neg": _fold_neg,
    "sin": _fold_sin,
    "cos": _fold_cos,
}


def power(node: Node, exponent: int) -> Node:
    """A node to an integer power >= 1, by repeated squaring."""
    result: Node | None = None
    square = node
    while exponent:
        if exponent & 1:
            result = square if result is None else result * square
        exponent >>= 1
        if exponent:
            square = square * square
    assert result is not None
    return result


def total(nodes: Sequence[Node], tape: Tape) -> Node:
    """The sum of nodes, from left to right; 0 for none."""
    result = tape.constant(0.0)
    for node in nodes:
        result = result + node
    return result
