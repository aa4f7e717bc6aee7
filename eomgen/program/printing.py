"""Printing of programs as source code: variable names, inlining, parentheses."""

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, count

from eomgen.program.program import Program, live_steps
from eomgen.program.tape import ARITHMETIC, FUNCTIONS, Stage, Step

SYMBOLS = {"add": "+", "sub": "-", "mul": "*", "div": "/"}
LONGEST_INLINE = 72
"""Longest expression, in characters, that is inlined where its value is used once."""
_SUM, _PRODUCT, _ATOM = 1, 2, 3
"""Precedence levels of expressions."""


@dataclass(frozen=True)
class Dialect:
    """How a language spells each function, its reserved words, and the format of a number.

    assigned  functions whose value is always assigned to a variable
    fused     functions of (a, b, c) that compute a b + c, a b - c and c - a b with one rounding;
              they are called for products that are used nowhere else; none if empty
    """

    functions: Mapping[str, str]
    reserved: frozenset[str]
    number: str = "{}"
    assigned: frozenset[str] = frozenset()
    fused: tuple[str, ...] = ()


@dataclass(frozen=True)
class Block:
    """Source code that computes some results.

    lines      assignments in order, (variable, expression)
    results    an expression for each result
    constants  nodes that depend on parameters alone and are read by name
    inputs     names of the other inputs that are read
    functions  names of the functions that are called
    nodes      nodes that the lines assign
    taken      nodes that are read from another block

    Nodes and names are in the order of the program.
    """

    lines: tuple[tuple[str, str], ...]
    results: tuple[str, ...]
    constants: tuple[int, ...]
    inputs: tuple[str, ...]
    functions: tuple[str, ...]
    nodes: tuple[int, ...]
    taken: tuple[int, ...]


class Names:
    """Unique variable names for the nodes of a program, assigned when first requested."""

    def __init__(self, program: Program, dialect: Dialect) -> None:
        self._program = program
        self._dialect = dialect
        self._names: dict[int, str] = {}
        self._next: dict[str, int] = {}
        self._taken = {self.safe(str(s.value)) for s in program.steps if s.operation == "input"}

    def safe(self, name: str) -> str:
        """A name of the scene as a variable: a reserved word gets a trailing underscore."""
        # No name of a scene ends in an underscore, so this makes no duplicate.
        return f"{name}_" if name in self._dialect.reserved else name

    def __getitem__(self, node: int) -> str:
        if node not in self._names:
            step = self._program.steps[node]
            if step.operation == "input":
                self._names[node] = self.safe(str(step.value))
            else:
                self._names[node] = self._fresh(node)
        return self._names[node]

    def _fresh(self, node: int) -> str:
        wanted = self._program.names.get(node) or self._described(node)
        if wanted is None:
            stem, number = ("k" if self._program.steps[node].stage <= Stage.PARAMETERS else "s"), 1
        else:
            stem, number = self.safe(wanted), 2
            if stem not in self._taken:
                self._taken.add(stem)
                return stem
            stem += "_"
        # Continue from the last number used: a large program has thousands of such names.
        numbers = count(self._next.get(stem, number))
        unused = next(n for n in numbers if f"{stem}{n}" not in self._taken)
        self._next[stem] = unused + 1
        name = f"{stem}{unused}"
        self._taken.add(name)
        return name

    def _described(self, node: int) -> str | None:
        """A name such as `sin_theta` or `theta_dot_squared`; None unless the step is as simple."""
        step = self._program.steps[node]
        if step.operation in FUNCTIONS and len(step.operands) == 1:
            words = self._terms(step.operands[0])
            return None if words is None else "_".join((step.operation, *words))
        if step.operation == "mul" and step.operands[0] == step.operands[1]:
            factor = self._program.steps[step.operands[0]]
            name = self._program.names.get(step.operands[0])
            if factor.operation == "input":
                name = str(factor.value)
            return None if name is None else f"{name}_squared"
        return None

    def _terms(self, node: int) -> tuple[str, ...] | None:
        """The names of a node's summands; None if one has no name."""
        step = self._program.steps[node]
        if step.operation == "input":
            return (str(step.value),)
        if node in self._program.names:
            return (self._program.names[node],)
        if step.operation == "add":
            left, right = (self._terms(o) for o in step.operands)
            return None if left is None or right is None else left + right
        return None


def given_in(
    program: Program, known: Collection[int] = (), *, fixed: bool = False
) -> Callable[[int], bool]:
    """Whether the value of a step is read by name: an input, one of `known`, and unless `fixed`
    also what depends on parameters alone. Constants are written out.
    """
    steps = program.steps

    def is_given(i: int) -> bool:
        operation, _, stage, _ = steps[i]
        if operation == "constant":
            return False
        return i in known or operation == "input" or (not fixed and stage <= Stage.PARAMETERS)

    return is_given


def print_block(
    program: Program,
    nodes: Sequence[int],
    names: Names,
    dialect: Dialect,
    *,
    fixed: bool = False,
    keep: Sequence[int] = (),
    known: Collection[int] = (),
) -> Block:
    """The source that computes `nodes`.

    fixed  whether to compute what depends on parameters alone, instead of reading it by name
    keep   nodes that get a variable even if they are used once
    known  nodes that another block computes and this one reads by name
    """
    steps = program.steps
    is_given = given_in(program, known, fixed=fixed)
    live = live_steps(program, nodes, is_given)
    given = {i for i in live if is_given(i)}
    uses = Counter(nodes)
    uses.update(chain.from_iterable(steps[i].operands for i in live if i not in given))
    results, kept = frozenset(nodes), frozenset(keep)
    moving = [i for i in live if i not in given]
    single = {o for o, count in uses.items() if count == 1} - given - kept
    products = _products(program, moving, single) if dialect.fused else frozenset()
    text: dict[int, tuple[str, int]] = {}
    sources: dict[int, str] = {}
    for i in live:
        step = steps[i]
        if step.operation == "constant":
            text[i] = (dialect.number.format(repr(float(step.value or 0.0))), _ATOM)
            continue
        if i in given:
            text[i] = (names[i], _ATOM)
            continue
        source, level = _source(program, i, products, text, dialect)
        long = len(source) > LONGEST_INLINE and i not in results and i not in products
        if i in kept or uses[i] > 1 or long or step.operation in dialect.assigned:
            sources[i] = source
            text[i] = (names[i], _ATOM)
        else:
            text[i] = (source, level)
    operations = (steps[i].operation for i in moving)
    read = [i for i in live if steps[i].operation == "input" and steps[i].stage > Stage.PARAMETERS]
    return Block(
        lines=tuple((names[i], source) for i, source in sources.items()),
        results=tuple(text[n][0] for n in nodes),
        constants=tuple(i for i in live if i in given and steps[i].stage <= Stage.PARAMETERS),
        inputs=tuple(str(steps[i].value) for i in read),
        functions=tuple(dict.fromkeys(f for f in operations if f in FUNCTIONS)),
        nodes=tuple(sources),
        taken=tuple(i for i in live if i in known),
    )


def _source(
    program: Program,
    i: int,
    products: Collection[int],
    text: Mapping[int, tuple[str, int]],
    dialect: Dialect,
) -> tuple[str, int]:
    """The expression of a step and its precedence; one of its `products` is fused with the sum."""
    step = program.steps[i]
    product = next((o for o in step.operands if o in products), None)
    if product is not None and step.operation in ("add", "sub"):
        factors = [text[o] for o in program.steps[product].operands]
        return _fused(step, product, factors, text, dialect)
    return _expression(step.operation, [text[o] for o in step.operands], dialect)


def _products(program: Program, moving: Iterable[int], single: Collection[int]) -> frozenset[int]:
    """The products among `single`, nodes that are used once, which are terms of `moving` sums."""
    steps = program.steps
    sums = (steps[i] for i in moving if steps[i].operation in ("add", "sub"))
    terms = (o for step in sums for o in step.operands)
    return frozenset(o for o in terms if o in single and steps[o].operation == "mul")


def _fused(
    step: Step,
    product: int,
    factors: Sequence[tuple[str, int]],
    text: Mapping[int, tuple[str, int]],
    dialect: Dialect,
) -> tuple[str, int]:
    """The same for a sum or a difference of which one operand is a product of `factors`."""
    a, b = factors
    c = text[next(o for o in step.operands if o != product)]
    add, less, from_other = dialect.fused
    first = step.operands[0] == product
    called = add if step.operation == "add" else less if first else from_other
    return f"{called}({a[0]}, {b[0]}, {c[0]})", _ATOM


def _expression(
    operation: str, operands: Sequence[tuple[str, int]], dialect: Dialect
) -> tuple[str, int]:
    """The source of one operation on operands given as (source, level), and its precedence level.

    Parentheses keep the program's order of evaluation: a + (b + c) is not written as a + b + c.
    """
    if operation in FUNCTIONS:
        return f"{dialect.functions[operation]}({', '.join(o[0] for o in operands)})", _ATOM
    if operation == "neg":
        source, level = operands[0]
        return (f"-{source}" if level >= _PRODUCT else f"-({source})"), _PRODUCT
    assert operation in ARITHMETIC
    level = _SUM if operation in ("add", "sub") else _PRODUCT
    (left, left_level), (right, right_level) = operands
    if left_level < level:
        left = f"({left})"
    if right_level <= level:
        right = f"({right})"
    return f"{left} {SYMBOLS[operation]} {right}", level
