"""Functions in a derivative that may change their value within a small part of a step.

A polynomial of time is resolved by the points at which a method evaluates it. The exponential of
one is not: exp(-((t - c)/w)**2) is 0 but for a moment, and so is the inverse of a square root that
almost vanishes. What such a function does within a step follows from the range of its argument.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace

from eomgen.program.program import Output, Program, live_steps
from eomgen.program.switching import depends
from eomgen.program.tape import TIME, Stage, Step

LOCALISING = ("exp", "log", "sqrt", "tanh", "atan")
"""Functions that may change their value within a small part of the range of a smooth argument."""
WAVES = ("sin", "cos")
"""Functions that may do so if their argument is a fast function of time."""
OF_STATE, OF_TIME = "local_arguments", "local_arguments_of_time"
"""Names of the outputs: arguments that depend on the state, and those of time alone."""


@dataclass(frozen=True)
class Arguments:
    """A program with outputs for the arguments of localising functions, and these functions.

    of_state  operations whose arguments are the entries of `OF_STATE`; "div" for a divisor
    of_time   the same of `OF_TIME`
    """

    program: Program
    of_state: tuple[str, ...]
    of_time: tuple[str, ...]


def with_local_arguments(program: Program, states: Collection[str], divisors: bool) -> Arguments:
    """The arguments of the localising functions in a program's `derivative`.

    states    the inputs that are the state
    divisors  whether divisions are among them
    """
    steps = program.steps
    live = live_steps(program, program.outputs["derivative"].nodes)
    local = [i for i in live if _is_local(steps[i], divisors)]
    inner = live_steps(program, [steps[i].operands[-1] for i in local])
    moving, timed = depends(steps, states), depends(steps, (TIME,))
    waves = [i for i in inner if steps[i].operation in WAVES and timed[i]]
    groups: dict[str, dict[tuple[str, int], None]] = {OF_STATE: {}, OF_TIME: {}}
    for i in (*waves, *local):
        argument = steps[i].operands[-1]
        if moving[argument] or timed[argument]:
            group = groups[OF_STATE if moving[argument] else OF_TIME]
            group[steps[i].operation, argument] = None
    outputs = {name: Output((len(g),), tuple(i for _, i in g)) for name, g in groups.items() if g}
    kinds = (tuple(kind for kind, _ in groups[name]) for name in (OF_STATE, OF_TIME))
    return Arguments(replace(program, outputs={**program.outputs, **outputs}), *kinds)


def _is_local(step: Step, divisors: bool) -> bool:
    known = LOCALISING + (("div",) if divisors else ())
    return step.operation in known and step.stage > Stage.PARAMETERS
