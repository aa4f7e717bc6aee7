"""Optimisation passes: each returns a program with the same outputs in fewer operations."""

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce
from itertools import combinations
from types import MappingProxyType

from eomgen.program.program import Output, Program, cost, finish, live_steps
from eomgen.program.tape import Stage, Step, Tape

FIRST = "derivative"
"""The output whose operations count most."""
MOST_FACTORS = 8
"""Products of so many factors are not taken apart."""
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
    """Rewrite a·x ± a·y as a·(x ± y), and (s ± a·x) ± a·y as s ± a·(x ± y), where the products and
    the inner sum are not used elsewhere.

    Rounding errors keep their size: it is that of the largest term, before and after.
    """
    used_once = _UsedOnce(program, ("mul", "add", "sub"))

    def is_product(tape: Tape, node: int) -> bool:
        return node in used_once.results and tape.steps[node].operation == "mul"

    def product(tape: Tape, operation: str, left: int, right: int) -> int | None:
        """a·(x ± y) for the products a·x and a·y; None if they have no common factor."""
        a, b = tape.steps[left].operands, tape.steps[right].operands
        shared = next((i for i in a if i in b), None)
        if shared is None:
            return None
        x, y = (o[0] if o[1] == shared else o[1] for o in (a, b))
        return tape.applied("mul", shared, tape.applied(operation, x, y))

    def rule(tape: Tape, operation: str, nodes: list[int]) -> int:
        if operation in ("add", "sub") and is_product(tape, nodes[1]):
            left, right = nodes
            if is_product(tape, left) and (found := product(tape, operation, left, right)):
                return found
            inner, operands, _, _ = tape.steps[left]
            if left in used_once.results and inner in ("add", "sub"):
                alike = "add" if inner == operation else "sub"
                if is_product(tape, operands[1]) and (
                    found := product(tape, alike, operands[1], right)
                ):
                    return tape.applied(inner, operands[0], found)
        return tape.applied(operation, *nodes)

    return drop_dead_steps(_rebuilt(program, rule, used_once.note))


def share_factors(program: Program) -> Program:
    """Rewrite a·(b·x) and a·(b·y) as (a·b)·x and (a·b)·y, so that a·b is computed once.

    Only intermediate products that are used once are taken apart. Of several such pairs in a
    product the one that occurs most often is taken, of equals the first. If that makes an output
    more expensive, the program is left as it is.
    """
    uses = _uses(program)
    inner: set[int] = set()
    factors: dict[int, list[int]] = {}
    for i, (operation, operands, _, _) in enumerate(program.steps):
        if operation != "mul" or operands[0] == operands[1]:
            continue  # a square is a factor by itself
        parts: list[int] = []
        for node in operands:
            if uses[node] == 1 and 0 < len(factors.get(node, ())) < MOST_FACTORS:
                inner.add(node)
                parts += factors[node]
            else:
                parts.append(node)
        factors[i] = parts
    products = {i: parts for i, parts in factors.items() if i not in inner}
    own = _own(program)
    # Other outputs do not read what the derivative has computed, unless they compute it again.
    found = {
        of: Counter(p for i, each in products.items() if (i in own) == of for p in _pairs(each))
        for of in (False, True)
    }
    plans = {}
    for i, parts in products.items():
        if len(parts) < 3 or not _pairs(parts):
            continue
        often = found[i in own]
        pair = max(_pairs(parts), key=often.__getitem__)
        if often[pair] > 1:
            rest = list(parts)
            for factor in pair:
                rest.remove(factor)
            plans[i] = (*pair, *rest)
    if not plans:
        return program

    def rule(tape: Tape, operation: str, nodes: list[int]) -> int:
        return tape.applied(operation, *nodes)

    made = drop_dead_steps(_rebuilt(program, rule, lambda *_: None, plans))
    # What two outputs shared they may now compute in different ways.
    before, after = _costs(program), _costs(made)
    return made if all(after[name] <= before[name] for name in before) else program


def _pairs(factors: Sequence[int]) -> list[tuple[int, int]]:
    """The pairs of different factors, each with the earlier step first."""
    return sorted({(min(p), max(p)) for p in combinations(factors, 2) if p[0] != p[1]})


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
    share_factors,
)


def _uses(program: Program) -> list[int]:
    """How often each step is an operand or an output entry; of the derivative's steps, how often
    within the derivative, which is computed by itself and more often than all else.
    """
    uses = [0] * len(program.steps)
    own = _own(program)
    for i, step in enumerate(program.steps):
        for o in step.operands:
            uses[o] += i in own or o not in own
    for name, output in program.outputs.items():
        for n in output.nodes:
            uses[n] += name == FIRST or n not in own
    return uses


def _own(program: Program) -> set[int]:
    """The steps of the derivative."""
    first = program.outputs.get(FIRST)
    return set(live_steps(program, first.nodes)) if first else set()


def _costs(program: Program) -> dict[str, int]:
    """Operations of each output."""
    return {name: cost(program, name)["total"] for name in program.outputs}


def _rebuilt(
    program: Program,
    rule: Rule,
    note: Callable[[int, str, int], None],
    products: Mapping[int, Sequence[int]] = MappingProxyType({}),
) -> Program:
    """The program recorded on a new tape, each operation by `rule`; `note` gets each step. The
    `products` are recorded as those of the given steps, from the left.
    """
    tape = Tape()
    new: list[int] = []
    for i, (operation, operands, stage, value) in enumerate(program.steps):
        if operation == "constant":
            node = tape.number(float(value or 0.0))
        elif operation == "input":
            node = tape.input(str(value), stage).index
        elif i in products:
            node = reduce(partial(tape.applied, "mul"), [new[o] for o in products[i]])
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
