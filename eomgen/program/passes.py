"""Optimisation passes: each returns a program with the same outputs in fewer operations.

Every output is computed by its own function, which reads nothing that others compute. So each
is optimised by itself: a step that another one needs as it stands is no obstacle to a shorter form.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from eomgen.program.program import Program
from eomgen.program.rewriting import (
    Steps,
    absorb_minus_signs,
    factor_sums,
    gather_parameters,
    renumbered,
    share_factors,
    take_apart_shared,
    without_dead_steps,
)

FIRST = "derivative"
"""The output that a user waits for, beside its Jacobian."""


PASSES: tuple[Callable[[Program], Program], ...] = (
    gather_parameters,
    factor_sums,
    share_factors,
    take_apart_shared,
    absorb_minus_signs,
)


@dataclass(frozen=True)
class PassReport:
    """The size of a program after a pass: the steps of all its parts, and the operations of two
    outputs.
    """

    name: str
    steps: int
    derivative: int
    jacobian: int


def optimise(program: Program) -> Program:
    """Run all passes in order."""
    parts = parts_of(program)
    for run in PASSES:
        parts = [run(part) for part in parts]
    return _united(parts)


def optimise_and_report(program: Program) -> tuple[Program, tuple[PassReport, ...]]:
    """Run all passes in order. Return a report of the program before them and after each."""
    parts = parts_of(program)
    reports = [_report("as lowered", parts)]
    for run in PASSES:
        parts = [run(part) for part in parts]
        reports.append(_report(run.__name__.replace("_", " "), parts))
    return _united(parts), tuple(reports)


def parts_of(program: Program) -> list[Program]:
    """Each output as a separate program, without steps that it does not need; the checks too."""
    parts = [replace(program, outputs={n: o}, checks=()) for n, o in program.outputs.items()]
    if program.checks:
        parts.append(replace(program, outputs={}))
    return [without_dead_steps(part) for part in parts]


def _united(parts: Sequence[Program]) -> Program:
    """The parts of a program as one; equal steps are one."""
    steps = Steps()
    moved = [renumbered(part, steps.all, steps.copied(part)) for part in parts]
    outputs = {name: output for part in moved for name, output in part.outputs.items()}
    return Program(
        tuple(steps.all),
        outputs,
        {i: name for part in reversed(moved) for i, name in part.names.items()},
        tuple(check for part in moved for check in part.checks),
    )


def _report(name: str, parts: Sequence[Program]) -> PassReport:
    derivative, jacobian = (
        sum(part.operations[output] for part in parts if output in part.outputs)
        for output in (FIRST, "jacobian")
    )
    return PassReport(name, sum(len(part.steps) for part in parts), derivative, jacobian)
