"""The kinds of what expressions of the engine's text are: numbers, arrays with sizes, records."""

import ast
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from eomgen.subset.expander import NotInSubsetError, Text, called

ARRAYS = {"Vector": "float", "Matrix": "float", "Whole": "int"}
OF_NUMBERS = ("sqrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "tanh", "atan2")
FUNCTIONS = {
    "next_after": "float", "isfinite": "int", "ordered": "float", "all_within": "int",
    **dict.fromkeys(OF_NUMBERS, "float"),
}  # fmt: skip
"""The kinds of what functions of numbers, or of whole arrays, return."""


@dataclass(frozen=True)
class Kind:
    """`of` is "float", "int", "" for nothing, or the name of a record; `sizes` those of an array,
    as text. Those of a part may change in a function; `room` are those of the array it is of.
    """

    of: str
    sizes: tuple[str, ...] = ()
    room: tuple[str, ...] = ()

    @property
    def is_array(self) -> bool:
        """Whether it has entries."""
        return bool(self.sizes)

    @property
    def is_number(self) -> bool:
        """Whether it is a single number."""
        return self.of in ("float", "int") and not self.sizes


FLOAT, INT, NOTHING = Kind("float"), Kind("int"), Kind("")


def of_annotation(node: ast.expr | None) -> Kind:
    """The kind that an annotation names."""
    match node:
        case None | ast.Constant(None):
            return NOTHING
        case ast.Name("bool"):
            return INT
        case ast.Name(name):
            return Kind(name)
        case ast.Subscript(ast.Name("Annotated"), ast.Tuple([ast.Name(name), *sizes])):
            return Kind(
                ARRAYS[name], tuple(str(s.value) for s in sizes if isinstance(s, ast.Constant))
            )
    raise NotInSubsetError(node, "not a kind of the subset")


@cache
def fields_of(record: ast.ClassDef) -> dict[str, Kind]:
    """The kinds of a record's fields."""
    found = (d for d in record.body if isinstance(d, ast.AnnAssign))
    return {
        d.target.id: of_annotation(d.annotation) for d in found if isinstance(d.target, ast.Name)
    }


def is_protocol(record: ast.ClassDef) -> bool:
    """Whether a class names functions that the engine is given."""
    return any(isinstance(base, ast.Name) and base.id == "Protocol" for base in record.bases)


def given_function(
    node: ast.expr | None, kinds: Mapping[str, Kind], text: Text
) -> ast.FunctionDef | None:
    """The function of a protocol that an expression calls, if it does."""
    match node:
        case ast.Call(ast.Attribute(ast.Name(owner), name)) if owner in kinds:
            protocol = text.classes.get(kinds[owner].of)
            if protocol is None:
                raise NotInSubsetError(node, "not in the subset")
            for d in protocol.body:
                if isinstance(d, ast.FunctionDef) and d.name == name:
                    return d
            raise NotInSubsetError(node, f"{kinds[owner].of} has no function {name}")
    return None


def indices(e: ast.Subscript) -> list[ast.expr]:
    """The indices of an entry or a part."""
    return e.slice.elts if isinstance(e.slice, ast.Tuple) else [e.slice]


def length(part: ast.Slice, size: str) -> str:
    """The length of a part along a dimension, as text."""
    lower = ast.unparse(part.lower) if part.lower else ""
    upper = ast.unparse(part.upper) if part.upper else size
    if part.step:
        raise NotInSubsetError(part, "parts have no steps")
    return f"{upper} - ({lower})" if lower else upper


class Kinds:
    """The kinds of the names of a function, and of its expressions."""

    def __init__(self, text: Text, made: Mapping[str, ast.FunctionDef], d: ast.FunctionDef) -> None:
        self.text, self._made = text, made
        self.arguments = {a.arg: of_annotation(a.annotation) for a in d.args.args}
        self.names = dict(self.arguments)

    def declare(self, name: str, value: ast.expr) -> None:
        """Give a name the kind of its value. Raises `NotInSubsetError` if it has another."""
        kind = self.of(value)
        if kind == NOTHING:
            raise NotInSubsetError(value, "has no value")
        if not kind.is_number and isinstance(value, ast.Name | ast.Attribute | ast.Subscript):
            raise NotInSubsetError(value, "would be a second name of it: copy() an array")
        known = self.names.setdefault(name, kind)
        if known.of != kind.of or len(known.sizes) != len(kind.sizes):
            raise NotInSubsetError(value, f"{name} was of another kind before")

    def of(self, e: ast.expr) -> Kind:
        """The kind of an expression."""
        match e:
            case ast.Constant(bool() | int()):
                return INT
            case ast.Constant(float()) | ast.Name("inf" | "nan"):
                return FLOAT
            case ast.Name(name) if name in self.names:
                return self.names[name]
            case ast.Name(name) if name.isupper():
                return INT  # a size
            case ast.Attribute(ast.Name(owner), name) if owner in self.names:
                return self._field(e, owner, name)
            case ast.Subscript(value):
                return self._part(e, self.of(value))
            case ast.BinOp(left, op, right):
                return self._both(e, op, self.of(left), self.of(right))
            case ast.UnaryOp(ast.Not(), _) | ast.Compare() | ast.BoolOp():
                return INT
            case ast.UnaryOp(_, x) | ast.IfExp(_, x, _):
                return self.of(x)
            case ast.Call():
                return self._call(e)
        raise NotInSubsetError(e, "not in the subset")

    def _field(self, e: ast.expr, owner: str, name: str) -> Kind:
        fields = fields_of(self.text.classes[self.names[owner].of])
        if name not in fields:
            raise NotInSubsetError(e, f"{self.names[owner].of} has no {name}")
        sizes = (f"{owner}.{s}" if s in fields else s for s in fields[name].sizes)
        return Kind(fields[name].of, tuple(sizes))

    def _part(self, e: ast.Subscript, whole: Kind) -> Kind:
        at = indices(e)
        if len(at) > len(whole.sizes):
            raise NotInSubsetError(e, "has too many indices")
        parts: list[tuple[str, str]] = []
        for i, n, most in zip(at, whole.sizes, whole.room or whole.sizes, strict=False):
            if isinstance(i, ast.Slice):
                parts.append((length(i, n), most))
            elif (chosen := self.of(i)).is_array:
                parts.append((chosen.sizes[0], chosen.sizes[0]))
        rest = whole.sizes[len(at) :]
        sizes, room = ((*(part[n] for part in parts), *rest) for n in (0, 1))
        return Kind(whole.of, sizes, room)

    def _both(self, e: ast.expr, op: ast.operator, a: Kind, b: Kind) -> Kind:
        if a.of not in ("float", "int") or b.of not in ("float", "int"):
            raise NotInSubsetError(e, "not numbers")
        if isinstance(op, ast.FloorDiv | ast.Mod) or (
            isinstance(op, ast.Div) and a.of == b.of == "int"
        ):
            raise NotInSubsetError(e, "a quotient of whole numbers")
        if len(a.sizes) != len(b.sizes) and a.sizes and b.sizes:
            raise NotInSubsetError(e, "arrays of different dimensions")
        of = "float" if "float" in (a.of, b.of) or isinstance(op, ast.Pow) else "int"
        return Kind(of, a.sizes or b.sizes, a.room or b.room)

    def _call(self, e: ast.Call) -> Kind:
        name, args = called(e), e.args
        if given := given_function(e, self.names, self.text):
            return of_annotation(given.returns)
        if name in self._made:
            return of_annotation(self._made[name].returns)
        if name in FUNCTIONS:
            return Kind(FUNCTIONS[name])
        if name in ("zeros", "whole", "matrix", "rows"):
            return Kind("int" if name == "whole" else "float", tuple(map(ast.unparse, args)))
        if name == "outer":
            x, y = self.of(args[0]), self.of(args[1])
            return Kind("float", (*x.sizes, *y.sizes), (*(x.room or x.sizes), *(y.room or y.sizes)))
        if name == "product":
            rows = self.of(args[0])
            return Kind("float", rows.sizes[:1], rows.room[:1])
        if name == "transposed":
            x = self.of(args[0])
            return Kind(x.of, x.sizes[::-1], x.room[::-1])
        if name in ("abs", "copy", "min", "max", "larger"):
            kinds = [self.of(a) for a in args]
            of = "float" if any(k.of == "float" for k in kinds) else "int"
            sized = next((k for k in kinds if k.sizes), INT)
            return Kind(of, sized.sizes, sized.room)
        if name == "len":
            return INT
        raise NotInSubsetError(e, "not in the subset")
