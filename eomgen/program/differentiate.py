"""Exact derivatives by forward-mode automatic differentiation on the tape."""

from collections.abc import Collection, Mapping, Sequence

from eomgen.program.scalars import TapeScalars
from eomgen.program.tape import Node, Step, Tape
from eomgen.scalars.functions import slope


def jacobian(outputs: Sequence[Node], inputs: Sequence[Node]) -> list[list[Node]]:
    """The Jacobian ∂outputs/∂inputs as new nodes on the same tape, one row for each output."""
    if not outputs:
        return []
    one = outputs[0].tape.constant(1.0)
    columns = [tangent(outputs, {x.index: one}) for x in inputs]
    return [list(row) for row in zip(*columns, strict=True)] or [[] for _ in outputs]


def tangent(outputs: Sequence[Node], directions: Mapping[int, Node]) -> list[Node]:
    """The directional derivative of each output, as new nodes on the same tape.

    `directions` maps the index of an input's node to the component of the direction along that
    input; other inputs are held constant.
    """
    if not outputs:
        return []
    tape = outputs[0].tape
    zero = tape.constant(0.0)
    slopes = {i: node.index for i, node in directions.items()}
    for i in _between(tape, outputs, slopes):
        step = tape.steps[i]
        if any(o in slopes for o in step[1]):
            slopes[i] = _slope(tape, i, step, slopes)
    return [Node(tape, slopes.get(node.index, zero.index)) for node in outputs]


def substituted(outputs: Sequence[Node], replacements: Mapping[int, Node]) -> list[Node]:
    """The outputs recorded again with some nodes replaced.

    `replacements` maps the index of a node to the node that takes its place.
    """
    if not outputs:
        return []
    tape = outputs[0].tape
    nodes = dict(replacements)
    for i in _between(tape, outputs, replacements):
        step = tape.steps[i]
        if any(o in nodes for o in step.operands):
            operands = [nodes.get(o) or Node(tape, o) for o in step.operands]
            nodes[i] = tape.apply(step.operation, *operands)
    return [nodes.get(node.index) or node for node in outputs]


def _between(tape: Tape, outputs: Sequence[Node], inputs: Collection[int]) -> list[int]:
    """The steps from `inputs`, exclusive, to `outputs`, in order."""
    needed: set[int] = set()
    stack = [node.index for node in outputs]
    while stack:
        i = stack.pop()
        if i not in needed and i not in inputs:
            needed.add(i)
            stack += tape.steps[i].operands
    return sorted(needed)


def _slope(tape: Tape, i: int, step: Step, slopes: Mapping[int, int]) -> int:
    """The slope of step i; a slope of 0 that is not there takes no steps."""
    operation, operands, _, _ = step
    combined, two = tape.combined, tape.number(2.0)
    if operation == "mul":
        a, b = operands
        if a == b:
            return combined("mul", two, combined("mul", a, slopes[a]))
        left = combined("mul", slopes[a], b) if a in slopes else None
        if b not in slopes:
            assert left is not None
            return left
        right = combined("mul", a, slopes[b])
        return right if left is None else combined("add", left, right)
    if operation == "add" or operation == "sub":
        a, b = operands
        if b not in slopes:
            return slopes[a]
        if a in slopes:
            return combined(operation, slopes[a], slopes[b])
        return slopes[b] if operation == "add" else tape.applied("neg", slopes[b])
    d = [slopes[o] if o in slopes else tape.number(0.0) for o in operands]
    if operation == "div":
        return combined("div", combined("sub", d[0], combined("mul", i, d[1])), operands[1])
    if operation == "neg":
        return tape.applied("neg", d[0])
    nodes, slope_nodes = ([Node(tape, k) for k in ks] for ks in (operands, d))
    made: Node = slope(operation, Node(tape, i), nodes, slope_nodes, TapeScalars(tape))
    return made.index
