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
    slopes = dict(directions)
    for i in _between(tape, outputs, slopes):
        step = tape.steps[i]
        if any(o in slopes for o in step.operands):
            slopes[i] = _slope(tape, i, step, slopes)
    return [slopes.get(node.index, zero) for node in outputs]


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


def _slope(tape: Tape, i: int, step: Step, slopes: Mapping[int, Node]) -> Node:
    zero, two = tape.constant(0.0), tape.constant(2.0)
    value = Node(tape, i)
    nodes = [Node(tape, o) for o in step.operands]
    d = [slopes.get(o, zero) for o in step.operands]
    match step.operation:
        case "add":
            return d[0] + d[1]
        case "sub":
            return d[0] - d[1]
        case "mul":
            if step.operands[0] == step.operands[1]:
                return two * (nodes[0] * d[0])
            return d[0] * nodes[1] + nodes[0] * d[1]
        case "div":
            return (d[0] - value * d[1]) / nodes[1]
        case "neg":
            return -d[0]
        case function:
            changed: Node = slope(function, value, nodes, d, TapeScalars(tape))
            return changed
