"""Directional derivatives of a program's outputs, as one more output."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from eomgen.codegen.interface import Function, Interface
from eomgen.program.differentiate import tangent
from eomgen.program.program import Output, Program
from eomgen.program.tape import TIME, Node, Stage, Tape

NAME = "directional"
Entries = Sequence[tuple[str, Sequence[int]]]
"""Outputs by name, each with the indices of some of its entries."""


def with_directions(
    program: Program, interface: Interface, entries: Entries
) -> tuple[Program, Interface]:
    """The program with the output `directional`: derivatives of entries of outputs along a
    direction, given as further inputs for each state, input and parameter, and for time.
    """
    tape = Tape.continued(program.steps)
    variables = [v.name for v in (*interface.states, *interface.inputs, *interface.parameters)]
    known = {str(step.value): i for i, step in enumerate(program.steps) if step[0] == "input"}
    seeds: dict[int, Node] = {}
    extra = []
    for name in (*variables, TIME):
        # No name of a scene has __ in it.
        seed = tape.input(f"d__{name}", Stage.INPUTS)
        extra.append(f"d__{name}")
        if name in known:
            seeds[known[name]] = seed
    nodes = [Node(tape, program.outputs[name].nodes[i]) for name, which in entries for i in which]
    found = tuple(node.index for node in tangent(nodes, seeds))
    outputs = {**program.outputs, NAME: Output((len(found),), found)}
    about = "Derivatives along a direction."
    function = Function(NAME, about, (len(found),), tuple(extra), tangent=False, matrix=False)
    return (
        replace(program, steps=tuple(tape.steps), outputs=outputs),
        replace(interface, functions=(*interface.functions, function)),
    )


def dependencies(program: Program, names: Sequence[str]) -> Mapping[int, tuple[int, ...]]:
    """For each step the indices in `names` of the inputs that it depends on, as far as structure
    tells.
    """
    place = {name: 1 << i for i, name in enumerate(names)}
    masks: list[int] = []
    for step in program.steps:
        mask = place.get(str(step.value), 0) if step.operation == "input" else 0
        for operand in step.operands:
            mask |= masks[operand]
        masks.append(mask)
    wanted = {i for output in program.outputs.values() for i in output.nodes}
    return {i: tuple(k for k in range(len(names)) if masks[i] >> k & 1) for i in wanted}
