"""Evaluates what is known of the engine's text when it is printed: constants, tableaus, the place.

Loops over `unrolled` values and sums of `added` terms are written out, tests that are decided are
left away with their branches, and functions with `Known` parameters are made one for each value.
What remains is Python again.
"""

import ast
import inspect
import operator as op
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

NUMBERS = (bool, int, float)
FUNCTIONS: dict[str, Callable[..., Any]] = {"range": range, "len": len, "abs": abs}
"""Those of what is known."""
OPERATORS: dict[type, Callable[..., Any]] = {
    ast.Add: op.add, ast.Sub: op.sub, ast.Mult: op.mul, ast.Div: op.truediv, ast.Pow: op.pow,
    ast.Mod: op.mod, ast.Lt: op.lt, ast.Gt: op.gt, ast.LtE: op.le, ast.GtE: op.ge, ast.Eq: op.eq,
    ast.NotEq: op.ne, ast.USub: op.neg, ast.Not: op.not_,
}  # fmt: skip

NONE: Mapping[str, Any] = {}
LISTS = {"numbers": "zeros", "counts": "whole", "table": "matrix"}
"""Lists in Python, and what they are in other languages."""


class NotInSubsetError(SyntaxError):
    """Text outside the subset; the message names its line."""

    def __init__(self, node: ast.AST, why: str) -> None:
        super().__init__(f"line {getattr(node, 'lineno', '?')}: {ast.unparse(node)}: {why}")


@dataclass
class Text:
    """The engine's text: its functions, and the fields and functions of its records and protocols,
    by name; the constants of each function's module; and the functions themselves.
    """

    functions: dict[str, ast.FunctionDef] = field(default_factory=dict)
    classes: dict[str, ast.ClassDef] = field(default_factory=dict)
    constants: dict[str, Mapping[str, Any]] = field(default_factory=dict)
    python: dict[str, Callable[..., Any]] = field(default_factory=dict)

    @classmethod
    def of(cls, *modules: ModuleType) -> "Text":
        """The text of modules. Raises `NotInSubsetError` if two things have one name."""
        text = cls()
        for module in modules:
            constants = {n: x for n, x in vars(module).items() if n.isupper()}
            text.add(inspect.getsource(module), constants, vars(module))
        return text

    def add(
        self, source: str, constants: Mapping[str, Any] = NONE, python: Mapping[str, Any] = NONE
    ) -> None:
        """Add what a source defines. Raises `NotInSubsetError` if a name is there already."""
        for d in ast.parse(source).body:
            name = d.name if isinstance(d, ast.FunctionDef | ast.ClassDef) else ""
            if name in self.functions or name in self.classes:
                raise NotInSubsetError(d, "another module of the text has this name")
            if isinstance(d, ast.FunctionDef):
                self.functions[name], self.constants[name] = d, constants
                self.python[name] = python.get(name, _nothing)
            elif isinstance(d, ast.ClassDef):
                self.classes[name] = d

    def expanded(self, roots: Iterable[tuple[str, Mapping[str, Any]]]) -> list[ast.FunctionDef]:
        """Functions, each specialised by values of its `Known` parameters, and all that they call,
        which come first. A function that calls itself is an error.
        """
        made: dict[str, ast.FunctionDef] = {}
        open_: list[str] = []

        def make(name: str, known: Mapping[str, Any]) -> str:
            own = "_".join([name, *(str(getattr(x, "name", x)) for x in known.values())])
            if own in open_:
                raise NotInSubsetError(self.functions[name], "calls itself")
            if own not in made:
                open_.append(own)
                d = _copied(self.functions[name])
                d.name, d.args.args = own, [a for a in d.args.args if a.arg not in known]
                d.body = _Expander({**self.constants.get(name, {}), **known}, self, make).block(
                    d.body
                )
                made[own] = d
                open_.remove(own)
            return own

        for name, known in roots:
            make(name, known)
        return list(made.values())


def is_known(annotation: ast.expr | None) -> bool:
    """Whether a parameter has a value when the text is printed."""
    return isinstance(annotation, ast.Name) and annotation.id == "Known"


def called(node: ast.AST | None) -> str:
    """The name of the function that an expression calls, or ""."""
    is_call = isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    return node.func.id if is_call else ""  # type: ignore[union-attr]


_UNKNOWN = object()


def _nothing(*given: Any) -> Any:
    """An operation that the subset does not have."""
    return _UNKNOWN


def _copied(node: Any) -> Any:
    """A copy of a tree, or of a list of trees; quicker than `deepcopy`."""
    if isinstance(node, list):
        return [_copied(x) for x in node]
    if not isinstance(node, ast.AST) or isinstance(node, ast.expr_context):
        return node
    made = type(node)()
    vars(made).update((name, _copied(x)) for name, x in vars(node).items())
    return made


def _value(e: ast.expr, known: Mapping[str, Any]) -> Any:
    """The value of an expression of what is known; `_UNKNOWN` if it is of another form."""

    def of(*parts: ast.expr) -> list[Any]:
        return [_value(part, known) for part in parts]

    call: tuple[Callable[..., Any], Sequence[Any]]
    match e:
        case ast.Constant(value):
            return value
        case ast.Name(name):
            return known.get(name, _UNKNOWN)
        case ast.Attribute(owner, name):
            found = of(owner)
            call = getattr, (*found, name)
        case ast.Subscript(owner, index) if not isinstance(index, ast.Slice):
            found = of(owner, index)
            call = op.getitem, found
        case ast.BinOp(left, operator, right) | ast.Compare(left, [operator], [right]):
            found = of(left, right)
            call = OPERATORS.get(type(operator), _nothing), found
        case ast.UnaryOp(operator, x):
            found = of(x)
            call = OPERATORS[type(operator)], found
        case ast.Call(ast.Name(name), args) if name in FUNCTIONS:
            found = of(*args)
            call = FUNCTIONS[name], found
        case _:
            return _UNKNOWN
    function, arguments = call
    return _UNKNOWN if any(x is _UNKNOWN for x in found) else function(*arguments)


class _Expander(ast.NodeTransformer):
    def __init__(self, known: Mapping[str, Any], text: Text, make: Any) -> None:
        self.known, self.text, self.make = dict(known), text, make

    def value(self, node: ast.expr) -> Any:
        """The value of an expression, or `_UNKNOWN`."""
        return _value(node, self.known)

    def needed(self, node: ast.expr, why: str) -> Any:
        """The value of an expression that must be known."""
        found = self.value(node)
        if found is _UNKNOWN:
            raise NotInSubsetError(node, why)
        return found

    def bound(self, target: ast.expr, value: Any, node: Any) -> Any:
        """A copy of statements, or of an expression, with the names of a target known, expanded."""
        several = isinstance(target, ast.Tuple)
        names, values = (target.elts, value) if several else ([target], [value])  # type: ignore[attr-defined]
        before = dict(self.known)
        self.known |= {n.id: v for n, v in zip(names, values, strict=True)}
        made = _copied(node)
        made = self.block(made) if isinstance(made, list) else self.visit(made)
        self.known = before
        return made

    def block(self, body: list[ast.stmt]) -> list[ast.stmt]:
        """Statements, expanded."""
        made = (self.visit(s) for s in body)
        return [x for s in made if s is not None for x in (s if isinstance(s, list) else [s])]

    def visit(self, node: ast.AST) -> Any:
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            return None  # a docstring
        is_stored = isinstance(getattr(node, "ctx", None), ast.Store)
        if isinstance(node, ast.expr) and not is_stored and not isinstance(node, ast.Slice):
            value = self.value(node)
            if isinstance(value, NUMBERS):
                return ast.copy_location(ast.Constant(value), node)
        return super().visit(node)

    def visit_Call(self, node: ast.Call) -> ast.expr:
        name = called(node)
        if name == "added":
            return self._sum(node)
        if name == "combined":
            return self._combined(node)
        if name in self.text.functions:
            parameters = self.text.functions[name].args.args
            if node.keywords or len(parameters) != len(node.args):
                raise NotInSubsetError(node, f"{name} takes {len(parameters)} arguments by place")
            pairs = list(zip(parameters, node.args, strict=True))
            needed = ((p.arg, a) for p, a in pairs if is_known(p.annotation))
            known = {name: self.needed(a, f"{name} is not known") for name, a in needed}
            node.func = ast.copy_location(ast.Name(self.make(name, known), ast.Load()), node)
            node.args = [a for p, a in pairs if p.arg not in known]
        elif name in LISTS:
            node.func = ast.copy_location(ast.Name(LISTS[name], ast.Load()), node)
        node.args = [self.visit(a) for a in node.args]
        return node

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        self.generic_visit(node)
        match node.value:
            case ast.Subscript(array, row) if not isinstance(row, ast.Slice | ast.Tuple):
                node.value, node.slice = array, ast.Tuple([row, node.slice], ast.Load())
        return node

    def _sum(self, node: ast.Call) -> ast.expr:
        (terms,) = node.args
        if not isinstance(terms, ast.GeneratorExp):
            raise NotInSubsetError(node, "give terms as `x for … in …`")
        (each,) = terms.generators
        values = self.needed(each.iter, "the terms are not known")
        total: ast.expr
        total, *rest = (self.bound(each.target, v, terms.elt) for v in values)
        for term in rest:
            total = ast.copy_location(ast.BinOp(total, ast.Add(), term), node)
        return total

    def _combined(self, node: ast.Call) -> ast.expr:
        row, k = node.args
        total: ast.expr = ast.Constant(0.0)
        for j, a in self.needed(row, "the row is not known"):
            term = ast.Subscript(self.visit(_copied(k)), ast.Constant(j), ast.Load())
            total = ast.BinOp(total, ast.Add(), ast.BinOp(ast.Constant(a), ast.Mult(), term))
        return ast.copy_location(total, node)

    def visit_IfExp(self, node: ast.IfExp) -> ast.expr:
        node.test = self.visit(node.test)
        if isinstance(node.test, ast.Constant):
            chosen: ast.expr = self.visit(node.body if node.test.value else node.orelse)
            return chosen
        node.body, node.orelse = self.visit(node.body), self.visit(node.orelse)
        return node

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.expr:
        decides, kept = isinstance(node.op, ast.Or), []
        for part in map(self.visit, node.values):
            if not isinstance(part, ast.Constant):
                kept.append(part)
            elif bool(part.value) == decides:
                kept.append(part)
                break
        if not kept or isinstance(kept[0], ast.Constant):
            return ast.copy_location(ast.Constant(decides if kept else not decides), node)
        return ast.copy_location(ast.BoolOp(node.op, kept), node) if len(kept) > 1 else kept[0]

    def visit_If(self, node: ast.If) -> Any:
        node.test = self.visit(node.test)
        if isinstance(node.test, ast.Constant):
            return self.block(node.body if node.test.value else node.orelse)
        node.body, node.orelse = self.block(node.body), self.block(node.orelse)
        return node

    def visit_While(self, node: ast.While) -> ast.stmt:
        node.test, node.body = self.visit(node.test), self.block(node.body)
        return node

    def visit_For(self, node: ast.For) -> Any:
        if not isinstance(node.iter, ast.Call):
            raise NotInSubsetError(node.iter, "loops are over range(…), or unrolled(…)")
        if called(node.iter) == "unrolled":
            values = self.needed(node.iter.args[0], "what is unrolled is not known")
            return [s for v in values for s in self.bound(node.target, v, node.body)]
        node.iter.args = [self.visit(a) for a in node.iter.args]
        node.body = self.block(node.body)
        return node
