"""Serialisation of programs as JSON; steps, names and numbers are restored bit for bit.

A step is [operation, stage, operand, …]; a constant has its value in place of operands, an input
its name. Reading executes nothing and refuses any text that is not a valid program.
"""

import json
import math
from collections.abc import Mapping
from typing import Any

from eomgen.program.program import Check, Output, Program
from eomgen.program.tape import ARITHMETIC, FUNCTIONS, Stage, Step
from eomgen.scalars.functions import FUNCTIONS as ARGUMENTS

FORMAT = "eomgen program 1"
_COUNTS = {"neg": 1, **dict.fromkeys(ARITHMETIC, 2), **{f: ARGUMENTS[f] for f in FUNCTIONS}}
"""Number of operands of each operation."""


class ProgramError(ValueError):
    """A text is not a saved program; the message says why."""


def saved(program: Program) -> str:
    """A program as JSON text. Equal programs give equal text."""
    steps = [
        [operation, int(stage), *(operands if value is None else (value,))]
        for operation, operands, stage, value in program.steps
    ]
    content = {
        "format": FORMAT,
        "steps": steps,
        "outputs": {name: [o.shape, o.nodes] for name, o in program.outputs.items()},
        "names": {str(i): name for i, name in program.names.items()},
        "checks": [[c.about, c.node, c.may_vanish] for c in program.checks],
    }
    return json.dumps(content, allow_nan=False, ensure_ascii=True, separators=(",", ":"))


def restored(text: str) -> Program:
    """The program of a text that `saved` wrote. Raises `ProgramError` for any other text."""
    try:
        content = json.loads(text)
        if not (isinstance(content, dict) and content.get("format") == FORMAT):
            raise ProgramError(f"no program: its format is not '{FORMAT}'")
        steps: list[Step] = []
        for i, parts in enumerate(content["steps"]):
            steps.append(_step(i, parts))
        count = len(steps)
        return Program(
            tuple(steps),
            {_text(n): _output(parts, count) for n, parts in _table(content, "outputs").items()},
            {_node(int(i), count): _text(n) for i, n in _table(content, "names").items()},
            tuple(
                Check(_text(about), _node(node, count), _truth(vanish))
                for about, node, vanish in content["checks"]
            ),
        )
    except ProgramError:
        raise
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise ProgramError(f"no program: {error}") from None


def _step(i: int, parts: Any) -> Step:
    operation, stage, *rest = parts
    if operation == "constant":
        (value,) = rest
        if type(value) is not float or not math.isfinite(value):
            raise ProgramError(f"step {i}: '{value}' is not a finite number")
        return Step(operation, (), _stage(stage), value)
    if operation == "input":
        (name,) = rest
        return Step(operation, (), _stage(stage), _text(name))
    if not isinstance(operation, str) or operation not in _COUNTS:
        raise ProgramError(f"step {i}: there is no operation '{operation}'")
    if len(rest) != _COUNTS[operation]:
        raise ProgramError(f"step {i}: '{operation}' takes {_COUNTS[operation]} operands")
    return Step(operation, tuple(_node(o, i) for o in rest), _stage(stage))


def _output(parts: Any, count: int) -> Output:
    shape, nodes = parts
    if not all(type(n) is int and n >= 0 for n in shape):
        raise ProgramError(f"a shape is {shape}")
    return Output(tuple(shape), tuple(_node(n, count) for n in nodes))


def _stage(stage: Any) -> Stage:
    if type(stage) is not int:
        raise ProgramError(f"'{stage}' is not a stage")
    return Stage(stage)


def _node(node: Any, count: int) -> int:
    if type(node) is not int or not 0 <= node < count:
        raise ProgramError(f"'{node}' is none of the {count} steps before")
    return node


def _text(text: Any) -> str:
    if type(text) is not str:
        raise ProgramError(f"'{text}' is not a text")
    return text


def _truth(value: Any) -> bool:
    if type(value) is not bool:
        raise ProgramError(f"'{value}' is neither true nor false")
    return value


def _table(content: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    table = content[name]
    if not isinstance(table, dict):
        raise ProgramError(f"its {name} are not a table")
    return table
