"""A finished program: steps in order and the named outputs they compute."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from eomgen.program.tape import ARITHMETIC, COUNTED, FUNCTIONS, Stage, Step, Tape


@dataclass(frozen=True)
class Output:
    """An array that the program computes: its shape (() for a number) and its nodes, row by row."""

    shape: tuple[int, ...]
    nodes: tuple[int, ...]


@dataclass(frozen=True)
class Check:
    """A node that must be positive, or at least not negative where it `may_vanish`."""

    about: str
    node: int
    may_vanish: bool


@dataclass(frozen=True)
class Program:
    """Straight-line arithmetic. `steps[i]` uses only steps before `i`.

    `checks` are what parameters of a user's own must keep: masses and inertias above zero.
    """

    steps: tuple[Step, ...]
    outputs: Mapping[str, Output]
    names: Mapping[int, str]
    checks: tuple[Check, ...]

    def __str__(self) -> str:
        """The program as pseudo-code, one line a step."""
        lines = []
        for i, step in enumerate(self.steps):
            what = step.value if step.value is not None else ""
            operands = ", ".join(f"s{o}" for o in step.operands)
            hint = f"  # {self.names[i]}" if i in self.names else ""
            lines.append(f"s{i} = {step.operation}({operands}{what}){hint}")
        for name, output in self.outputs.items():
            lines.append(f"{name} = [{', '.join(f's{n}' for n in output.nodes)}]")
        return "\n".join(lines)


def finish(tape: Tape, outputs: Mapping[str, Output], checks: Iterable[Check]) -> Program:
    """The program of a tape."""
    return Program(tuple(tape.steps), dict(outputs), dict(tape.names), tuple(checks))


def live_steps(
    program: Program, nodes: Iterable[int], outside: Callable[[int], bool] | None = None
) -> list[int]:
    """The steps that some nodes need, in order; what lies behind those `outside` is left out."""
    needed: set[int] = set()
    stack = list(nodes)
    while stack:
        i = stack.pop()
        if i not in needed:
            needed.add(i)
            if outside is None or not outside(i):
                stack += program.steps[i].operands
    return sorted(needed)


def cost(program: Program, output: str) -> dict[str, int]:
    """Operations of one output by kind, those that depend on parameters alone left out.

    The entry `total` is their sum, and `parameters` counts what depends on parameters alone.
    """
    counts: dict[str, int] = {}
    fixed = 0
    for i in live_steps(program, program.outputs[output].nodes):
        step = program.steps[i]
        if step.operation not in COUNTED:
            continue
        if step.stage <= Stage.PARAMETERS:
            fixed += 1
        else:
            counts[step.operation] = counts.get(step.operation, 0) + 1
    by_kind = {kind: counts[kind] for kind in COUNTED if kind in counts}
    return {**by_kind, "total": sum(by_kind.values()), "parameters": fixed}


class Arithmetic(Protocol):
    """Scalars a program can be run over: they add, subtract, multiply and divide themselves."""

    def number(self, value: float) -> Any:
        """The scalar that stands for a float."""

    def call(self, function: str, *arguments: Any) -> Any:
        """A function of formulas (`language.formula.FUNCTIONS`)."""


def interpret(
    program: Program, output: str, inputs: Mapping[str, Any], scalars: Arithmetic
) -> list[Any]:
    """Run the steps of one output over any scalars (floats, mpmath numbers, arrays).

    Raises `KeyError` for an input that is not given.
    """
    values: dict[int, Any] = {}
    for i in live_steps(program, program.outputs[output].nodes):
        step = program.steps[i]
        operands = [values[o] for o in step.operands]
        if step.operation == "constant":
            values[i] = scalars.number(float(step.value or 0.0))
        elif step.operation == "input":
            values[i] = inputs[str(step.value)]
        elif step.operation == "neg":
            values[i] = -operands[0]
        elif step.operation in FUNCTIONS:
            values[i] = scalars.call(step.operation, *operands)
        else:
            values[i] = ARITHMETIC[step.operation](*operands)
    return [values[n] for n in program.outputs[output].nodes]
