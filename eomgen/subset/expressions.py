"""Prints expressions of the engine's text, expanded, as C or as JavaScript."""

import ast
import math
from collections.abc import Iterable, Mapping, Sequence

from eomgen.subset.expander import NotInSubsetError, Text, called
from eomgen.subset.kinds import Kind, Kinds, given_function, indices
from eomgen.subset.languages import Language

OPERATORS: dict[type, str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Lt: "<", ast.Gt: ">",
    ast.LtE: "<=", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=", ast.And: "&&", ast.Or: "||",
}  # fmt: skip
STATEMENTS = (
    ast.Assign, ast.AnnAssign, ast.AugAssign, ast.Return, ast.Break, ast.Continue, ast.Pass,
    ast.Expr,
)  # fmt: skip
GATHERED = {"ordered": ("0.0", "+="), "all_within": ("1", "&=")}
"""What entries are gathered by, one after another: what is begun with, and what is done."""
ONE, TWO = ("j_",), ("i_", "j_")
"""The indices of entries in loops over arrays of one dimension and of two; the text has no names
that end so."""


class Expressions:
    """The expressions of a function `d`. Arrays of `scalars` are numbers in loops."""

    def __init__(
        self, text: Text, made: Mapping[str, ast.FunctionDef], d: ast.FunctionDef, to: Language
    ) -> None:
        self.text, self.made, self.d, self.to = text, made, d, to
        self.kinds, self.scalars = Kinds(text, made, d), set[str]()

    def _expr(self, e: ast.expr, at: Sequence[str] = ()) -> str:
        """An expression; of an array, the entry at these indices."""
        match e:
            case ast.Constant(value):
                return self._number(value)
            case ast.Name("inf"):
                return self.to.infinite
            case ast.Name("nan"):
                return self.to.names["nan"]
            case ast.Name() | ast.Attribute() | ast.Subscript():
                return self._entry(e, at)
            case ast.BinOp(left, ast.Pow(), right):
                return f"{self.to.names['pow']}({self._expr(left, at)}, {self._expr(right, at)})"
            case ast.BinOp(left, op, right):
                self.kinds.of(e)
                first = self._expr(left, at)
                if (
                    isinstance(op, ast.Add)
                    and isinstance(left, ast.BinOp)
                    and isinstance(left.op, ast.Add)
                ):
                    first = first[1:-1]
                return f"({first} {OPERATORS[type(op)]} {self._expr(right, at)})"
            case ast.UnaryOp(ast.USub(), x):
                return f"(-{self._expr(x, at)})"
            case ast.UnaryOp(ast.Not(), x):
                return f"(!{self._expr(x)})"
            case ast.Compare(left, [op], [right]):
                return f"({self._expr(left)} {OPERATORS[type(op)]} {self._expr(right)})"
            case ast.BoolOp(op, values):
                return f"({f' {OPERATORS[type(op)]} '.join(map(self._expr, values))})"
            case ast.IfExp(test, a, b):
                return f"({self._expr(test)} ? {self._expr(a, at)} : {self._expr(b, at)})"
            case ast.Call():
                return self._call_of(e, at)
        raise NotInSubsetError(e, "not in the subset")

    def _number(self, value: object) -> str:
        if not isinstance(value, bool | int | float):
            raise NotInSubsetError(ast.Constant(str(value)), "not a number")
        if isinstance(value, bool):
            return str(int(value))
        if math.isinf(value):
            return self.to.infinite if value > 0 else f"(-{self.to.infinite})"
        shown = repr(value) if isinstance(value, int) else self.to.literal.format(repr(value))
        return f"({shown})" if value < 0 else shown

    def _entry(self, e: ast.expr, at: Sequence[str]) -> str:
        """A number, an entry of an array, or a whole array by its name."""
        match e:
            case ast.Name(name):
                self.kinds.of(e)
                kind = self.kinds.of(e)
                return (
                    name
                    if not at or not kind.is_array or name in self.scalars
                    else self._at(name, kind, at)
                )
            case ast.Attribute(ast.Name(owner), name):
                kind, shown = self.kinds.of(e), f"{owner}{self.to.field}{name}"
                return self._at(shown, kind, at) if at and kind.is_array else shown
        assert isinstance(e, ast.Subscript)
        whole, rest, place = self.kinds.of(e.value), list(at), []
        given = indices(e)
        for n in range(len(whole.sizes)):
            i = given[n] if n < len(given) else ast.Slice()
            if isinstance(i, ast.Slice):
                j = rest.pop(0)
                place.append(f"({self._expr(i.lower)} + {j})" if i.lower else j)
            else:
                chosen = [rest.pop(0)] if self.kinds.of(i).is_array else []
                shown = self._expr(i, chosen)
                place.append(bare(shown) if len(whole.sizes) == 1 else shown)
        return self._at(self._entry(e.value, ()), whole, place)

    def _at(self, array: str, kind: Kind, place: Sequence[str]) -> str:
        first, *others = place
        for size, index in zip(kind.sizes[1:], others, strict=True):
            first = f"{first} * {self._factor(size)} + {index}"
        return f"{array}[{bare(first)}]"

    def _argument(self, e: ast.expr) -> str:
        """What a function is given: a number, an array, or a part of one that lies together."""
        kind = self.kinds.of(e)
        if not kind.is_array or not isinstance(e, ast.Subscript):
            return self._expr(e)
        whole, given = self.kinds.of(e.value), indices(e)
        if any(isinstance(i, ast.Slice) for i in given[:-1]) or len(given) < len(whole.sizes) - 1:
            raise NotInSubsetError(e, "a part that does not lie together")
        starts = [i.lower or ast.Constant(0) if isinstance(i, ast.Slice) else i for i in given]
        starts += [ast.Constant(0)] * (len(whole.sizes) - len(given))
        place = self._at("", whole, [self._expr(i) for i in starts])[1:-1]
        return self.to.part.format(array=self._expr(e.value), place=place)

    def _call(self, e: ast.Call, out: str = "") -> str:
        """A call of a function of the engine, or of one that it is given."""
        arguments = [*map(self._argument, e.args), *([out] if out else [])]
        if self._given(e):
            assert isinstance(e.func, ast.Attribute) and isinstance(e.func.value, ast.Name)
            of, name = e.func.value.id, e.func.attr
            if self.to.typed:
                return f"{name}({', '.join([of, *arguments])})"
            return f"{of}.{name}({', '.join(arguments)})"
        if called(e) not in self.made:
            raise NotInSubsetError(e, "not a function of the engine")
        return f"{called(e)}({', '.join(arguments)})"

    def _call_of(self, e: ast.Call, at: Sequence[str]) -> str:
        name, args = called(e), e.args
        if name in self.made or self._given(e):
            if self.kinds.of(e).is_array:
                raise NotInSubsetError(e, "assign it to a name first")
            return self._call(e)
        kind = self.kinds.of(e)
        if name in (*GATHERED, "rows", "product"):
            raise NotInSubsetError(e, "assign it to a name first")
        if name == "copy":
            return self._expr(args[0], at)
        if name in ("zeros", "matrix", "whole"):
            return self._number(0.0)
        if name == "transposed":
            return self._expr(args[0], at[::-1])
        if name == "outer":
            return f"({self._expr(args[0], at[:1])} * {self._expr(args[1], at[1:])})"
        if name in ("min", "max", "larger"):
            a, b = (self._expr(x, at if self.kinds.of(x).is_array else ()) for x in args)
            return f"({b} {'<' if name == 'min' else '>'} {a} ? {b} : {a})"
        if name == "len":
            return self._size(self.kinds.of(args[0]).sizes[0])
        if name == "abs" and kind.of == "int":
            raise NotInSubsetError(e, "of a whole number")
        return (
            f"{self.to.names.get(name, name)}({', '.join(bare(self._expr(a, at)) for a in args)})"
        )

    def _product(self, sizes: Sequence[str]) -> str:
        if len(sizes) == 1:
            return self._size(sizes[0])
        return " * ".join(map(self._factor, sizes))

    def _factor(self, size: str) -> str:
        return size if size.isidentifier() else f"({self._size(size)})"

    def _size(self, text: str) -> str:
        return bare(self._expr(ast.parse(text, mode="eval").body))

    def _given(self, e: ast.expr) -> ast.FunctionDef | None:
        return given_function(e, self.kinds.names, self.text)


def base_of(e: ast.AST) -> str:
    """The array, as text, of which an expression is a part."""
    return ast.unparse(e.value if isinstance(e, ast.Subscript) else e)


def stored(body: Iterable[ast.stmt]) -> set[str]:
    """The names that statements give a value."""
    names = (n for s in body for n in ast.walk(s) if isinstance(n, ast.Name))
    return {n.id for n in names if isinstance(n.ctx, ast.Store)}


def is_whole(e: ast.expr) -> bool:
    """Whether it is a name, or all of an array."""
    match e:
        case ast.Subscript(_, ast.Slice(None, None, None)):
            return True
    return not isinstance(e, ast.Subscript)


def names_in(*nodes: ast.AST) -> set[str]:
    """The names in trees, and the fields of records, as text."""
    found = (n for node in nodes for n in ast.walk(node))
    return {ast.unparse(n) for n in found if isinstance(n, ast.Name | ast.Attribute)}


def bare(text: str) -> str:
    """An expression without the parentheses around all of it."""
    if not (text.startswith("(") and text.endswith(")")):
        return text
    depth = 0
    for i, letter in enumerate(text):
        depth += {"(": 1, ")": -1}.get(letter, 0)
        if depth == 0:
            return text[1:-1] if i == len(text) - 1 else text
    return text
