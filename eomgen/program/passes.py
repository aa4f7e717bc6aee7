"""Optimisation passes: each returns a program with the same outputs in fewer operations."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from functools import partial, reduce

from eomgen.program.program import Output, Program, cost, finish, live_steps
from eomgen.program.tape import Stage, Step, Tape

Rule = Callable[[Tape, str, list[int]], int]
"""Records an operation on steps of a tape and returns the step of its result."""


@dataclass(frozen=True)
class PassReport:
    """The size of a program after a pass: steps, and operations per call of two outputs."""

    name: str
    steps: int
    derivative: int
    jacobian: int


def optimise(program: Program) -> Program:
    """Run all passes in order."""
    for run in PASSES:
        program = run(program)
    return program


def optimise_and_report(program: Program) -> tuple[Program, tuple[PassReport, ...]]:
    """Run all passes in order. Return a report of the program before them and after each."""
    reports = [_report("as lowered", program)]
    for run in PASSES:
        program = run(program)
        reports.append(_report(run.__name__.replace("_", " "), program))
    return program, tuple(reports)


def drop_dead_steps(program: Program) -> Program:
    """Remove steps that no output and no check needs."""
    roots = [n for output in program.outputs.values() for n in output.nodes]
    keep = live_steps(program, [*roots, *(check.node for check in program.checks)])
    if len(keep) == len(program.steps):
        return program
    new = {old: i for i, old in enumerate(keep)}
    steps = [
        Step(operation, tuple([new[o] for o in operands]), stage, value)
        for operation, operands, stage, value in (program.steps[i] for i in keep)
    ]
    return Program(
        tuple(steps),
        {k: Output(o.shape, tuple(new[n] for n in o.nodes)) for k, o in program.outputs.items()},
        {new[i]: name for i, name in program.names.items() if i in new},
        tuple(replace(check, node=new[check.node]) for check in program.checks),
    )


def gather_parameters(program: Program) -> Program:
    """Rewrite k·(x·(l·y)) as (k·l)·(x·y) and k + (x + l) as (k + l) + x.

    Operands that depend on parameters alone are combined, so that they are computed once and not at
    every call. Only intermediate results that are used once are taken apart.
    """
    used_once = _UsedOnce(program, ("mul", "add"))

    def rule(tape: Tape, operation: str, nodes: list[int]) -> int:
        if operation in ("mul", "add") and not used_once.results.isdisjoint(nodes):
            parts = _flattened(tape, operation, nodes, used_once.results)
            fixed = [n for n in parts if tape.steps[n].stage <= Stage.PARAMETERS]
            if len(fixed) > 1 and len(parts) > len(fixed):
                rest = [n for n in parts if tape.steps[n].stage > Stage.PARAMETERS]
                combine = partial(tape.applied, operation)
                return combine(reduce(combine, fixed), reduce(combine, rest))
        return tape.applied(operation, *nodes)

    return drop_dead_steps(_rebuilt(program, rule, used_once.note))


def _flattened(
    tape: Tape, operation: str, nodes: list[int], used_once: Collection[int]
) -> list[int]:
    """The operands of nested products, or sums, where each inner result is used once."""
    parts: list[int] = []
    stack = nodes[::-1]
    while stack:
        node = stack.pop()
        if node in used_once and tape.steps[node].operation == operation:
            stack += reversed(tape.steps[node].operands)
        else:
            parts.append(node)
    return parts


def factor_sums(program: Program) -> Program:
    """Rewrite a·x ± a·y as a·(x ± y) where neither product is used elsewhere."""
    used_once = _UsedOnce(program, ("mul",))

    def rule(tape: Tape, operation: str, nodes: list[int]) -> int:
        if operation in ("add", "sub") and used_once.results.issuperset(nodes):
            a, b = (tape.steps[n].operands for n in nodes)
            common = [i for i in a if i in b]
            if common:
                shared = common[0]
                left, right = (o[0] if o[1] == shared else o[1] for o in (a, b))
                return tape.applied("mul", shared, tape.applied(operation, left, right))
        return tape.applied(operation, *nodes)

    return drop_dead_steps(_rebuilt(program, rule, used_once.note))


class _UsedOnce:
    """The steps of a tape, results of given operations, that are used exactly once."""

    def __init__(self, program: Program, operations: Collection[str]) -> None:
        self.results: set[int] = set()
        self._uses = _uses(program)
        self._operations = operations

    def note(self, old: int, operation: str, new: int) -> None:
        """Note that step `old` of the program became step `new`, the result of `operation`."""
        if self._uses[old] == 1 and operation in self._operations:
            self.results.add(new)
        else:
            self.results.discard(new)


PASSES: tuple[Callable[[Program], Program], ...] = (
    drop_dead_steps,
    gather_parameters,
    factor_sums,
)


def _uses(program: Program) -> list[int]:
    """How often each step is an operand or an output entry."""
    uses = [0] * len(program.steps)
    for step in program.steps:
        for o in step.operands:
            uses[o] += 1
    for output in program.outputs.values():
        for n in output.nodes:
            uses[n] += 1
    return uses


def _rebuilt(program: Program, rule: Rule, note: Callable[[int, str, int], None]) -> Program:
    """The program recorded on a new tape, each operation by `rule`; `note` gets each step."""
    tape = Tape()
    new: list[int] = []
    for i, (operation, operands, stage, value) in enumerate(program.steps):
        if operation == "constant":
            node = tape.number(float(value or 0.0))
        elif operation == "input":
            node = tape.input(str(value), stage).index
        else:
            node = rule(tape, operation, [new[o] for o in operands])
        if i in program.names:
            tape.names.setdefault(node, program.names[i])
        note(i, tape.steps[node].operation, node)
        new.append(node)
    outputs = {
        name: Output(output.shape, tuple([new[n] for n in output.nodes]))
        for name, output in program.outputs.items()
    }
    checks = (replace(check, node=new[check.node]) for check in program.checks)
    return finish(tape, outputs, checks)


def _report(name: str, program: Program) -> PassReport:
    derivative, jacobian = (
        cost(program, output)["total"] if output in program.outputs else 0
        for output in ("derivative", "jacobian")
    )
    return PassReport(name, len(program.steps), derivative, jacobian)
