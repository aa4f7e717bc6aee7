"""Rewriting of a program that needs fewer operations afterwards; see `passes`."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce
from itertools import combinations
from types import MappingProxyType
from typing import Any, Generic, TypeVar

from eomgen.program.program import Output, Program, finish, live_steps
from eomgen.program.tape import ExactTape, Stage, Step, Tape

Found = TypeVar("Found")
MOST_FACTORS = 8
"""Products of this many factors are not taken apart."""
MOST_TRIED = 1000
"""Steps of a program up to which `take_apart_shared` tries what may help."""


@dataclass(frozen=True)
class Rule(Generic[Found]):
    """Another way to compute an operation on steps.

    operations  the operations, of two operands each, that it is for
    once        the results of these that are used exactly once, which rewriting keeps up to date
    find        what is to be done about an operation and its operands among steps, or None
    make        records that on a tape and returns the step of the result
    """

    operations: frozenset[str]
    once: set[int]
    find: Callable[[Sequence[Step], str, tuple[int, int]], Found | None]
    make: Callable[[Tape, str, Found], int]


class Steps:
    """Steps in order, none twice."""

    def __init__(self) -> None:
        self.all: list[Step] = []
        self._index: dict[tuple[Any, ...], int] = {}

    def put(self, step: Step) -> int:
        """The index of a step, which is added unless there is an equal one."""
        operation, operands, _, value = step  # the stage follows from these, and is slow to hash
        found = self._index.setdefault((operation, operands, value), len(self.all))
        if found == len(self.all):
            self.all.append(step)
        return found

    def apply(self, operation: str, *operands: int) -> int:
        """The index of an operation on steps, as it stands."""
        stage = max([self.all[o].stage for o in operands])
        return self.put(Step(operation, operands, stage))

    def copied(self, program: Program) -> list[int]:
        """The index of each step of a program."""
        new: list[int] = []
        for operation, operands, stage, value in program.steps:
            new.append(self.put(Step(operation, tuple([new[o] for o in operands]), stage, value)))
        return new


def without_dead_steps(program: Program) -> Program:
    """A program without steps that no output and no check needs."""
    roots = [n for output in program.outputs.values() for n in output.nodes]
    keep = live_steps(program, [*roots, *(check.node for check in program.checks)])
    if len(keep) == len(program.steps):
        return program
    first = next(i for i, old in enumerate([*keep, -1]) if i != old)
    steps = list(program.steps[:first])
    new = [*range(first), *[-1] * (len(program.steps) - first)]
    for i, old in enumerate(keep[first:], first):
        new[old] = i
        operation, operands, stage, value = program.steps[old]
        steps.append(Step(operation, tuple([new[o] for o in operands]), stage, value))
    names = {i: name for i, name in program.names.items() if new[i] >= 0}
    return renumbered(replace(program, names=names), steps, new)


def renumbered(program: Program, steps: Sequence[Step], new: Sequence[int]) -> Program:
    """A program with other steps: `new` is for each old step the one that has its value."""
    names: dict[int, str] = {}
    for i, name in program.names.items():
        names.setdefault(new[i], name)
    return Program(
        tuple(steps),
        {k: Output(o.shape, tuple(new[n] for n in o.nodes)) for k, o in program.outputs.items()},
        names,
        tuple(replace(check, node=new[check.node]) for check in program.checks),
    )


def gather_parameters(program: Program) -> Program:
    """Rewrite k·(x·(l·y)) as (k·l)·(x·y) and k + (x + l) as (k + l) + x.

    Operands that depend on parameters alone are combined, so that they are computed once and not at
    every call. Only intermediate results that are used once are taken apart.
    """
    return _gathered(program, shared=False)


def _gathered(program: Program, *, shared: bool) -> Program:
    """`gather_parameters`; `shared` takes k·x apart in l·(k·x) even if k·x is used elsewhere."""
    once = set[int]()

    def is_inner(steps: Sequence[Step], operation: str, node: int) -> bool:
        inner, operands, _, _ = steps[node]
        if inner != operation:
            return False
        return node in once or (
            shared and any(steps[o].stage <= Stage.PARAMETERS for o in operands)
        )

    def find(
        steps: Sequence[Step], operation: str, nodes: tuple[int, int]
    ) -> tuple[list[int], list[int]] | None:
        """The factors, or terms, that are parameters, and the others."""
        left, right = nodes
        if steps[left][0] != operation and steps[right][0] != operation:
            return None
        inner = partial(is_inner, steps, operation)
        if not (inner(left) or inner(right)):
            return None
        parts = _flattened(steps, nodes, inner)
        fixed = [n for n in parts if steps[n].stage <= Stage.PARAMETERS]
        if len(fixed) < 2 or len(parts) == len(fixed):
            return None
        return fixed, [n for n in parts if steps[n].stage > Stage.PARAMETERS]

    def make(tape: Tape, operation: str, found: tuple[list[int], list[int]]) -> int:
        combine = partial(tape.combined, operation)
        return combine(*(reduce(combine, parts) for parts in found))

    return _rebuilt(program, Rule(frozenset(("mul", "add")), once, find, make))


def _flattened(
    steps: Sequence[Step], nodes: Sequence[int], is_inner: Callable[[int], bool]
) -> list[int]:
    """The operands of nested products, or sums."""
    parts: list[int] = []
    stack = list(nodes[::-1])
    while stack:
        node = stack.pop()
        if is_inner(node):
            stack += reversed(steps[node].operands)
        else:
            parts.append(node)
    return parts


def factor_sums(program: Program) -> Program:
    """Rewrite a·x ± a·y as a·(x ± y), and (s ± a·x) ± a·y as s ± a·(x ± y), where the products and
    the inner sum are not used elsewhere.

    Rounding errors keep their size: it is that of the largest term, before and after.
    """
    return _factored(program, shared=False)


def _factored(program: Program, *, shared: bool) -> Program:
    """`factor_sums`; with `shared`, one of the two products may be used elsewhere."""
    once = set[int]()

    def common(steps: Sequence[Step], left: int, right: int) -> tuple[int, int, int] | None:
        """a, x, y of the products a·x and a·y; None if they are not, or have no common a."""
        if not steps[left].operation == steps[right].operation == "mul":
            return None
        if (left in once) + (right in once) < 2 - shared:
            return None
        a, b = steps[left].operands, steps[right].operands
        factor = next((i for i in a if i in b), None)
        if factor is None:
            return None
        x, y = (o[0] if o[1] == factor else o[1] for o in (a, b))
        return factor, x, y

    def find(
        steps: Sequence[Step], operation: str, nodes: tuple[int, int]
    ) -> tuple[tuple[int, int, int], Step | None] | None:
        """a, x, y; and the sum s ± a·x if it is one."""
        left, right = nodes
        if operation == "mul" or steps[right][0] != "mul":
            return None
        if products := common(steps, left, right):
            return products, None
        inner = steps[left]
        if left not in once or inner.operation not in ("add", "sub"):
            return None
        products = common(steps, inner.operands[1], right)
        return products and (products, inner)

    def make(tape: Tape, operation: str, found: tuple[tuple[int, int, int], Step | None]) -> int:
        (factor, x, y), inner = found
        if inner is None:
            return tape.combined("mul", factor, tape.combined(operation, x, y))
        alike = "add" if inner.operation == operation else "sub"
        product = tape.combined("mul", factor, tape.combined(alike, x, y))
        return tape.combined(inner.operation, inner.operands[0], product)

    return _rebuilt(program, Rule(frozenset(("mul", "add", "sub")), once, find, make))


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
    often = Counter(pair for parts in products.values() for pair in _pairs(parts))
    plans: dict[int, Sequence[int]] = {}
    for i, parts in products.items():
        if len(parts) < 3 or not _pairs(parts):
            continue
        pair = max(_pairs(parts), key=often.__getitem__)
        if often[pair] > 1:
            rest = list(parts)
            for factor in pair:
                rest.remove(factor)
            plans[i] = (*pair, *rest)
    if not plans:
        return program

    made = _rebuilt(program, Rule(frozenset(), set(), lambda *_: None, lambda *_: 0), plans)
    # What two outputs shared they may now compute in different ways.
    pairs = program.operations.items()
    return made if all(made.operations[name] <= count for name, count in pairs) else program


def take_apart_shared(program: Program) -> Program:
    """Gather parameters and factor sums also where a product is used elsewhere, and is computed
    again in its old form; the shortest program found. Only for small programs.
    """
    if len(program.steps) > MOST_TRIED:
        return program
    best = program
    plain, taken = (_gathered(program, shared=shared) for shared in (False, True))
    ways = ((taken, False), (plain, True), *([] if taken is plain else [(taken, True)]))
    for gathered, shared in ways:
        made = share_factors(_factored(gathered, shared=shared))
        if _operations(made) < _operations(best):
            best = made
    return best


def _operations(program: Program) -> int:
    return sum(program.operations.values())


def absorb_minus_signs(program: Program) -> Program:
    """Rewrite -(k·x) as (-k)·x, and -(y + k·x) as (-k)·x - y, where k depends on parameters alone,
    so that -k is computed once, and the product and the sum are not used elsewhere.

    It is the last pass: a tape moves minus signs outwards again.
    """
    if not any(s[0] == "neg" and s[2] > Stage.PARAMETERS for s in program.steps):
        return program
    uses, once, steps = _uses(program), set[int](), Steps()

    def opposite(i: int) -> int | None:
        """Minus a step, in as many operations as the step itself; None if it takes more."""
        operation, operands, stage, _ = steps.all[i]
        if stage <= Stage.PARAMETERS:
            return steps.apply("neg", i)
        if i not in once or operation not in ("mul", "div", "add"):
            return None
        left, right = operands
        if (found := opposite(left)) is not None:
            return steps.apply("sub" if operation == "add" else operation, found, right)
        if (found := opposite(right)) is None:
            return None
        if operation == "add":
            return steps.apply("sub", found, left)
        return steps.apply(operation, left, found)

    new: list[int] = []
    for i, (operation, operands, stage, value) in enumerate(program.steps):
        found = None
        if operation == "neg" and stage > Stage.PARAMETERS:
            found = opposite(new[operands[0]])
        if found is None:
            found = steps.put(Step(operation, tuple([new[o] for o in operands]), stage, value))
        if uses[i] == 1:
            once.add(found)
        new.append(found)
    return without_dead_steps(renumbered(program, steps.all, new))


def _pairs(factors: Sequence[int]) -> list[tuple[int, int]]:
    """The pairs of different factors, each with the earlier step first."""
    return sorted({(min(p), max(p)) for p in combinations(factors, 2) if p[0] != p[1]})


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


def _rebuilt(
    program: Program, rule: Rule[Any], products: Mapping[int, Sequence[int]] = MappingProxyType({})
) -> Program:
    """The program recorded on a new tape, each operation by `rule` if that finds something; itself
    if it finds nothing. The `products` are recorded as those of the given steps, from the left.
    """
    old, start = program.steps, 0
    uses, operations, once, find = _uses(program), rule.operations, rule.once, rule.find
    for start, (operation, operands, _, _) in enumerate(old):
        if start in products:
            break
        if operation in operations:
            a, b = operands
            if find(old, operation, (a, b)) is not None:
                break
            if uses[start] == 1:
                once.add(start)
    else:
        return program
    tape = ExactTape.continued(old[:start])
    tape.names |= {i: name for i, name in program.names.items() if i < start}
    steps, combined, names = tape.steps, tape.combined, program.names
    new = list(range(start))
    for i, (operation, operands, stage, value) in enumerate(old[start:], start):
        if i in products:
            node = reduce(partial(combined, "mul"), [new[o] for o in products[i]])
        elif operation in operations:
            a, b = operands
            a, b = new[a], new[b]
            found = find(steps, operation, (a, b))
            node = combined(operation, a, b) if found is None else rule.make(tape, operation, found)
        elif operands:
            node = tape.applied(operation, *[new[o] for o in operands])
        elif operation == "constant":
            node = tape.number(float(value or 0.0))
        else:
            node = tape.input(str(value), stage).index
        if i in names:
            tape.names.setdefault(node, names[i])
        if operations and steps[node][0] in operations:
            if uses[i] == 1:
                once.add(node)
            else:
                once.discard(node)
        new.append(node)
    outputs = {
        name: Output(output.shape, tuple([new[n] for n in output.nodes]))
        for name, output in program.outputs.items()
    }
    checks = (replace(check, node=new[check.node]) for check in program.checks)
    return without_dead_steps(finish(tape, outputs, checks))
