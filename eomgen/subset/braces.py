"""Prints the engine's text, expanded, as C or as JavaScript.

Array statements of equal length that follow one another become one loop; arrays that are used in
such loops only are numbers there.
"""

import ast
from collections.abc import Mapping, Sequence
from typing import Any

from eomgen.subset.expander import NotInSubsetError, Text, called
from eomgen.subset.expressions import (
    GATHERED,
    ONE,
    OPERATORS,
    STATEMENTS,
    TWO,
    Expressions,
    bare,
    base_of,
    is_whole,
    names_in,
    stored,
)
from eomgen.subset.kinds import (
    INT,
    NOTHING,
    given_function,
    indices,
    of_annotation,
)
from eomgen.subset.languages import RESERVED, Language, type_of

Group = list[ast.Assign]


class Printer(Expressions):
    """The printing of a function. `changes` are the arrays among the arguments of earlier ones that
    these change.
    """

    def __init__(
        self,
        text: Text,
        made: Mapping[str, ast.FunctionDef],
        d: ast.FunctionDef,
        to: Language,
        changes: dict[str, set[str]],
    ) -> None:
        super().__init__(text, made, d, to)
        self.changes, self.out, self.depth = changes, list[str](), 1

    def lines(self) -> list[str]:
        """The lines of its source."""
        for argument in self.d.args.args:
            self._check_name(ast.copy_location(ast.Name(argument.arg), argument))
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
                f"{'const ' if name in read else ''}{type_of(kind, self.to)}"
                f"{'restrict ' if kind.is_array else ''}{name}"
                for name, kind in arguments
            ]
        result = of_annotation(self.d.returns)
        return self.to.function.format(
            result="void" if result == NOTHING else type_of(result, self.to).strip(),
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
            parts = names_in(ast.parse(size.replace("->", "."), mode="eval"))
            if unknown := parts & (self.kinds.names.keys() - self.kinds.arguments.keys()):
                why = f"the size of {name} is known only when {unknown.pop()} is"
                raise NotInSubsetError(ast.copy_location(ast.Name(name), self.d), why)
            made = self.to.array.format(
                type=self.to.arrays[kind.of == "int"], function=self.d.name, name=name, size=size
            )
            lines.append(f"    {made}")
        return [*(f"    {word} {', '.join(many)};" for word, many in numbers.items()), *lines]

    def _changed(self) -> set[str]:
        """The arrays among the arguments that the function, or one that it calls, changes."""
        found = set()
        for n in ast.walk(self.d):
            if isinstance(n, ast.Subscript) and isinstance(n.ctx, ast.Store):
                found.add(base_of(n))
            elif isinstance(n, ast.Call):
                passed = [base_of(a) for a in n.args]
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
        if name.id in RESERVED:
            raise NotInSubsetError(name, "is a word of another language")

    def _prepare(self, s: ast.stmt) -> None:
        """Declare loop variables, and group the statements inside."""
        if isinstance(s, ast.For):
            if called(s.iter) != "range" or not isinstance(s.target, ast.Name) or s.orelse:
                raise NotInSubsetError(s, "loops are over range(…), or unrolled(…)")
            self._check_name(s.target)
            self.kinds.names.setdefault(s.target.id, INT)
            assert isinstance(s.iter, ast.Call)
            given = stored(s.body)
            if given & names_in(*s.iter.args) or s.target.id in given:
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
        if isinstance(s.value, ast.List):
            return False
        return len(self.kinds.of(s.targets[0]).sizes) == 1

    def _span(self, s: ast.Assign) -> str:
        if called(s.value) in GATHERED:
            assert isinstance(s.value, ast.Call)
            return self.kinds.of(s.value.args[0]).sizes[0]
        return self.kinds.of(s.targets[0]).sizes[0]

    def _fits(self, s: ast.Assign, group: Group) -> bool:
        """Whether a statement may share a loop: its entry j needs entries j only, and no sums."""
        if self._span(s) != self._span(group[0]):
            return False
        written = {base_of(one.targets[0]) for one in group}
        sums = {base_of(one.targets[0]) for one in group if called(one.value) in GATHERED}
        parts = {
            base_of(n) for n in ast.walk(s) if isinstance(n, ast.Subscript) and not is_whole(n)
        }
        read = names_in(s.value) | {base_of(s.targets[0])}
        mine = {base_of(s.targets[0])} if isinstance(s.targets[0], ast.Subscript) else set()
        before = {n for one in group for n in names_in(one.value)}
        shifts = mine & before and not is_whole(s.targets[0])
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
                        kept.update(names_in(one.value) - written)
                        target = one.targets[0]
                        if isinstance(target, ast.Name):
                            written.add(target.id)
                        else:
                            kept.update(names_in(target))
                    seen.update(written)
                elif hasattr(s, "body"):
                    kept.update(names_in(s.iter if isinstance(s, ast.For) else s.test))
                    walk(s.body)
                    walk(s.orelse)
                else:
                    kept.update(names_in(s))

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
                entries = bare(" <= ".join(self._expr(a, ONE) for a in value.args))
                self._line(f"{self._expr(target)} {GATHERED[called(value)][1]} {entries};")
                continue
            self._check_overlap(target, value)
            word = ""
            if isinstance(target, ast.Name) and target.id in self.scalars - declared:
                word = f"{self.to.arrays[0] if self.to.typed else self.to.number} "
                declared.add(target.id)
            self._line(f"{word}{self._expr(target, ONE)} = {bare(self._expr(value, ONE))};")
        self.depth -= 1
        self._line("}")

    def _for(self, index: str, size: str) -> str:
        return f"for ({self.to.whole} {index} = 0; {index} < {self._size(size)}; {index}++)"

    def _check_overlap(self, target: ast.expr, value: ast.expr) -> None:
        """NumPy computes all before it writes: parts of one array must not be shifted."""
        for n in ast.walk(value):
            if not isinstance(n, ast.Subscript) or base_of(n) != base_of(target):
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
                self._line(f"return {bare(self._expr(value))};" if value else "return;")
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
                self._line(f"{word} ({bare(self._expr(test))}) {{")
                self._inside(body)
                if s.orelse:
                    self._line("} else {")
                    self._inside(s.orelse)
                self._line("}")
            case _:
                raise NotInSubsetError(s, "not in the subset")

    def _range(self, name: str, args: Sequence[ast.expr]) -> str:
        start, end, *step = (
            ["0", bare(self._expr(args[0]))]
            if len(args) == 1
            else [bare(self._expr(a)) for a in args]
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
        if isinstance(value, ast.List):
            self._listed(target, value)
            return
        if called(value) == "product":
            assert isinstance(value, ast.Call)
            self._product_of(target, *value.args)
            return
        if len(kind.sizes) == 1:  # of whole numbers, or a vector of zeros
            fill = called(value) == "whole"
            self._line(self._for(ONE[0], kind.sizes[0]))
            entry = "0" if fill else bare(self._expr(value, ONE))
            self._line(f"    {self._expr(target, ONE)} = {entry};")
            return
        self._change(target, "", value)

    def _listed(self, target: ast.expr, value: ast.List) -> None:
        """The entries of an array, one after another, or four at a time."""
        if base_of(target) in names_in(value):
            raise NotInSubsetError(value, "an array would change while it is read")
        entries = list(map(self._expr, value.elts))
        together = len(entries) // 4 * 4 if self.to.listed else 0
        for n in range(0, together, 4):
            first = self._expr(target, (str(n),))
            self._line(self.to.listed.format(first=first, entries=", ".join(entries[n : n + 4])))
        for n in range(together, len(entries)):
            self._line(f"{self._expr(target, (str(n),))} = {bare(entries[n])};")

    def _product_of(self, target: ast.expr, a: ast.expr, x: ast.expr) -> None:
        """A matrix by a vector, row by row."""
        if base_of(target) in names_in(a, x):
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
        self._line(f"{pad}{self._expr(target, loops)} {op}= {bare(self._expr(value, loops))};")
