"""Prints functions of the engine's text: statements in the words of a language.

Array statements of equal length that follow one another become one loop, if each needs nothing of
the others but the same entry; arrays that are used in such loops only are numbers there.
"""

import ast
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from eomgen.subset.languages import RESERVED, Language
from eomgen.subset.text import Kind, NotInSubsetError, Text, is_known, kind_of
from eomgen.subset.values import OPERATORS, Expressions, Indices, Read, Value, number

INDICES = ("i_", "j_")
"""Those of loops over arrays; the text has no names that end so."""
GATHERED = {"ordered": ("0.0", "+"), "all_within": ("1", "&")}
"""What entries are gathered by, one after another: what is begun with, and what is done."""


@dataclass
class Block:
    """Statements between two lines."""

    head: str
    body: list["Item"]
    end: str


@dataclass
class Loop:
    """Statements of entries: to what, by which operator, from what; what is done before; and what
    they read and write.
    """

    sizes: "Sizes"
    entries: list[tuple[Value, str, Value]] = field(default_factory=list)
    before: list["Item"] = field(default_factory=list)
    reads: set[Read] = field(default_factory=set)
    writes: set[Read] = field(default_factory=set)


Sizes = tuple[Value, ...]
Item = str | Block | Loop
PRODUCT = """
for i_ in range(len({a})):
    ({to})[i_] = 0.0
    for j_ in range(len({x})):
        ({to})[i_] += ({a})[i_, j_] * ({x})[j_]
"""
"""A matrix by a vector, row by row."""


class Function(Expressions):
    """The printing of a function with its values of `Known` parameters.

    scalars  arrays that are numbers in loops
    kept     those that are not, because they are read elsewhere
    """

    def __init__(
        self,
        text: Text,
        to: Language,
        name: str,
        known: Mapping[str, Any],
        make: Callable[..., Any],
    ) -> None:
        super().__init__(text, to, name, make)
        d = self.d
        for n in ast.walk(d):
            _check(n)
        self.returns = kind_of(d.returns)
        self.names |= {own: self.known(d, x) for own, x in known.items()}
        given = [a for a in d.args.args if not is_known(a)]
        kinds = {a.arg: kind_of(a.annotation) for a in given}
        for name in sorted(kinds, key=lambda name: len(kinds[name].sizes)):
            self.names[name] = self.variable(name, kinds[name])
        self.arguments = {name: self.names[name] for name in kinds}
        self.locals: dict[str, Value] = {}
        self.items, self.depth = list[Item](), 0
        self.kept, self.scalars = set[str](), set[str]()
        self.body = self.block(d.body)
        self.altered &= {name for name, x in self.arguments.items() if x.sizes}
        self.scalars = {name for name, x in self.locals.items() if x.sizes} - self.kept

    def lines(self, own: str) -> Iterator[str]:
        """Those of its source, with its name."""
        body = list(self.written(self.body))
        arguments = [
            f"{'const ' if x.sizes and name not in self.altered else ''}"
            f"{type_of(x, self.to)}{'restrict ' if x.sizes else ''}{name}"
            for name, x in self.arguments.items()
        ]
        yield self.to.function.format(
            result=type_of(self.returns, self.to).strip(),
            name=own,
            arguments=", ".join(arguments if self.to.typed else self.arguments)
            or "void" * self.to.typed,
        )
        numbers = dict[str, list[str]]()
        for name, x in self.locals.items():
            if not x.sizes:
                numbers.setdefault(type_of(x, self.to), []).append(name)
        yield from (f"    {word}{', '.join(many)};" for word, many in numbers.items())
        yield from (
            "    " + self._room(name, own, x)
            for name, x in self.locals.items()
            if x.sizes and name not in self.scalars
        )
        yield from body
        yield self.to.words["done"]

    def _room(self, name: str, function: str, x: Value) -> str:
        first, *rest = x.sizes
        for size in rest:
            first = self.both(self.d, "*", first, size)
        if late := {base for base, _ in first.reads} & self.locals.keys():
            raise self.wrong(name, f"the size of {name} is known only when {min(late)} is")
        kind = self.to.arrays[x.of == "int"]
        return self.to.array.format(type=kind, function=function, name=name, size=first.text)

    # ---- statements ----

    def block(self, body: Iterable[ast.stmt]) -> list[Item]:
        """What statements become."""
        outside, self.items = self.items, list[Item]()
        self.depth += 1
        self.statements(body)
        self.depth -= 1
        made, self.items = self.items, outside
        return made

    def statements(self, body: Iterable[ast.stmt]) -> None:
        """Add what statements become. Raises `NotInSubsetError` for one of which something is not
        found that the subset needs.
        """
        for s in body:
            try:
                self.statement(s)
            except (AttributeError, LookupError, TypeError, ValueError) as error:
                raise NotInSubsetError(s, "not in the subset") from error

    def statement(self, s: ast.stmt) -> None:
        """Add what a statement becomes."""
        words = self.to.words
        match s:
            case ast.Expr(ast.Constant()) | ast.Pass():
                pass
            case ast.Assign([target], value) | ast.AnnAssign(target, _, ast.expr() as value):
                self._assign(target, "", value)
            case ast.AugAssign(target, ast.Add() | ast.Sub() | ast.Mult() | ast.Div() as op, value):
                self._assign(target, OPERATORS[type(op)], value)
            case ast.Break() | ast.Continue() | ast.Return(None):
                self._line(type(s).__name__.lower())
            case ast.Return(ast.expr() as value):
                self._line("return {}", self.of(value))
            case ast.Expr(ast.Call() as call):
                self._line("{}", self.of(call))
            case ast.For(target, ast.Call(ast.Name("unrolled"), [values]), body, []):
                for value in self.needed(values, "what is unrolled is not known"):
                    self.bound(target, value, lambda: self.statements(body))
            case ast.For(ast.Name(name) as target, ast.Call(ast.Name("range"), args), body, []):
                self._declare(target, Value("int", str))
                start, end, head = self._range(args)
                text = head.format(i=name, start=start.text, end=end.text)
                self._add(text, [start, end], body, words["done"])
                stores = {_stored(n) for s in body for n in ast.walk(s)}
                if stores & {name, *(base for base, _ in start.reads | end.reads)}:
                    raise NotInSubsetError(s.iter, "changes in the loop")
            case ast.While(test, body, []):
                found = self.of(test)
                self._add(words["while"].format(found.text), [found], body, words["done"])
            case ast.If(test, body, orelse):
                found = self.of(test)
                if found.is_known:
                    self.statements(body if found.known else orelse)
                    return
                done = "" if orelse else words["done"]
                self._add(words["if"].format(found.text), [found], body, done)
                if orelse:
                    self._add(words["else"], [], orelse, words["done"])
            case _:
                raise NotInSubsetError(s, "not in the subset")

    def _add(self, head: str, values: Indices, body: list[ast.stmt], end: str) -> None:
        self._keep(values)
        self.items.append(Block(head, self.block(body), end))

    def _line(self, text: str, *values: Value) -> None:
        self._keep(values)
        self.items.append(text.format(*(x.text for x in values)) + self.to.words["end"])

    def _keep(self, values: Iterable[Value]) -> None:
        self.kept |= {base for x in values for base, _ in x.reads}

    def _range(self, args: list[ast.expr]) -> tuple[Value, Value, str]:
        start, end, *rest = args if len(args) > 1 else (ast.Constant(0), *args)
        step = self.of(rest[0] if rest else ast.Constant(1))
        return self.of(start), self.of(end), self.to.words[{1: "range", -1: "back"}[step.known]]

    def _declare(self, name: ast.Name, x: Value) -> None:
        """Give a name the kind of its value."""
        if name.id not in self.names:
            self.names[name.id] = self.locals[name.id] = self.stored(name.id, x.of, x.sizes)
        known = self.names[name.id]
        if known.of != x.of or len(known.sizes) != len(x.sizes):
            raise NotInSubsetError(name, f"{name.id} was of another kind before")

    # ---- assignments ----

    def _assign(self, target: ast.expr, op: str, e: ast.expr) -> None:
        if isinstance(e, ast.List) and isinstance(target, ast.Subscript):
            self._list(self.of(target), e)
            return
        value = self.of(e)
        if isinstance(target, ast.Name) and not op:
            if value.of not in ("float", "int"):
                raise NotInSubsetError(e, "has no value to be assigned, or is not in the subset")
            if value.sizes and isinstance(e, ast.Name | ast.Attribute | ast.Subscript):
                raise NotInSubsetError(e, "would be a second name of it: copy() an array")
            self._declare(target, value)
        to = self.of(target)
        self.altered.add(to.base)
        if to.of == "int" and value.of == "float":
            raise NotInSubsetError(e, "a whole number is expected")
        match e:
            case ast.Call(ast.Name("ordered" | "all_within" as word), [x, *limits]) if not op:
                if to.sizes:
                    raise NotInSubsetError(e, "assign it to a name first")
                entry = self.of(x)
                for limit in limits:
                    entry = self.both(e, "<=", entry, self.of(limit))
                self._check_read(e, to, entry)
                first, op = GATHERED[word]
                start = f"{to.text} = {first}{self.to.words['end']}"
                self.each(entry.sizes, to, op, entry, "in order", start)
            case ast.Call(ast.Name("product"), [a, x]):
                self._check_read(e, to, self.of(a), self.of(x))
                to_, a_, x_ = map(ast.unparse, (target, a, x))
                self.statements(ast.parse(PRODUCT.format(to=to_, a=a_, x=x_)).body)
            case ast.Call(ast.Name("rows")):
                pass
            case ast.Call(ast.Attribute()) if value.sizes and (given := self.given(e)):
                self._keep([to, value])
                self.fill(target, *given)
            case _ if to.sizes:
                if any(base == to.base and place != to.place for base, place in value.reads):
                    raise NotInSubsetError(e, "shifted parts of one array: copy() one of them")
                self.each(to.sizes, to, op, value, to.place)
                if not isinstance(target, ast.Name):
                    self.kept.add(to.base)
            case _:
                self._line(f"{{}} {op}= {{}}", to, value)

    def fill(self, target: ast.expr, name: str, kind: Kind, args: list[ast.expr]) -> None:
        """Call a function that is given and fills an array."""
        self._line(self.call(name, [*args, target]))

    def each(self, sizes: Sizes, to: Value, op: str, x: Value, place: str, *before: Item) -> None:
        """Add a statement of entries to the loop before it, if it may share that."""
        reads = x.reads | (to.reads if op else to.reads - {(to.base, to.place)})
        writes = {(to.base, place)}
        loop = self.items[-1] if self.items else None
        if (
            not isinstance(loop, Loop)
            or [size.text for size in loop.sizes] != [size.text for size in sizes]
            or _differ(loop.writes, reads | writes)
            or _differ(loop.reads, writes)
        ):
            loop = Loop(sizes)
            self.items.append(loop)
        self.kept |= {base for base, _ in reads} - {base for base, _ in loop.writes}
        loop.entries.append((to, op, x))
        loop.before += before
        loop.reads |= reads
        loop.writes |= writes

    def _check_read(self, e: ast.AST, to: Value, *values: Value) -> None:
        if any(base == to.base for x in values for base, _ in x.reads):
            raise NotInSubsetError(e, "would change while it is read")

    def _list(self, to: Value, e: ast.List) -> None:
        """The entries of an array, one after another, or four at a time."""
        values = [self.of(x) for x in e.elts]
        self._check_read(e, to, *values)
        self._keep([to, *values])
        self.altered.add(to.base)
        places = [to.entry([self.known(e, n)]) for n in range(len(values))]
        together = len(values) // 4 * 4 if self.to.listed else 0
        for n in range(0, together, 4):
            entries = ", ".join(x.text for x in values[n : n + 4])
            self.items.append(self.to.listed.format(first=places[n], entries=entries))
        for place, x in zip(places[together:], values[together:], strict=True):
            self._line(f"{place} = {{}}", x)

    # ---- source ----

    def written(self, items: Iterable[Item], depth: int = 1) -> Iterator[str]:
        """The lines of statements."""
        pad = "    " * depth
        for item in items:
            if isinstance(item, str):
                yield pad + item
            elif isinstance(item, Block):
                yield pad + item.head
                yield from self.written(item.body, depth + 1)
                yield from [pad + item.end] * bool(item.end)
            else:
                yield from self.written([*item.before, *self.looped(item)], depth)

    def looped(self, loop: Loop) -> list[Item]:
        """A loop over entries."""
        names = INDICES[-len(loop.sizes) :]
        at = [number("int", name) for name in names]
        lines, declared = list[Item](), set[str]()
        for to, op, x in loop.entries:
            is_new = to.base in self.scalars - declared
            declared.add(to.base)
            word = type_of(to._replace(sizes=()), self.to) if is_new else ""
            lines.append(f"{word}{to.entry(at)} {op}= {x.entry(at)}{self.to.words['end']}")
        for name, size in zip(reversed(names), reversed(loop.sizes), strict=True):
            head = self.to.words["range"].format(i=name, start=0, end=size.text)
            head = head.replace("(", f"({self.to.whole} ", 1)
            lines = [Block(head, lines, self.to.words["done"])]
        return lines

    def entry_of(self, name: str, sizes: Indices, at: Indices) -> str:
        """That of `Expressions`; of an array that is a number in loops, this."""
        return name if name in self.scalars else super().entry_of(name, sizes, at)


def _differ(some: set[Read], others: Iterable[Read]) -> bool:
    """Whether parts of one array are at different places."""
    return any(a == b and i != j for a, i in some for b, j in others)


def type_of(x: Kind | Value, language: Language) -> str:
    """How a type is written before a name."""
    if x.of not in ("float", "int"):
        return f"{x.of} *" if x.of else "void"
    if x.sizes:
        return f"{language.arrays[x.of == 'int']} *"
    return f"{language.whole if x.of == 'int' else language.number} "


def _check(n: ast.AST) -> None:
    name = _stored(n)
    if name in INDICES:
        raise NotInSubsetError(n, "is the name of an index of loops over arrays")
    if name in RESERVED:
        raise NotInSubsetError(n, "is a word of another language")


def _stored(n: ast.AST) -> str:
    """The name that a node gives a value."""
    if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store):
        return n.id
    return n.arg if isinstance(n, ast.arg) else ""
