"""What a module asks of its parameters, as lines of source."""

import math
from dataclasses import dataclass

from eomgen.codegen.interface import Interface
from eomgen.errors import listed
from eomgen.language.conditions import Condition
from eomgen.language.formula import evaluate, names_in
from eomgen.program.printing import Dialect, Names, print_block
from eomgen.program.program import finish
from eomgen.program.scalars import TapeScalars
from eomgen.program.tape import Stage, Tape


@dataclass(frozen=True)
class Refusals:
    """`lines` are assignments, in order; `tests` what must hold after them, each with the source
    of what to say where it does not; `functions` those called.
    """

    lines: tuple[tuple[str, str], ...]
    tests: tuple[tuple[str, str], ...]
    functions: tuple[str, ...]


def refusals(interface: Interface, dialect: Dialect) -> Refusals:
    """The conditions on a program's parameters, each once."""
    conditions = interface.conditions
    tape = Tape()
    scalars = TapeScalars(tape)
    given = {p.name: tape.input(p.name, Stage.PARAMETERS) for p in interface.parameters}
    parts = {
        c: [evaluate(f, given, scalars).index for f in (c.value, *c.shown)] for c in conditions
    }
    program = finish(tape, {}, ())
    tested = [parts[c][0] for c in conditions]
    shown = [i for c in conditions for i in parts[c][1:]]
    block = print_block(program, [*tested, *shown], Names(program, dialect), dialect, fixed=True)
    source = dict(zip([*tested, *shown], block.results, strict=True))
    tests = tuple(
        (_test(c, source[parts[c][0]]), _words(c, [source[i] for i in parts[c][1:]]))
        for c in conditions
    )
    return Refusals(block.lines, tests, block.functions)


def _test(condition: Condition, value: str) -> str:
    """A comparison that no nan passes."""
    low, high = f"{condition.low + 0.0!r}", f"{condition.high!r}"
    if condition.high == math.inf:
        return f"{value} {'>' if condition.strict else '>='} {low}"
    return f"{low} {'<' if condition.strict else '<='} {value} <= {high}"


def _words(condition: Condition, shown: list[str]) -> str:
    """The source of a text."""
    names = listed(dict.fromkeys(names_in(condition.value)))
    text = f"parameters {names}: {condition.location}: {condition.words}"
    if shown:
        return f"{text!r}.format({', '.join(shown)})"
    return repr(text.replace("{{", "{").replace("}}", "}"))
