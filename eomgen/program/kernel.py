"""One output of a program as a Python function over any scalars.

It takes the steps that `program.interpret` takes, several times as fast: they are written out as
Python once. What depends on parameters alone is computed apart, once for many calls.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from eomgen.loading import load_source
from eomgen.program.program import Program, live_steps
from eomgen.program.tape import ARITHMETIC, FUNCTIONS, Stage, Step
from eomgen.scalars.protocol import Scalars

_SIGNS = {"add": "+", "sub": "-", "mul": "*", "div": "/"}

Moving = Callable[[Sequence[Any], Sequence[Any], Sequence[Callable[..., Any]]], list[Any]]


@dataclass(frozen=True, eq=False)
class Kernel:
    """One output in two parts.

    program    that it is of
    known      steps that depend on parameters alone and are needed by others, in order
    inputs     names of what `moving` is given besides, in order: time, state, inputs
    functions  names of the functions that it calls, in order
    moving     from the values of `known`, of `inputs`, and the functions, the output's entries
    """

    program: Program
    known: tuple[int, ...]
    inputs: tuple[str, ...]
    functions: tuple[str, ...]
    moving: Moving

    def known_values(self, parameters: Mapping[str, Any], scalars: Scalars) -> tuple[Any, ...]:
        """The values of `known` at values of the parameters, by name."""
        values = fixed_values(self.program, self.known, parameters, scalars)
        return tuple(values[i] for i in self.known)


def kernel(program: Program, output: str) -> Kernel:
    """The kernel of one output."""
    nodes = program.outputs[output].nodes
    steps, live = program.steps, live_steps(program, nodes)
    moving = [i for i in live if steps[i].stage > Stage.PARAMETERS]
    used = {o for i in moving for o in steps[i].operands} | set(nodes)
    known = tuple(i for i in live if steps[i].stage <= Stage.PARAMETERS and i in used)
    given = [i for i in moving if steps[i].operation == "input"]
    computed = [i for i in moving if steps[i].operation != "input"]
    functions = tuple(f for f in FUNCTIONS if any(steps[i].operation == f for i in computed))
    # Nothing that is written comes from the program's names: steps are called by their numbers.
    lines = [
        "def moving(known, given, functions):",
        f"    ({_unpacked(f's{i}' for i in known)}) = known",
        f"    ({_unpacked(f's{i}' for i in given)}) = given",
        f"    ({_unpacked(f'f_{name}' for name in functions)}) = functions",
        *(f"    s{i} = {_written(steps[i])}" for i in computed),
        f"    return [{', '.join(f's{i}' for i in nodes)}]",
    ]
    module = load_source("\n".join(lines) + "\n", "kernel")
    inputs = tuple(str(steps[i].value) for i in given)
    return Kernel(program, known, inputs, functions, module.moving)


def fixed_values(
    program: Program, wanted: Sequence[int], parameters: Mapping[str, Any], scalars: Scalars
) -> dict[int, Any]:
    """The values of steps that depend on parameters alone, and of all that they need."""
    values: dict[int, Any] = {}
    for i in live_steps(program, wanted):
        operation, operands, _, value = program.steps[i]
        parts = [values[o] for o in operands]
        if operation == "constant":
            values[i] = scalars.number(float(value or 0.0))
        elif operation == "input":
            values[i] = parameters[str(value)]
        elif operation in FUNCTIONS:
            values[i] = scalars.call(operation, *parts)
        else:
            values[i] = -parts[0] if operation == "neg" else ARITHMETIC[operation](*parts)
    return values


def _unpacked(names: Any) -> str:
    return "".join(f"{name}, " for name in names)


def _written(step: Step) -> str:
    parts = [f"s{o}" for o in step.operands]
    if step.operation == "neg":
        return f"-{parts[0]}"
    if step.operation in FUNCTIONS:
        return f"f_{step.operation}({', '.join(parts)})"
    return f" {_SIGNS[step.operation]} ".join(parts)
