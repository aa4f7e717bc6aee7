"""A program whose states are those of a motion and how these depend on what is fitted.

With f the derivative of the state y and S = ∂y/∂θ, the rates of S are f_y S + f_θ: for each θ the
tangent of f along its column of S and the unit direction of θ, by the steps of the tape. So the
steps of any method have S as exactly as y, and common subexpressions are computed once.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from eomgen.codegen.interface import Function, Interface, Variable
from eomgen.program.differentiate import substituted, tangent
from eomgen.program.passes import optimise
from eomgen.program.program import Output, Program
from eomgen.program.tape import TIME, Node, Stage, Tape

MEASURED = "measured"
"""The output with measured quantities that are no states, and their derivatives by each θ."""
Entries = Sequence[tuple[str, int]]
"""Outputs by name, with the index of one entry."""


def sensitive(
    program: Program,
    interface: Interface,
    names: Sequence[str],
    measured: Entries = (),
    varying: Sequence[str] = (),
) -> tuple[Program, Interface]:
    """The program of a motion with its sensitivities to parameters and initial states.

    names     what is fitted, n names
    measured  entries of outputs, m of them, whose values and derivatives are the output `measured`,
              ((1 + n) m,)
    varying   inputs that are c + r t: c has the name of the input, r is a further input

    The states (ny (1 + n),) are y, then S column by column. Rates of inputs follow the inputs.
    """
    tape = Tape.continued(program.steps)
    tape.names = dict(program.names)
    known = {str(step.value): i for i, step in enumerate(program.steps) if step[0] == "input"}
    ramps = _ramps(tape, varying, known)
    states = [state.name for state in interface.states]
    parameters = {p.name for p in interface.parameters}
    one = tape.constant(1.0)
    directions, columns = list[dict[int, Node]](), list[list[str]]()
    for n, name in enumerate(names):
        # No name of a scene has __ in it.
        columns.append([f"d{n}__{state}" for state in states])
        nodes = [tape.input(column, Stage.VELOCITIES) for column in columns[-1]]
        own = {known[s]: node for s, node in zip(states, nodes, strict=True) if s in known}
        if name in parameters and name in known:
            own[known[name]] = one
        directions.append(own)

    def with_slopes(nodes: Sequence[int]) -> tuple[int, ...]:
        values = substituted([Node(tape, i) for i in nodes], ramps)
        slopes = [tangent(values, own) for own in directions]
        return tuple(node.index for part in (values, *slopes) for node in part)

    of_states = ["initial_state", "derivative"]
    found = {name: with_slopes(program.outputs[name].nodes) for name in of_states}
    if measured:
        found[MEASURED] = with_slopes([program.outputs[name].nodes[i] for name, i in measured])
    outputs = {name: Output((len(nodes),), nodes) for name, nodes in found.items()}
    steps = replace(program, steps=tuple(tape.steps), outputs=outputs, names=dict(tape.names))
    return optimise(steps), _interface(interface, columns, varying, outputs)


def _ramps(tape: Tape, varying: Sequence[str], known: Mapping[str, int]) -> dict[int, Node]:
    """For the node of each input that varies, c + r t."""
    time = tape.input(TIME, Stage.INPUTS)
    found = {}
    for name in varying:
        if name in known:
            rate = tape.input(rate_of(name), Stage.INPUTS)
            found[known[name]] = Node(tape, known[name]) + rate * time
    return found


def rate_of(name: str) -> str:
    """The name of the rate of an input."""
    return f"rate__{name}"


def _interface(
    interface: Interface,
    columns: Sequence[Sequence[str]],
    varying: Sequence[str],
    outputs: Mapping[str, Output],
) -> Interface:
    """The interface of the program: sensitivities are further states, as those of controllers."""
    about = {f.name: f for f in interface.functions}
    plain = Function(MEASURED, "What is measured, and its slopes.", (), (), False, False)
    return replace(
        interface,
        states=(
            *interface.states,
            *(Variable(name, "", "a sensitivity") for column in columns for name in column),
        ),
        others=interface.others + len(interface.states) * len(columns),
        inputs=(
            *interface.inputs,
            *(Variable(rate_of(name), "", "rate of an input") for name in varying),
        ),
        functions=tuple(
            replace(about.get(name, plain), shape=output.shape) for name, output in outputs.items()
        ),
    )
