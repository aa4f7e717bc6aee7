"""Prints the engine's text, expanded, as C or as JavaScript.

Array statements of equal length that follow one another become one loop; arrays that are used in
such loops only are numbers there.
"""

import ast
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from eomgen.subset.expander import NotInSubsetError, Text, called
from eomgen.subset.kinds import (
    INT,
    NOTHING,
    Kind,
    Kinds,
    fields_of,
    given_function,
    indices,
    is_protocol,
    of_annotation,
)

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


@dataclass(frozen=True)
class Language:
    """What differs between languages with braces.

    function      how a function begins, by its result, name and arguments
    number, whole types of numbers
    infinite      how infinity is written
    literal       how a number is, where it is not its digits alone
    names         how functions of numbers are called
    array         how a local array is declared, by type, name and size
    arrays        the types of arrays of numbers, and of whole ones
    part          how a part of an array is passed on, by its name and the place where it begins
    field         how a record's field is read
    prelude       what the printed functions need
    literal       how a number is written
    typed         whether arguments and results have types, and records structures
    """

    function: str
    number: str
    whole: str
    infinite: str
    names: Mapping[str, str]
    array: str
    arrays: tuple[str, str]
    part: str
    field: str
    prelude: str
    literal: str = "{}"
    typed: bool = False


C = Language(
    function="static inline {result} {name}({arguments}) {{",
    number="double",
    whole="int64_t",
    infinite="INFINITY",
    names={"abs": "fabs", "next_after": "next_after", "pow": "pow", "nan": "NAN"},
    array="{type} {name}[ROOM({size})];",
    arrays=("double", "int64_t"),
    part="{array} + {place}",
    field="->",
    prelude="""#include <math.h>
#include <stdint.h>

/* Room for n numbers; an array of none is not allowed. */
#define ROOM(n) ((n) > 0 ? (n) : 1)

static inline double next_after(double t) {
    return nextafter(t, INFINITY);
}
""",
    typed=True,
)
REALS = replace(C, number="real", arrays=("real", "int64_t"), literal="R({})")
"""C with numbers of a type `real`, for which R(x) writes constants."""
VECTORS = replace(C, number="V", arrays=("V", "int64_t"), literal="N({})")
"""C with a type V of vectors in place of numbers: text without decisions makes several at once."""
JAVASCRIPT = Language(
    function="function {name}({arguments}) {{",
    number="let",
    whole="let",
    infinite="Infinity",
    names={
        "abs": "Math.abs", "sqrt": "Math.sqrt", "pow": "Math.pow", "nan": "NaN",
        "isfinite": "Number.isFinite", "next_after": "nextAfter",
    },
    array="const {name} = new {type}Array({size});",
    arrays=("Float64", "Int32"),
    part="{array}.subarray({place})",
    field=".",
    prelude="""const nextAfter = (() => {
    const number = new Float64Array(1), bits = new BigInt64Array(number.buffer);
    return (t) => {
        if (t === 0) return Number.MIN_VALUE;
        number[0] = t;
        bits[0] += t > 0 ? 1n : -1n;
        return number[0];
    };
})();
""",
)  # fmt: skip


def printed(
    text: Text,
    roots: Iterable[tuple[str, Mapping[str, Any]]],
    language: Language,
) -> str:
    """The source of functions of the engine and of all that they call, those called first. Each is
    given with values of its `Known` parameters.

    Raises `NotInSubsetError` for text outside the subset.
    """
    functions = text.expanded(roots)
    made = {d.name: d for d in functions}
    lines = list(_structures(text, made.values(), language)) if language.typed else []
    changes: dict[str, set[str]] = {}
    for d in functions:
        lines += ["", *_Function(text, made, d, language, changes).lines()]
    return "\n".join(lines).lstrip("\n") + "\n"


def _structures(
    text: Text, functions: Iterable[ast.FunctionDef], language: Language
) -> Iterable[str]:
    """C's structures of the records that are arguments."""
    kinds = (of_annotation(a.annotation).of for d in functions for a in d.args.args)
    for name in dict.fromkeys(kinds):
        record = text.classes.get(name)
        if record and not is_protocol(record):
            yield f"typedef struct {name} {{"
            for each, kind in fields_of(record).items():
                yield f"    {_type(kind, language)}{each};"
            yield f"}} {name};"


def _type(kind: Kind, language: Language) -> str:
    if kind.of not in ("float", "int"):
        return f"{kind.of} *"
    if kind.is_array:
        return f"{language.arrays[kind.of == 'int']} *"
    return f"{language.whole if kind == INT else language.number} "


Group = list[ast.Assign]


@dataclass
class _Function:
    """The printing of a function. `changes` are the arrays among the arguments of earlier ones that
    these change.
    """

    text: Text
    made: Mapping[str, ast.FunctionDef]
    d: ast.FunctionDef
    to: Language
    changes: dict[str, set[str]]
    out: list[str] = field(default_factory=list)
    depth: int = 1

    def lines(self) -> list[str]:
        """The lines of its source."""
        self.kinds = Kinds(self.text, self.made, self.d)
        self.changes[self.d.name] = self._changed()
        body = self._grouped(self.d.body)
        self.scalars = self._scalars(body)
        self._block(body)
        return [self._head(), *self._declared(), *self.out, "}"]

    # ---- the head ----

    def _head(self) -> str:
        arguments = self.kinds.arguments.items()
        shown = [name for name, _ in arguments]
        if self.to.typed:
            read = {n for n, k in arguments if k.is_array} - self.changes[self.d.name]
            shown = [
                f"{'const ' if name in read else ''}{_type(kind, self.to)}"
                f"{'restrict ' if kind.is_array else ''}{name}"
                for name, kind in arguments
            ]
        result = of_annotation(self.d.returns)
        return self.to.function.format(
            result="void" if result == NOTHING else _type(result, self.to).strip(),
            name=self.d.name,
            arguments=", ".join(shown) or ("void" if self.to.typed else ""),
        )

    def _declared(self) -> list[str]:
        lines, numbers = [], dict[str, list[str]]()
        for name, kind in self.kinds.names.items():
            if name in self.kinds.arguments or name in self.scalars:
                continue
            if not kind.is_array:
                word = self.to.whole if kind == INT else self.to.number
                numbers.setdefault(word, []).append(name)
                continue
            size = self._product(kind.room or kind.sizes)
            parts = _names(ast.parse(size.replace("->", "."), mode="eval"))
            if unknown := parts & (self.kinds.names.keys() - self.kinds.arguments.keys()):
                why = f"the size of {name} is known only when {unknown.pop()} is"
                raise NotInSubsetError(ast.copy_location(ast.Name(name), self.d), why)
            made = self.to.array.format(type=self.to.arrays[kind.of == "int"], name=name, size=size)
            lines.append(f"    {made}")
        return [*(f"    {word} {', '.join(many)};" for word, many in numbers.items()), *lines]

    def _product(self, sizes: Sequence[str]) -> str:
        if len(sizes) == 1:
            return self._size(sizes[0])
        return " * ".join(map(self._factor, sizes))

    def _factor(self, size: str) -> str:
        return size if size.isidentifier() else f"({self._size(size)})"

    def _size(self, text: str) -> str:
        return _bare(self._expr(ast.parse(text, mode="eval").body))

    def _changed(self) -> set[str]:
        """The arrays among the arguments that the function, or one that it calls, changes."""
        found = set()
        for n in ast.walk(self.d):
            if isinstance(n, ast.Subscript) and isinstance(n.ctx, ast.Store):
                found.add(_base(n))
            elif isinstance(n, ast.Call):
                passed = [_base(a) for a in n.args]
                if called(n) in self.changes:
                    order = [a.arg for a in self.made[called(n)].args.args]
                    kept = self.changes[called(n)]
                    found |= {p for p, a in zip(passed, order, strict=True) if a in kept}
                elif given_function(n, self.kinds.names, self.text):
                    found |= set(passed) if isinstance(n, ast.Call) and self._alters(n) else set()
        return found & {n for n, k in self.kinds.arguments.items() if k.is_array}

    def _alters(self, call: ast.Call) -> bool:
        """Whether a function that is given may change its arguments: one that returns no array."""
        given = given_function(call, self.kinds.names, self.text)
        return given is not None and not of_annotation(given.returns).is_array

    # ---- statements, and which of them share a loop ----

    def _grouped(self, body: list[ast.stmt]) -> list[Any]:
        """Statements, with those that share a loop in lists."""
        made: list[Any] = []
        for s in body:
            self._prepare(s)
            if isinstance(s, ast.AnnAssign) and s.value:
                s = ast.copy_location(ast.Assign([s.target], s.value), s)
            if not isinstance(s, ast.Assign):
                made.append(s)
                continue
            (target,) = s.targets
            if isinstance(target, ast.Name):
                self._check_name(target)
                self.kinds.declare(target.id, s.value)
            if not self._is_loop(s):
                made.append(s)
            elif made and isinstance(made[-1], list) and self._fits(s, made[-1]):
                made[-1].append(s)
            else:
                made.append([s])
        return made

    def _check_name(self, name: ast.Name) -> None:
        if name.id in TWO:
            raise NotInSubsetError(name, "is the name of an index of loops over arrays")

    def _prepare(self, s: ast.stmt) -> None:
        """Declare loop variables, and group the statements inside."""
        if isinstance(s, ast.For):
            if called(s.iter) != "range" or not isinstance(s.target, ast.Name) or s.orelse:
                raise NotInSubsetError(s, "loops are over range(…), or unrolled(…)")
            self._check_name(s.target)
            self.kinds.names.setdefault(s.target.id, INT)
            assert isinstance(s.iter, ast.Call)
            stored = _stored(s.body)
            if stored & _names(*s.iter.args) or s.target.id in stored:
                raise NotInSubsetError(s.iter, "changes in the loop")
        if isinstance(s, ast.For | ast.While | ast.If):
            s.body, s.orelse = self._grouped(s.body), self._grouped(s.orelse)
        elif not isinstance(s, STATEMENTS):
            raise NotInSubsetError(s, "not in the subset")

    def _is_loop(self, s: ast.Assign) -> bool:
        """Whether an assignment is a loop over the entries of vectors, or gathers them."""
        if called(s.value) in GATHERED:
            return isinstance(s.targets[0], ast.Name)
        if called(s.value) in ("rows", "matrix", "whole", "product") or self._given(s.value):
            return False
        return len(self.kinds.of(s.targets[0]).sizes) == 1

    def _given(self, e: ast.expr) -> ast.FunctionDef | None:
        return given_function(e, self.kinds.names, self.text)

    def _span(self, s: ast.Assign) -> str:
        if called(s.value) in GATHERED:
            assert isinstance(s.value, ast.Call)
            return self.kinds.of(s.value.args[0]).sizes[0]
        return self.kinds.of(s.targets[0]).sizes[0]

    def _fits(self, s: ast.Assign, group: Group) -> bool:
        """Whether a statement may share a loop: its entry j needs entries j only, and no sums."""
        if self._span(s) != self._span(group[0]):
            return False
        written = {_base(one.targets[0]) for one in group}
        sums = {_base(one.targets[0]) for one in group if called(one.value) in GATHERED}
        parts = {_base(n) for n in ast.walk(s) if isinstance(n, ast.Subscript) and not _is_whole(n)}
        read = _names(s.value) | {_base(s.targets[0])}
        mine = {_base(s.targets[0])} if isinstance(s.targets[0], ast.Subscript) else set()
        before = {n for one in group for n in _names(one.value)}
        shifts = mine & before and not _is_whole(s.targets[0])
        return not (sums & read or written & parts or shifts)

    def _scalars(self, body: list[Any]) -> set[str]:
        """Arrays that are in loops only, and in each are written before they are read."""
        seen: set[str] = set()
        kept = set(self.kinds.arguments)

        def walk(items: list[Any]) -> None:
            for s in items:
                if isinstance(s, list):
                    written: set[str] = set()
                    for one in s:
                        kept.update(_names(one.value) - written)
                        target = one.targets[0]
                        if isinstance(target, ast.Name):
                            written.add(target.id)
                        else:
                            kept.update(_names(target))
                    seen.update(written)
                elif hasattr(s, "body"):
                    kept.update(_names(s.iter if isinstance(s, ast.For) else s.test))
                    walk(s.body)
                    walk(s.orelse)
                else:
                    kept.update(_names(s))

        walk(body)
        return {n for n in seen - kept if self.kinds.names[n].is_array}

    def _line(self, text: str) -> None:
        self.out.append("    " * self.depth + text)

    def _block(self, body: list[Any]) -> None:
        for s in body:
            self._loop(s) if isinstance(s, list) else self._statement(s)

    def _inside(self, body: list[Any]) -> None:
        self.depth += 1
        self._block(body)
        self.depth -= 1

    def _loop(self, group: Group) -> None:
        """The loop of a group of statements."""
        declared: set[str] = set()
        for s in group:
            if called(s.value) in GATHERED:
                self._line(f"{self._expr(s.targets[0])} = {GATHERED[called(s.value)][0]};")
        self._line(self._for(ONE[0], self._span(group[0])) + " {")
        self.depth += 1
        for s in group:
            (target,), value = s.targets, s.value
            if called(value) in GATHERED:
                assert isinstance(value, ast.Call)
                entries = _bare(" <= ".join(self._expr(a, ONE) for a in value.args))
                self._line(f"{self._expr(target)} {GATHERED[called(value)][1]} {entries};")
                continue
            self._check_overlap(target, value)
            word = ""
            if isinstance(target, ast.Name) and target.id in self.scalars - declared:
                word = f"{self.to.arrays[0] if self.to.typed else self.to.number} "
                declared.add(target.id)
            self._line(f"{word}{self._expr(target, ONE)} = {_bare(self._expr(value, ONE))};")
        self.depth -= 1
        self._line("}")

    def _for(self, index: str, size: str) -> str:
        return f"for ({self.to.whole} {index} = 0; {index} < {self._size(size)}; {index}++)"

    def _check_overlap(self, target: ast.expr, value: ast.expr) -> None:
        """NumPy computes all before it writes: parts of one array must not be shifted."""
        for n in ast.walk(value):
            if not isinstance(n, ast.Subscript) or _base(n) != _base(target):
                continue
            if self._starts(n) != self._starts(target):
                raise NotInSubsetError(value, "shifted parts of one array: copy() one of them")

    def _starts(self, e: ast.expr) -> list[str]:
        """Where a part begins along each dimension; nothing where it is a single place."""
        places = []
        for i in indices(e) if isinstance(e, ast.Subscript) else []:
            if isinstance(i, ast.Slice):
                places.append(ast.unparse(i.lower or ast.Constant(0)))
            else:
                places.append(ast.unparse(i) if self.kinds.of(i).is_array else "")
        return [*places, "0", "0"][:2]

    def _statement(self, s: ast.stmt) -> None:
        match s:
            case ast.Assign([target], value):
                self._assign(target, value)
            case ast.AugAssign(target, op, value):
                self._change(target, OPERATORS[type(op)], value)
            case ast.Return(value):
                self._line(f"return {_bare(self._expr(value))};" if value else "return;")
            case ast.Break():
                self._line("break;")
            case ast.Continue():
                self._line("continue;")
            case ast.Pass():
                pass
            case ast.Expr(ast.Call() as call):
                self._line(f"{self._call(call)};")
            case ast.For(target, ast.Call(_, args), body):
                self._line(f"{self._range(self._expr(target), args)} {{")
                self._inside(body)
                self._line("}")
            case ast.While(test, body) | ast.If(test, body):
                word = "if" if isinstance(s, ast.If) else "while"
                self._line(f"{word} ({_bare(self._expr(test))}) {{")
                self._inside(body)
                if s.orelse:
                    self._line("} else {")
                    self._inside(s.orelse)
                self._line("}")
            case _:
                raise NotInSubsetError(s, "not in the subset")

    def _range(self, name: str, args: Sequence[ast.expr]) -> str:
        start, end, *step = (
            ["0", _bare(self._expr(args[0]))]
            if len(args) == 1
            else [_bare(self._expr(a)) for a in args]
        )
        if step and step not in (["1"], ["-1"]):
            raise NotInSubsetError(args[2], "steps are 1 or -1")
        back = step == ["-1"]
        goes_on, moves = (">", "--") if back else ("<", "++")
        return f"for ({name} = {start}; {name} {goes_on} {end}; {name}{moves})"

    def _assign(self, target: ast.expr, value: ast.expr) -> None:
        kind = self.kinds.of(target)
        if given := self._given(value):
            assert isinstance(value, ast.Call)
            if of_annotation(given.returns).is_array:
                self._line(f"{self._call(value, self._argument(target))};")
                return
        if called(value) == "rows":
            return
        if called(value) == "product":
            assert isinstance(value, ast.Call)
            self._product_of(target, *value.args)
            return
        if len(kind.sizes) == 1:  # of whole numbers, or a vector of zeros
            fill = called(value) == "whole"
            self._line(self._for(ONE[0], kind.sizes[0]))
            entry = "0" if fill else _bare(self._expr(value, ONE))
            self._line(f"    {self._expr(target, ONE)} = {entry};")
            return
        self._change(target, "", value)

    def _product_of(self, target: ast.expr, a: ast.expr, x: ast.expr) -> None:
        """A matrix by a vector, row by row."""
        if _base(target) in _names(a, x):
            raise NotInSubsetError(x, "an array would change while it is read")
        self._line(f"{self._for('i_', self.kinds.of(a).sizes[0])} {{")
        entry = self._expr(target, ("i_",))
        self._line(f"    {entry} = {self._number(0.0)};")
        self._line(f"    {self._for('j_', self.kinds.of(x).sizes[0])}")
        self._line(f"        {entry} += {self._expr(a, TWO)} * {self._expr(x, ONE)};")
        self._line("}")

    def _change(self, target: ast.expr, op: str, value: ast.expr) -> None:
        kind = self.kinds.of(target)
        self._check_overlap(target, value)
        loops = TWO[-len(kind.sizes) :] if kind.sizes else ()
        for depth, (index, size) in enumerate(zip(loops, kind.sizes, strict=True)):
            self._line("    " * depth + self._for(index, size))
        pad = "    " * len(loops)
        if kind == INT and self.kinds.of(value).of == "float":
            raise NotInSubsetError(value, "a whole number is expected")
        self._line(f"{pad}{self._expr(target, loops)} {op}= {_bare(self._expr(value, loops))};")

    # ---- expressions ----

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
                place.append(_bare(shown) if len(whole.sizes) == 1 else shown)
        return self._at(self._entry(e.value, ()), whole, place)

    def _at(self, array: str, kind: Kind, place: Sequence[str]) -> str:
        first, *others = place
        for size, index in zip(kind.sizes[1:], others, strict=True):
            first = f"{first} * {self._factor(size)} + {index}"
        return f"{array}[{_bare(first)}]"

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
        return f"{self.to.names.get(name, name)}({_bare(self._expr(args[0], at))})"


def _base(e: ast.AST) -> str:
    """The array, as text, of which an expression is a part."""
    return ast.unparse(e.value if isinstance(e, ast.Subscript) else e)


def _stored(body: Iterable[ast.stmt]) -> set[str]:
    """The names that statements give a value."""
    names = (n for s in body for n in ast.walk(s) if isinstance(n, ast.Name))
    return {n.id for n in names if isinstance(n.ctx, ast.Store)}


def _is_whole(e: ast.expr) -> bool:
    """Whether it is a name, or all of an array."""
    match e:
        case ast.Subscript(_, ast.Slice(None, None, None)):
            return True
    return not isinstance(e, ast.Subscript)


def _names(*nodes: ast.AST) -> set[str]:
    found = (n for node in nodes for n in ast.walk(node))
    return {ast.unparse(n) for n in found if isinstance(n, ast.Name | ast.Attribute)}


def _bare(text: str) -> str:
    """An expression without the parentheses around all of it."""
    if not (text.startswith("(") and text.endswith(")")):
        return text
    depth = 0
    for i, letter in enumerate(text):
        depth += {"(": 1, ")": -1}.get(letter, 0)
        if depth == 0:
            return text[1:-1] if i == len(text) - 1 else text
    return text
