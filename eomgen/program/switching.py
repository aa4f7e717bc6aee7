"""Switching functions: what a derivative's abs, min, max, step and select change branch by.

Within a branch the derivative is smooth. A run asks these functions whether a long step has passed
over a branch that begins and ends within it, as a brief contact does.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

from eomgen.program.program import Output, Program, live_steps
from eomgen.program.tape import TIME, Stage, Step
from eomgen.scalars.functions import CORNERS

OF_STATE, OF_TIME = "switching_functions", "switching_functions_of_time"
"""Outputs: those that depend on the state, or not."""


def with_switching_functions(program: Program, states: Collection[str]) -> Program:
    """The program with what its `derivative` changes branch by as outputs, functions of the state
    and of time alone apart: each is 0 where a branch ends. One that has none is left out.

    states  names of the inputs that are the state
    """
    if "derivative" not in program.outputs:
        return program
    steps = list(program.steps)
    index_of = {step: i for i, step in enumerate(steps)}
    nodes: dict[int, None] = {}
    for pair in _compared(program):
        if len(pair) == 1:
            nodes[pair[0]] = None
            continue
        stage = max(steps[i].stage for i in pair)
        found = [
            index_of[difference]
            for operands in (pair, pair[::-1])
            if (difference := Step("sub", operands, stage)) in index_of
        ]
        if not found:
            difference = Step("sub", pair, stage)
            index_of[difference] = len(steps)
            found = [len(steps)]
            steps.append(difference)
        nodes[found[0]] = None
    moving, timed = _depends(steps, states), _depends(steps, (TIME,))
    groups = {
        OF_STATE: tuple(i for i in nodes if moving[i]),
        OF_TIME: tuple(i for i in nodes if timed[i] and not moving[i]),
    }
    outputs = {name: Output((len(found),), found) for name, found in groups.items() if found}
    if not outputs:
        return program
    return replace(program, steps=tuple(steps), outputs={**program.outputs, **outputs})


def _depends(steps: Sequence[Step], names: Collection[str]) -> bytearray:
    """Of each step 1 if it depends on any of some inputs, else 0."""
    found = bytearray(len(steps))
    for i, (_, operands, _, value) in enumerate(steps):
        found[i] = value in names or any(found[o] for o in operands)
    return found


def _compared(program: Program) -> Iterator[tuple[int, ...]]:
    """What branches of the derivative depend on: a step that is compared with 0, or two that are
    compared with each other. What depends on parameters alone is left out, signs are, too.
    """
    steps = program.steps

    def plain(i: int) -> int:
        return steps[i].operands[0] if steps[i].operation == "neg" else i

    for i in live_steps(program, program.outputs["derivative"].nodes):
        operation, operands, stage, _ = steps[i]
        if operation not in CORNERS or stage <= Stage.PARAMETERS:
            continue
        pair = operands if operation in ("min", "max") else operands[:1]
        rest = tuple(k for k in pair if not _is_zero(steps[k]))
        if any(steps[k].stage > Stage.PARAMETERS for k in rest):
            yield rest if len(rest) == 2 else (plain(rest[0]),)


def _is_zero(step: Step) -> bool:
    return step.operation == "constant" and step.value == 0.0
