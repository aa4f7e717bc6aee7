"""Exact derivatives on the tape, forward mode."""

from collections.abc import Sequence

from eomgen.program.tape import Node, Step, Tape


def jacobian(outputs: Sequence[Node], inputs: Sequence[Node]) -> list[list[Node]]:
    """∂outputs/∂inputs, as new nodes on the same tape: one row an output."""
    if not outputs:
        return []
    tape = outputs[0].tape
    steps = tuple(tape.steps)
    columns = []
    for x in inputs:
        slopes = _slopes(tape, steps, x.index)
        zero = tape.constant(0.0)
        columns.append([slopes.get(node.index, zero) for node in outputs])
    return [list(row) for row in zip(*columns, strict=True)]


def _slopes(tape: Tape, steps: Sequence[Step], x: int) -> dict[int, Node]:
    """The derivative of every step by one input, where it is not zero."""
    slopes = {x: tape.constant(1.0)}
    for i, step in enumerate(steps):
        if not any(o in slopes for o in step.operands):
            continue
        slopes[i] = _slope(tape, i, step, slopes)
    return slopes


def _slope(tape: Tape, i: int, step: Step, slopes: dict[int, Node]) -> Node:
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
        case "sin":
            return tape.apply("cos", nodes[0]) * d[0]
        case "cos":
            return -(tape.apply("sin", nodes[0]) * d[0])
        case "tan":
            return (tape.constant(1.0) + value * value) * d[0]
        case "sqrt":
            return d[0] / (two * value)
        case other:
            raise AssertionError(f"no derivative is known for {other}")
