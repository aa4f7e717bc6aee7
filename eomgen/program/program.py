"""A program: steps in order and the named outputs that they compute."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import compress
from operator import neg
from typing import Any

from eomgen.program.tape import ARITHMETIC, COUNTED, FUNCTIONS, Stage, Step, Tape
from eomgen.scalars.protocol import Scalars


@dataclass(frozen=True)
class Output:
    """An array that the program computes: its shape, () for a number, and its nodes in C order."""

    shape: tuple[int, ...]
    nodes: tuple[int, ...]


@dataclass(frozen=True)
class Check:
    """A node whose value must be positive, or not negative if it `may_vanish`."""

    about: str
    node: int
    may_vanish: bool

    @property
    def relation(self) -> str:
        """The comparison with 0 that the value must pass."""
        return ">=" if self.may_vanish else ">"

    @property
    def problem(self) -> str:
        """What is wrong with a value that does not pass it."""
        return "negative" if self.may_vanish else "not positive"


@dataclass(frozen=True)
class Program:
    """Straight-line arithmetic. `steps[i]` uses only steps before `i`.

    `names` suggests a variable name for some steps. `checks` are conditions on parameter values,
    such as positive masses and inertias.
    """

    steps: tuple[Step, ...]
    outputs: Mapping[str, Output]
    names: Mapping[int, str]
    checks: tuple[Check, ...]

    @cached_property
    def operations(self) -> Mapping[str, int]:
        """The operations of each output, without those on parameters alone: `cost` in total."""
        counted = bytearray(s[2] > Stage.PARAMETERS and s[0] in COUNTED for s in self.steps)
        found = {}
        for name, output in self.outputs.items():
            found[name] = sum([counted[i] for i in live_steps(self, output.nodes)])
        return found

    def __str__(self) -> str:
        """The program as pseudo-code, one line for each step."""
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
    """The program that a tape has recorded."""
    return Program(tuple(tape.steps), dict(outputs), dict(tape.names), tuple(checks))


def live_steps(
    program: Program, nodes: Iterable[int], is_leaf: Callable[[int], bool] | None = None
) -> list[int]:
    """The steps that some nodes need, in order, the nodes included.

    A step for which `is_leaf` holds is included; its operands are not, unless others need them.
    """
    live = bytearray(len(program.steps))
    for node in nodes:
        live[node] = 1
    steps = program.steps
    i = live.rfind(1)
    while i >= 0:  # backwards, because operands precede the steps that use them
        if is_leaf is None or not is_leaf(i):
            for operand in steps[i][1]:
                live[operand] = 1
        i -= 1
        if i >= 0 and not live[i]:
            i = live.rfind(1, 0, i)
    return list(compress(range(len(live)), live))


def cost(program: Program, output: str) -> dict[str, int]:
    """The operations of one output, counted by kind.

    Operations that depend on parameters alone are not counted by kind. The entry `total` is the sum
    of the kinds; `parameters` is the number of operations on parameters alone.
    """
    live = [program.steps[i] for i in live_steps(program, program.outputs[output].nodes)]
    counts = Counter([step.operation for step in live if step.stage > Stage.PARAMETERS])
    fixed = Counter([step.operation for step in live if step.stage <= Stage.PARAMETERS])
    by_kind = {kind: counts[kind] for kind in COUNTED if kind in counts}
    parameters = sum(fixed[kind] for kind in COUNTED)
    return {**by_kind, "total": sum(by_kind.values()), "parameters": parameters}


def interpret(
    program: Program, output: str, inputs: Mapping[str, Any], scalars: Scalars
) -> list[Any]:
    """Evaluate one output over any scalars (floats, 60-digit numbers, arrays).

    `inputs` are values by name. Raises `KeyError` if one that the output needs is missing.
    """
    return interpreter(program, output, scalars)(inputs)


def interpreter(
    program: Program, output: str, scalars: Scalars
) -> Callable[[Mapping[str, Any]], list[Any]]:
    """A function that evaluates one output as `interpret` does, prepared once for many calls."""
    live = live_steps(program, program.outputs[output].nodes)
    index = {i: k for k, i in enumerate(live)}
    start: list[Any] = [None] * len(live)
    given: list[tuple[int, str]] = []
    todo: list[tuple[int, Callable[..., Any], tuple[int, ...]]] = []
    for k, i in enumerate(live):
        step = program.steps[i]
        operands = tuple(index[o] for o in step.operands)
        if step.operation == "constant":
            start[k] = scalars.number(float(step.value or 0.0))
        elif step.operation == "input":
            given.append((k, str(step.value)))
        elif step.operation == "neg":
            todo.append((k, neg, operands))
        elif step.operation in FUNCTIONS:
            todo.append((k, partial(scalars.call, step.operation), operands))
        else:
            todo.append((k, ARITHMETIC[step.operation], operands))
    results = [index[n] for n in program.outputs[output].nodes]

    def run(inputs: Mapping[str, Any]) -> list[Any]:
        values = start.copy()
        for k, name in given:
            values[k] = inputs[name]
        for k, function, operands in todo:
            values[k] = function(*[values[o] for o in operands])
        return [values[k] for k in results]

    return run
