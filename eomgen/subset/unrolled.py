"""Prints the engine's text, expanded, as Python in which vectors are single numbers.

NumPy takes longer to begin an operation than Python to add a few numbers. Each entry has the
operations of the text in the same order, and so the same bits.
"""

import ast
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

from eomgen.base.loading import load_source
from eomgen.subset.expander import NotInSubsetError, Text, called
from eomgen.subset.kinds import Kind, Kinds, given_function, of_annotation

HEAD = """from math import inf, isfinite, nan, sqrt

from numpy import array

from eomgen.subset.words import next_after
"""
OPERATORS: dict[type, str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
J = "$"
"""Stands for the number of an entry."""


def unrolled_functions(
    text: Text, roots: Iterable[tuple[str, Mapping[str, Any]]], states: int
) -> ModuleType:
    """Functions of the engine, each with values of its `Known` parameters, and all that they call,
    for a number of states. A matrix may be a list of its rows.

    Raises `NotInSubsetError` for text outside the subset.
    """
    functions = text.expanded(roots)
    made = {d.name: d for d in functions}
    printed = (line for d in functions for line in _Function(text, made, d, states).lines())
    return load_source("\n".join((HEAD, *printed, "")), f"engine_of_{states}")


@dataclass
class _Function:
    """The printing of a function. `single` are the vectors of which all entries have names; those
    of an argument that is read before it is written are `read` first.
    """

    text: Text
    made: Mapping[str, ast.FunctionDef]
    d: ast.FunctionDef
    states: int
    out: list[str] = field(default_factory=list)
    single: set[str] = field(default_factory=set)
    read: dict[str, str] = field(default_factory=dict)

    def lines(self) -> list[str]:
        """The lines of its source."""
        self.kinds = Kinds(self.text, self.made, self.d)
        self._block(self.d.body, 1)
        read = (f"    {self._entries(x)} = {whole}.tolist()" for x, whole in self.read.items())
        head = f"def {self.d.name}({', '.join(self.kinds.arguments)}):"
        return [head, *read, *self.out]

    def _entries(self, template: str) -> str:
        """All entries of a vector, as a tuple."""
        return "".join(f"{template.replace(J, str(j))}, " for j in range(self.states)).rstrip()

    def _block(self, body: list[ast.stmt], depth: int) -> None:
        for s in body:
            for line in self._statement(s, depth):
                self.out.append("    " * depth + line)
            if isinstance(s, ast.For | ast.While | ast.If):
                self._block(s.body, depth + 1)
                if s.orelse:
                    self.out.append("    " * depth + "else:")
                    self._block(s.orelse, depth + 1)

    def _statement(self, s: ast.stmt, depth: int) -> Iterable[str]:
        """The lines of a statement, or the head of one that contains others."""
        match s:
            case ast.Assign([target], value):
                if isinstance(target, ast.Name):
                    self.kinds.declare(target.id, value)
                if called(value) == "ordered":
                    assert isinstance(value, ast.Call)
                    yield f"{ast.unparse(target)} = {self._sum(value.args[0])}"
                elif self._is_vector(self.kinds.of(target)):
                    yield from self._vector(target, value)
                    if depth == 1:
                        self.single.add(self._name(target))
                else:
                    yield self._plain(s)
            case ast.For():
                self.kinds.names[ast.unparse(s.target)] = Kind("int")
                yield f"for {ast.unparse(s.target)} in {self._plain(s.iter)}:"
            case ast.While() | ast.If():
                yield f"{type(s).__name__.lower()} {self._plain(s.test)}:"
            case _:
                yield self._plain(s)

    def _is_vector(self, kind: Kind) -> bool:
        return len(kind.sizes) == 1 and kind.of == "float"

    def _plain(self, node: ast.AST) -> str:
        """What has no vectors, but that functions are given whole ones."""
        shown = _WithLengths(self.kinds, self.states).visit(node)
        own = self.kinds.names.keys() - self.kinds.arguments.keys()
        for n in ast.walk(shown):
            if isinstance(n, ast.Name) and n.id in own and self.kinds.names[n.id].is_array:
                raise NotInSubsetError(n, "an array of single numbers is not used whole")
        return ast.unparse(shown)

    def _sum(self, x: ast.expr) -> str:
        entry = self._entry(x)
        return " + ".join(["0.0", *(entry.replace(J, str(j)) for j in range(self.states))])

    def _vector(self, target: ast.expr, value: ast.expr) -> Iterable[str]:
        """The assignment of a vector, or of a row of a matrix, by its entries."""
        name, kept = self._name(target), "" if isinstance(target, ast.Name) else ast.unparse(target)
        names = self._entries(name)
        given = given_function(value, self.kinds.names, self.text)
        if given and of_annotation(given.returns).is_array:
            assert isinstance(value, ast.Call)
            function = ast.unparse(value.func)
            found = f"{function}({', '.join(map(self._argument, value.args))})"
            if kept:
                yield f"found = {kept} = {found}"
                found = "found"
            yield f"{names} = {found}.tolist()"
            return
        entry = self._entry(value)
        for j in range(self.states):
            yield f"{name} = {entry}".replace(J, str(j))
        if kept:
            is_row = not kept.endswith("[:]")
            yield f"{kept} = {f'array(({names}))' if is_row else names}"

    def _name(self, e: ast.expr) -> str:
        """The name of an entry of a vector, or of a row that is known, and its own."""
        match e:
            case ast.Name(name) | ast.Subscript(ast.Name(name), ast.Slice(None, None, None)):
                return f"{name}_{J}"
            case ast.Subscript(ast.Name(name), ast.Constant(int() as row)):
                return f"{name}__{row}_{J}"
        raise NotInSubsetError(e, "not a whole vector with a name")

    def _argument(self, e: ast.expr) -> str:
        """What a function that is given is called with."""
        if isinstance(e, ast.Name) and f"{e.id}_{J}" in self.single:
            return f"array(({self._entries(f'{e.id}_{J}')}))"
        return self._plain(e)

    def _entry(self, e: ast.expr) -> str:
        """An entry of an elementwise expression, with `J` for its number."""
        match e:
            case ast.Name() | ast.Subscript() if self._is_vector(self.kinds.of(e)):
                name = self._name(e)
                if name not in self.single:
                    self.read.setdefault(name, ast.unparse(e))
                return name
            case ast.Constant(value):
                return f"({value!r})" if isinstance(value, float) and value < 0 else repr(value)
            case ast.BinOp(left, op, right) if type(op) in OPERATORS:
                first = self._entry(left)
                if isinstance(op, ast.Add) and first.startswith("(") and _is_sum(left):
                    first = first[1:-1]
                return f"({first} {OPERATORS[type(op)]} {self._entry(right)})"
            case ast.UnaryOp(ast.USub(), x):
                return f"(-{self._entry(x)})"
            case ast.Call(ast.Name("copy"), [x]):
                return self._entry(x)
            case ast.Call(ast.Name("zeros")):
                return "0.0"
            case ast.Call(ast.Name("larger"), [x, y]):
                a, b = self._entry(x), self._entry(y)
                return f"({b} if {b} > {a} else {a})"
            case ast.Call(ast.Name("abs" | "sqrt" as name), [x]):
                return f"{name}({self._entry(x)})"
        if self.kinds.of(e).is_number:
            return f"({self._plain(e)})"
        raise NotInSubsetError(e, "not in the subset")


def _is_sum(e: ast.expr) -> bool:
    return isinstance(e, ast.BinOp) and isinstance(e.op, ast.Add)


@dataclass
class _WithLengths(ast.NodeTransformer):
    """Puts in the lengths of vectors."""

    kinds: Kinds
    states: int

    def visit_Call(self, node: ast.Call) -> ast.expr:
        if called(node) == "len" and self.kinds.of(node.args[0]).sizes[0] in ("STATES", "len(y)"):
            return ast.Constant(self.states)
        self.generic_visit(node)
        return node
