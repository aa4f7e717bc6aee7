"""One output of a program compiled to a Python function over any scalars.

It computes what `program.interpret` computes, several times as fast, because the steps are written
as Python source once. Steps that depend on parameters alone are evaluated separately, once for many
calls.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from eomgen.base.loading import load_source
from eomgen.program.program import Program, live_steps
from eomgen.program.tape import ARITHMETIC, FUNCTIONS, Stage, Step
from eomgen.scalars.protocol import Scalars

_SIGNS = {"add": "+", "sub": "-", "mul": "*", "div": "/"}

Moving = Callable[[Sequence[Any], Sequence[Any], Sequence[Callable[..., Any]]], list[Any]]


@dataclass(frozen=True, eq=False)
class Kernel:
    """One output of a program, split by what its steps depend on.

    program    the program
    known      steps that depend on parameters alone and that `moving` or the output uses, in order
    inputs     names of the other inputs that `moving` takes, in order: time, states, inputs
    functions  names of the functions that `moving` calls, in order
    moving     computes the output's entries from the values of `known` and `inputs`, and the
               functions
    """

    program: Program
    known: tuple[int, ...]
    inputs: tuple[str, ...]
    functions: tuple[str, ...]
    moving: Moving

    def known_values(self, parameters: Mapping[str, Any], scalars: Scalars) -> tuple[Any, ...]:
        """The values of `known` for parameter values given by name."""
        values = fixed_values(self.program, self.known, parameters, scalars)
        return tuple(values[i] for i in self.known)


def kernel(program: Program, output: str) -> Kernel:
    """The kernel that computes one output."""
    nodes = program.outputs[output].nodes
    steps, live = program.steps, live_steps(program, nodes)
    moving = [i for i in live if steps[i].stage > Stage.PARAMETERS]
    used = {o for i in moving for o in steps[i].operands} | set(nodes)
    known = tuple(i for i in live if steps[i].stage <= Stage.PARAMETERS and i in used)
    given = [i for i in moving if steps[i].operation == "input"]
    computed = [i for i in moving if steps[i].operation != "input"]
    functions = tuple(f for f in FUNCTIONS if any(steps[i].operation == f for i in computed))
    # No name from the program enters the source: variables are numbered by step.
    lines = [
        "def moving(known, given, functions):",
        f"    ({_targets(f's{i}' for i in known)}) = known",
        f"    ({_targets(f's{i}' for i in given)}) = given",
        f"    ({_targets(f'f_{name}' for name in functions)}) = functions",
        *(f"    s{i} = {_source(steps[i])}" for i in computed),
        f"    return [{', '.join(f's{i}' for i in nodes)}]",
    ]
    module = load_source("\n".join(lines) + "\n", "kernel")
    inputs = tuple(str(steps[i].value) for i in given)
    return Kernel(program, known, inputs, functions, module.moving)


def fixed_values(
    program: Program, wanted: Sequence[int], parameters: Mapping[str, Any], scalars: Scalars
) -> dict[int, Any]:
    """The values of steps that depend on parameters alone, and of all steps that they need."""
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


def _targets(names: Iterable[str]) -> str:
    """The names as targets of an unpacking assignment."""
    return "".join(f"{name}, " for name in names)


def _source(step: Step) -> str:
    parts = [f"s{o}" for o in step.operands]
    if step.operation == "neg":
        return f"-{parts[0]}"
    if step.operation in FUNCTIONS:
        return f"f_{step.operation}({', '.join(parts)})"
    return f" {_SIGNS[step.operation]} ".join(parts)
