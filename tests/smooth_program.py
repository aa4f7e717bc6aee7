"""A program with all operations and functions that have a series, and where to evaluate it."""

from eomgen.program.program import Output, Program, finish
from eomgen.program.tape import TIME, Node, Stage, Tape

STATES = ("a", "b", "c", "d")
START = {"a": 0.3, "b": -0.4, "c": 0.7, "d": 1.2}
VALUES = {"p": 1.3, "u": -0.6}


def everything() -> Program:
    """A program with all operations and functions that have a series, in several uses."""
    tape = Tape()
    t, u = tape.input(TIME, Stage.INPUTS), tape.input("u", Stage.INPUTS)
    p = tape.input("p", Stage.PARAMETERS)
    a, b, c, d = (tape.input(name, Stage.POSITIONS) for name in STATES)
    two = tape.constant(2.0)

    def of(function: str, *nodes: Node) -> Node:
        return tape.apply(function, *nodes)

    both = of("sin", a * t) * of("cos", a * t) + of("sin", b) - of("cos", d) * p
    arcs = of("asin", a) + of("acos", b) - of("atan", c) + of("atan2", b, d) - of("atan2", a, p)
    mixed = (of("exp", a * b) - of("log", d) * u) / (d * d + p)
    steep = of("tan", b) + of("tanh", c) * of("sqrt", d) / p - p / d + of("atan2", u, c)
    rates = [both - mixed, arcs * c, steep - both * both, -(mixed * t) + two / (c * p)]
    nodes = tuple(node.index for node in rates)
    return finish(tape, {"derivative": Output((4,), nodes)}, ())
