"""What expressions of the engine's text are: evaluated where they are known, else typed, and
written entry by entry in the words of a language.
"""

import ast
import operator
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from typing import Any, NamedTuple, TypeVar

from eomgen.subset.languages import OF_NUMBERS, Language
from eomgen.subset.text import (
    NONE,
    Kind,
    NotInSubsetError,
    Text,
    is_known,
    own_name,
)

OPERATORS: dict[type, str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.FloorDiv: "//", ast.Mod: "%",
    ast.Lt: "<", ast.Gt: ">", ast.LtE: "<=", ast.GtE: ">=", ast.Eq: "==",
    ast.NotEq: "!=", ast.And: "and", ast.Or: "or", ast.USub: "-", ast.Not: "not",
}  # fmt: skip
OF_KNOWN: dict[str, Callable[..., Any]] = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv,
    "//": operator.floordiv, "%": operator.mod, "<": operator.lt,
    ">": operator.gt, "<=": operator.le, ">=": operator.ge, "==": operator.eq, "!=": operator.ne,
    "range": range, "len": len, "abs": abs,
}  # fmt: skip
"""What is computed of values that are known."""
CHOSEN, DECIDED, COMPARED, SIGNED, TIGHT = 0, 1, 2, 5, 6
LEVELS = {"and": DECIDED, "or": DECIDED, "+": 3, "-": 3, "*": 4, "/": 4}
"""How closely operators bind, others as comparisons do: what is looser than its place needs
parentheses.
"""
FUNCTIONS = {"abs", "isfinite", "next_after", "uniform", *OF_NUMBERS}
"""Those of numbers."""
ZERO = {"zeros": 0.0, "numbers": 0.0, "counts": 0}
"""What new arrays have."""
EVERYWHERE = "everywhere"
"""The place of what a function reads of an array that it is given."""
Read = tuple[str, str]
T = TypeVar("T")
_UNKNOWN = object()


class Value(NamedTuple):
    """What an expression is.

    of       "float", "int", "" for nothing, or the name of a record or a protocol
    entry    writes it; of an array, the entry at some indices
    sizes    those of an array
    level    how closely what is written binds
    reads    names and arrays that it reads, each with the place where a part of it begins
    known    its value, if it is known
    base     the name of which it is the value, or a part, and its place
    """

    of: str
    entry: Callable[["Indices"], str]
    sizes: tuple["Value", ...] = ()
    level: int = TIGHT
    reads: frozenset[Read] = frozenset()
    known: Any = _UNKNOWN
    base: str = ""
    place: str = ""

    @property
    def is_known(self) -> bool:
        """Whether it has a value when the text is printed."""
        return self.known is not _UNKNOWN

    @property
    def text(self) -> str:
        """A number, as it is written."""
        return self.entry(())

    def within(self, level: int, at: "Indices" = ()) -> str:
        """Its entry as a part of what binds as closely as this."""
        return f"({self.entry(at)})" if self.level < level else self.entry(at)


Indices = Sequence[Value]


def number(of: str, text: str) -> Value:
    """A number that is written so."""
    return Value(of, lambda _: text)


class Expressions:
    """The values of expressions in a function of the text. `make` prints another
    function of the text. `altered` are the arrays that functions change.
    """

    def __init__(self, text: Text, to: Language, name: str, make: Callable[..., Any]) -> None:
        self.text, self.to, self.make = text, to, make
        self.d, self.module = text.functions[name], text.modules.get(name, NONE)
        self.names: dict[str, Value] = {}
        self.altered: set[str] = set()

    def of(self, e: ast.expr) -> Value:
        """What an expression is. Raises `NotInSubsetError`."""
        match e:
            case ast.Constant(bool() | int() | float() as x):
                return self.known(e, x)
            case ast.Name(name):
                return self._named(e, name)
            case ast.Attribute(owner, name):
                return self._field(e, self.of(owner), name)
            case ast.Subscript(whole, index):
                return self._part(e, self.of(whole), index)
            case ast.BinOp(left, op, right) | ast.Compare(left, [op], [right]) if (
                type(op) in OPERATORS
            ):
                return self.both(e, OPERATORS[type(op)], self.of(left), self.of(right))
            case ast.UnaryOp(ast.USub() | ast.Not() as op, x):
                return self._turned(e, OPERATORS[type(op)], self.of(x))
            case ast.BoolOp(op, parts):
                return self._decided(e, OPERATORS[type(op)], parts)
            case ast.IfExp(test, a, b):
                found = self.of(test)
                if found.is_known:
                    return self.of(a if found.known else b)
                return self._chosen(e, found, self.of(a), self.of(b))
            case ast.Call(ast.Name("added"), [ast.GeneratorExp(each, [terms])]):
                return self._added(e, each, terms)
            case ast.Call(ast.Name("combined"), [row, k]):
                return self._combined(e, row, k)
            case ast.Call(ast.Name(name), args, []):
                return self._called(e, name, args)
            case ast.Call(_, _, []) if given := self.given(e):
                return self._call(e, *given)
        raise NotInSubsetError(e, "not in the subset")

    def wrong(self, name: str, why: str) -> NotInSubsetError:
        """An error in what a name of the function is."""
        return NotInSubsetError(ast.copy_location(ast.Name(name), self.d), why)

    def needed(self, e: ast.expr, why: str) -> Any:
        """The value of an expression that must be known."""
        found = self.of(e)
        if not found.is_known:
            raise NotInSubsetError(e, why)
        return found.known

    def known(self, e: ast.AST, x: Any) -> Value:
        """What is known; if it is a number, it can be written."""
        if not isinstance(x, int | float):
            return self.unwritten(e, "not a number", "", ())._replace(known=x)
        of, shown = "int" if isinstance(x, int) else "float", repr(+x)
        if shown.endswith("inf"):
            shown = shown.replace("inf", self.to.names.get("inf", "inf"))
        elif of == "float":
            shown = self.to.literal.format(shown)
        return number(of, shown)._replace(level=SIGNED if x < 0 else TIGHT, known=x)

    def unwritten(self, e: ast.AST, why: str, of: str, values: Indices, *sizes: Value) -> Value:
        """What has a kind but no entries to be written."""

        def entry(_: Indices) -> str:
            raise NotInSubsetError(e, why)

        return Value(of, entry, sizes, reads=_reads(values))

    # ---- numbers and arrays, entry by entry ----

    def both(self, e: ast.AST, op: str, a: Value, b: Value) -> Value:
        """Two values with an operator between them."""
        if a.is_known and b.is_known and op in OF_KNOWN:
            return self.known(e, OF_KNOWN[op](a.known, b.known))
        of = _common(e, a, b)
        if of == "int" and not (a.sizes or b.sizes):  # places of entries are such sums
            if op == "*" and a.known == 0:
                return a
            if (op == "+" and a.known == 0) or (op in ("+", "-") and b.known == 0):
                return b if a.known == 0 else a
        if op in ("//", "%") or (op == "/" and of == "int"):
            raise NotInSubsetError(e, "a quotient of whole numbers")
        level = LEVELS.get(op, COMPARED)
        shown = f"{{}} {self.to.words.get(op, op)} {{}}"
        parts = (a, level + (level <= COMPARED)), (b, level + 1)
        return self._made(e, of if level > COMPARED else "int", level, shown, *parts)

    def _chosen(self, e: ast.AST, test: Value, a: Value, b: Value) -> Value:
        parts = ((x, DECIDED) for x in (test, a, b))
        return self._made(e, _common(e, a, b), CHOSEN, self.to.words["choice"], *parts)

    def _function(self, e: ast.AST, name: str, of: str, values: Indices) -> Value:
        shown = f"{self.to.names.get(name, name)}({', '.join(['{}'] * len(values))})"
        return self._made(e, of, TIGHT, shown, *((x, CHOSEN) for x in values))

    def _turned(self, e: ast.AST, op: str, x: Value) -> Value:
        if x.is_known:
            return self.known(e, not x.known if op == "not" else -x.known)
        of, level = ("int", DECIDED) if op == "not" else (x.of, SIGNED)
        return self._made(e, of, level, self.to.words.get(op, op) + "{}", (x, TIGHT))

    def _made(
        self, e: ast.AST, of: str, level: int, shown: str, *parts: tuple[Value, int]
    ) -> Value:
        """What is made of numbers, and of the entries of arrays of the same sizes; with the level
        of each part's place.
        """
        values = [x for x, _ in parts]
        sizes = max((x.sizes for x in values), key=len)
        if any(len(x.sizes) not in (0, len(sizes)) for x in values):
            raise NotInSubsetError(e, "arrays of different dimensions")

        def entry(at: Indices) -> str:
            return shown.format(*(x.within(place, at) for x, place in parts))

        return Value(of, entry, sizes, level, _reads(values))

    def _decided(self, e: ast.AST, op: str, parts: Iterable[ast.expr]) -> Value:
        """Parts that are not known, up to one that decides."""
        found = self.known(e, op == "and")
        for part in map(self.of, parts):
            decides = part.is_known and bool(part.known) == (op == "or")
            if found.is_known:
                found = part
            elif decides or not part.is_known:
                found = self.both(e, op, found, part)
            if decides:
                break
        return found

    def _added(self, e: ast.AST, each: ast.expr, terms: ast.comprehension) -> Value:
        values = self.needed(terms.iter, "the terms are not known")
        total, *rest = (self.bound(terms.target, x, lambda: self.of(each)) for x in values)
        for term in rest:
            total = self.both(e, "+", total, term)
        return total

    def _combined(self, e: ast.AST, row: ast.expr, k: ast.expr) -> Value:
        total = self.known(e, 0.0)
        for j, factor in self.needed(row, "the row is not known"):
            one = self.of(ast.copy_location(ast.Subscript(k, ast.Constant(j)), k))
            total = self.both(e, "+", total, self.both(e, "*", self.known(e, factor), one))
        return total

    def bound(self, target: ast.expr, value: Any, do: Callable[[], T]) -> T:
        """What is done while the names of a target are known."""
        several = isinstance(target, ast.Tuple)
        names, values = (target.elts, value) if several else ([target], [value])  # type: ignore[attr-defined]
        own = {n.id: self.known(target, x) for n, x in zip(names, values, strict=True)}
        before = {name: self.names[name] for name in own if name in self.names}
        self.names |= own
        made = do()
        for name in own:
            del self.names[name]
        self.names |= before
        return made

    # ---- names, fields and parts ----

    def variable(self, name: str, kind: Kind, owner: str = "") -> Value:
        """That of a name or, with dots, of a field of an owner."""
        sizes = (self.of(_parsed(_OWN.sub(owner, size))) for size in kind.sizes)
        return self.stored(name, kind.of, tuple(sizes))

    def stored(self, name: str, of: str, sizes: tuple[Value, ...]) -> Value:
        """The same, with these sizes."""
        place = _all_of(sizes)
        reads = frozenset({(name, place)})
        entry = lambda at: self.entry_of(name, sizes, at)  # noqa: E731
        return Value(of, entry, sizes, reads=reads, base=name, place=place)

    def entry_of(self, name: str, sizes: Indices, at: Indices) -> str:
        """A number, or an entry of an array, whose rows follow one another."""
        shown = name.replace(".", self.to.field)
        if not sizes:
            return shown
        if len(at) != len(sizes):
            raise self.wrong(name, "an array, not a number")
        place, e = at[0], ast.Constant(0)
        for size, index in zip(sizes[1:], at[1:], strict=True):
            place = self.both(e, "+", self.both(e, "*", place, size), index)
        return f"{shown}[{place.text}]"

    def _named(self, e: ast.expr, name: str) -> Value:
        if name in self.names:
            return self.names[name]
        if name.isupper() and name in self.module:
            return self.known(e, self.module[name])
        if name.isupper() or name in ("inf", "nan"):
            return number("int" if name.isupper() else "float", self.to.names.get(name, name))
        raise NotInSubsetError(e, "not in the subset")

    def _field(self, e: ast.expr, owner: Value, name: str) -> Value:
        if owner.is_known:
            return self.known(e, getattr(owner.known, name))
        own = f"{owner.base}.{name}"
        if own not in self.names:
            self.names[own] = self.variable(own, self.text.fields(owner.of)[name], f"{owner.base}.")
        return self.names[own]

    def _part(self, e: ast.Subscript, whole: Value, index: ast.expr) -> Value:
        if whole.is_known:
            return self.known(e, whole.known[self.needed(index, "the index is not known")])
        given = indices(e)
        rest = [ast.Slice()] * (len(whole.sizes) - len(given))
        parts = [self._along(*x) for x in zip([*given, *rest], whole.sizes, strict=True)]
        place = ", ".join(part.place for part in parts)
        if whole.place != _all_of(whole.sizes):
            place = f"{whole.place}; {place}"

        def entry(at: Indices) -> str:
            left = iter(at)
            return whole.entry([part.number(left) for part in parts])

        reads = _reads(x for part in parts for x in part.values) | {(whole.base, place)}
        reads |= whole.reads - {(whole.base, whole.place)}
        sizes = tuple(size for part in parts for size in part.sizes)
        return Value(whole.of, entry, sizes, whole.level, reads, base=whole.base, place=place)

    def _along(self, i: ast.expr, size: Value) -> "_Along":
        if isinstance(i, ast.Slice):
            if i.step:
                raise NotInSubsetError(i, "parts have no steps")
            lower = self.of(i.lower) if i.lower else self.known(i, 0)
            upper = self.of(i.upper) if i.upper else size
            index = lambda at: self.both(i, "+", lower, next(at))  # noqa: E731
            return _Along(lower.text, index, [self.both(i, "-", upper, lower)], [lower, upper])
        chosen = self.of(i)
        if chosen.of != "int":
            raise NotInSubsetError(i, "not a whole number")
        if not chosen.sizes:
            return _Along("", lambda _: chosen, [], [chosen])

        index = lambda at: number("int", chosen.entry([next(at)]))  # noqa: E731
        return _Along(ast.unparse(i), index, [*chosen.sizes], [chosen])

    # ---- calls ----

    def _called(self, e: ast.Call, name: str, args: list[ast.expr]) -> Value:
        if name in self.text.functions:
            return self._of_text(e, name, args)
        values = [self.of(a) for a in args]
        if name in OF_KNOWN and all(x.is_known for x in values):
            return self.known(e, OF_KNOWN[name](*(x.known for x in values)))
        match name, values:
            case ("ordered", [x]) | ("all_within", [x, _]):
                return self.unwritten(e, TO_A_NAME, "float" if name == "ordered" else "int", values)
            case "product", [a, _] if len(a.sizes) == 2:
                return self.unwritten(e, TO_A_NAME, "float", values, a.sizes[0])
            case "rows", [n, m]:
                return self.unwritten(e, TO_A_NAME, "float", values, n, m)
            case "copy", [x]:
                return x._replace(base="")
            case "transposed", [x]:
                entry = lambda at: x.entry(at[::-1])  # noqa: E731
                return x._replace(entry=entry, sizes=x.sizes[::-1], base="")
            case "min" | "max" | "larger", [a, b] if name not in self.to.names:
                return self._chosen(e, self.both(e, "<" if name == "min" else ">", b, a), b, a)
            case "len", [x] if x.sizes:
                return x.sizes[0]
        if name in ZERO:
            zero = self.known(e, ZERO[name])
            return Value(zero.of, zero.entry, tuple(values), reads=_reads(values))
        if name in FUNCTIONS or name in self.to.names:
            return self._function(e, name, "int" if name == "isfinite" else "float", values)
        raise NotInSubsetError(e, "not in the subset, or not known")

    def _of_text(self, e: ast.Call, name: str, args: list[ast.expr]) -> Value:
        """A call of another function of the text."""
        pairs = list(zip(self.text.functions[name].args.args, args, strict=True))
        known = {p.arg: self.needed(a, f"{p.arg} is not known") for p, a in pairs if is_known(p)}
        function = self.make(e, name, known)
        rest = [(p.arg, a) for p, a in pairs if p.arg not in known]
        self.altered |= {self.of(a).base for p, a in rest if p in function.altered}
        return self._call(e, own_name(name, known), function.returns, [a for _, a in rest])

    def given(self, e: ast.Call) -> tuple[str, Kind, list[ast.expr]] | None:
        """The name of a function that the engine is given, what it returns, and its arguments, if
        an expression calls one. One that returns no array may change those that it is given.
        """
        if not isinstance(e.func, ast.Attribute):
            return None
        owner, name = self.of(e.func.value), e.func.attr
        returns = self.text.given(owner.of)[name]
        if not returns.sizes:
            self.altered |= {self.of(a).base for a in e.args}
        if self.to.typed:
            return name, returns, [e.func.value, *e.args]
        return f"{owner.base}.{name}", returns, e.args

    def _call(self, e: ast.Call, name: str, kind: Kind, args: list[ast.expr]) -> Value:
        values = [self.of(a) for a in args]
        if kind.sizes:
            sizes = (self.of(_parsed(size)) for size in kind.sizes)
            return self.unwritten(e, TO_A_NAME, kind.of, values, *sizes)
        passed = {(x.base, EVERYWHERE) for x in values if x.sizes}
        return Value(kind.of, lambda _: self.call(name, args), reads=_reads(values) | passed)

    def call(self, name: str, args: Iterable[ast.expr]) -> str:
        """A call, written."""
        return f"{name}({', '.join(map(self.argument, args))})"

    def argument(self, e: ast.expr) -> str:
        """What a function is given: a number, a record, an array, or a part that lies together,
        which begins where its first entry is.
        """
        value = self.of(e)
        if not value.sizes:
            return value.text
        if isinstance(e, ast.Name | ast.Attribute):
            return value.base.replace(".", self.to.field)
        if not isinstance(e, ast.Subscript):
            raise NotInSubsetError(e, "assign it to a name first")
        if any(isinstance(i, ast.Slice) for i in indices(e)[:-1]):
            raise NotInSubsetError(e, "a part that does not lie together")
        first = value.entry([self.known(e, 0)] * len(value.sizes))
        array, place = first.removesuffix("]").split("[", 1)
        return self.to.part.format(array=array, place=place)


TO_A_NAME = "assign it to a name first"


class _Along(NamedTuple):
    """A part of an array along a dimension: where it begins, "" for a single index; the number of
    one of its entries, from the next of theirs; its size, if it is not a single index; what these
    are made of.
    """

    place: str
    number: Callable[[Iterator[Value]], Value]
    sizes: list[Value]
    values: list[Value]


def indices(e: ast.Subscript) -> list[ast.expr]:
    """The indices of an entry or a part."""
    return e.slice.elts if isinstance(e.slice, ast.Tuple) else [e.slice]


_OWN = re.compile(r"\b(?=[a-z])")
"""Where names of fields begin; sizes that are known for a mechanism have capitals."""


@cache
def _parsed(text: str) -> ast.expr:
    return ast.parse(text, mode="eval").body


def _all_of(sizes: Indices) -> str:
    """The place of a whole array."""
    return ", ".join("0" * len(sizes))


def _common(e: ast.AST, *values: Value) -> str:
    """The kind of what numbers are made to."""
    kinds = {x.of for x in values}
    if not kinds <= {"float", "int"}:
        raise NotInSubsetError(e, "not numbers")
    return "int" if kinds == {"int"} else "float"


def _reads(values: Iterable[Value]) -> frozenset[Read]:
    return frozenset().union(*(x.reads for x in values))
