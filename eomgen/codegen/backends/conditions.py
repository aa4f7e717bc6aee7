"""Conditions on a module's parameters as lines of source."""

from dataclasses import dataclass

from eomgen.codegen.interface import Interface
from eomgen.language.conditions import Condition
from eomgen.language.formula import evaluate
from eomgen.program.printing import Dialect, Names, print_block
from eomgen.program.program import finish
from eomgen.program.scalars import TapeScalars
from eomgen.program.tape import Stage, Tape


@dataclass(frozen=True)
class Test:
    """A condition with the source of its value, and of the numbers `shown` in its message."""

    condition: Condition
    value: str
    shown: tuple[str, ...]


@dataclass(frozen=True)
class Refusals:
    """The source of all conditions: assignments, the tests that follow them, and the functions that
    the assignments call.
    """

    lines: tuple[tuple[str, str], ...]
    tests: tuple[Test, ...]
    functions: tuple[str, ...]


def refusals(interface: Interface, dialect: Dialect) -> Refusals:
    """The conditions on a program's parameters."""
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
        Test(c, source[parts[c][0]], tuple(source[i] for i in parts[c][1:])) for c in conditions
    )
    return Refusals(block.lines, tests, block.functions)
