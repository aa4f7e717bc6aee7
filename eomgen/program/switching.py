"""Switching functions: their zeros are where a derivative's abs, min, max, step or select switch.

Between these zeros the derivative is smooth. An integration evaluates the functions to detect a
branch that begins and ends within one long step, such as a brief contact.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

from eomgen.program.program import Output, Program, live_steps
from eomgen.program.tape import TIME, Stage, Step
from eomgen.scalars.functions import CORNERS

OF_STATE, OF_TIME = "switching_functions", "switching_functions_of_time"
"""Names of the outputs: switching functions of the state, and of time alone."""


def with_switching_functions(program: Program, states: Collection[str]) -> Program:
    """The program with the switching functions of its `derivative` as two further outputs.

    One output has the functions of the state, the other those of time alone; an output without
    functions is left out. `states` names the inputs that are the state.
    """
    if "derivative" not in program.outputs:
        return program
    compared = list(_compared(program))
    if not compared:
        return program
    steps = list(program.steps)
    differences = {step.operands: i for i, step in enumerate(steps) if step.operation == "sub"}
    nodes: dict[int, None] = {}
    for pair in compared:
        if len(pair) == 1:
            nodes[pair[0]] = None
            continue
        found = [differences[way] for way in (pair, pair[::-1]) if way in differences]
        if not found:
            found = [len(steps)]
            differences[pair] = len(steps)
            steps.append(Step("sub", pair, max(steps[i].stage for i in pair)))
        nodes[found[0]] = None
    moving, timed = depends(steps, states), depends(steps, (TIME,))
    groups = {
        OF_STATE: tuple(i for i in nodes if moving[i]),
        OF_TIME: tuple(i for i in nodes if timed[i] and not moving[i]),
    }
    outputs = {name: Output((len(found),), found) for name, found in groups.items() if found}
    if not outputs:
        return program
    return replace(program, steps=tuple(steps), outputs={**program.outputs, **outputs})


def depends(steps: Sequence[Step], names: Collection[str]) -> bytearray:
    """For each step 1 if it depends on one of the named inputs, else 0."""
    depends, known = bytearray(len(steps)), frozenset(names)
    for i, (_, operands, _, value) in enumerate(steps):
        depends[i] = max([depends[o] for o in operands]) if operands else value in known
    return depends


def _compared(program: Program) -> Iterator[tuple[int, ...]]:
    """The steps whose comparison selects a branch of the derivative.

    One step is compared with 0, two steps with each other. Comparisons on parameters alone are left
    out, and so is the sign of a step that is compared with 0.
    """
    steps = program.steps

    def unsigned(i: int) -> int:
        return steps[i].operands[0] if steps[i].operation == "neg" else i

    for i in live_steps(program, program.outputs["derivative"].nodes):
        operation, operands, stage, _ = steps[i]
        if operation not in CORNERS or stage <= Stage.PARAMETERS:
            continue
        pair = operands if operation in ("min", "max") else operands[:1]
        rest = tuple(k for k in pair if not _is_zero(steps[k]))
        if any(steps[k].stage > Stage.PARAMETERS for k in rest):
            yield rest if len(rest) == 2 else (unsigned(rest[0]),)


def _is_zero(step: Step) -> bool:
    return step.operation == "constant" and step.value == 0.0
