"""Prints the engine's text as Python in which vectors are single numbers.

NumPy takes longer to begin an operation than Python to add a few numbers. Each entry has the
operations of the text in the same order, and so the same bits.
"""

import ast
from collections.abc import Iterator
from functools import partial
from types import ModuleType
from typing import Any

from eomgen.base.loading import load_source
from eomgen.subset.functions import Function, Item, Sizes
from eomgen.subset.languages import Language
from eomgen.subset.printing import Roots, functions_of_text
from eomgen.subset.text import Kind, NotInSubsetError, Text
from eomgen.subset.values import TIGHT, Indices, Value

PYTHON = Language(
    function="def {name}({arguments}):",
    names={"min": "min", "max": "max"},
    field=".",
    prelude="""from math import inf, isfinite, nan, sqrt

from numpy import array

from eomgen.subset.words import next_after
""",
    words={
        "not": "not ", "choice": "{1} if {0} else {2}", "if": "if {}:", "while": "while {}:",
        "else": "else:", "range": "for {i} in range({start}, {end}):",
        "back": "for {i} in range({start}, {end}, -1):", "done": "", "end": "",
    },
)  # fmt: skip


def unrolled_functions(text: Text, roots: Roots, states: int) -> ModuleType:
    """Functions of the engine, each with values of its `Known` parameters, and all that they call,
    for a number of states. A matrix may be a list of its rows.

    Raises `NotInSubsetError` for text outside the subset.
    """
    functions = functions_of_text(text, roots, PYTHON, partial(_Unrolled, states))
    lines = (line for name, function in functions.items() for line in function.lines(name))
    return load_source("\n".join((PYTHON.prelude, *lines, "")), f"engine_of_{states}")


class _Unrolled(Function):
    """Entries have names. Those of arguments that may be read before they are written are `taken`
    first; those that are written at the function's own level are `made`; arrays that are `given` to
    functions have no such names.
    """

    def __init__(self, states: int, *given: Any) -> None:
        self.states = states
        self.taken, self.made, self.given_on = dict[str, str](), set[str](), set[str]()
        super().__init__(*given)

    def lines(self, own: str) -> Iterator[str]:
        """Those of its source."""
        for base in self.given_on.intersection(self.taken.values()):
            raise self.wrong(base, "is of single numbers, but used whole")
        yield self.to.function.format(name=own, arguments=", ".join(self.arguments))
        for vector, base in self.taken.items():
            if base.partition(".")[0] in self.arguments:
                part = _part_of(base, vector).removesuffix("[:]")
                yield f"    {self._all(vector)} = {part}.tolist()"
        yield from self.written(self.body)

    def _named(self, e: ast.expr, name: str) -> Value:
        return self.known(e, self.states) if name == "STATES" else super()._named(e, name)

    def _along(self, i: ast.expr, size: Value) -> Any:
        if not isinstance(i, ast.Slice):
            self.needed(i, "the index is not known")
        return super()._along(i, size)

    def entry_of(self, name: str, sizes: Indices, at: Indices) -> str:
        """The name of a number, or of an entry."""
        if not sizes:
            return name
        if not at or name.partition(".")[0] not in {*self.arguments, *self.locals}:
            raise self.wrong(name, "has no entries with names")
        vector = "_".join([name.replace(".", "_"), *(str(x.known) for x in at[:-1])])
        if vector not in self.made:
            self.taken[vector] = name
        return f"{vector}_{at[-1].known}"

    def _all(self, vector: str) -> str:
        return "".join(f"{vector}_{j}, " for j in range(self.states)).rstrip()

    def _begun(self, to: Value, op: str = "") -> str:
        """The vector that is put into `to`."""
        if to.place not in ("0", ", 0"):
            raise self.wrong(to.base, "is not put whole, or by rows")
        taken, first = self.taken.copy(), [self.known(self.d, 0)]
        vector = to.entry(first).rpartition("_")[0]
        if self.depth == 1 and not op:
            self.made.add(vector)
            self.taken = taken
        return vector

    def argument(self, e: ast.expr) -> str:
        """What a function is given, which may change it."""
        value = self.of(e)
        if value.sizes:
            self.given_on.add(value.base)
            if isinstance(e, ast.Subscript) or value.base in self.locals:
                raise NotInSubsetError(e, "an array of single numbers is not used whole")
        return value.base if value.sizes else value.text

    def fill(self, target: ast.expr, name: str, kind: Kind, args: list[ast.expr]) -> None:
        given = []
        for x, a in zip(map(self.of, args), args, strict=True):
            is_own = x.sizes and x.base in self.locals
            given.append(f"array(({self._all(x.base)}))" if is_own else self.argument(a))
        to, found = self.of(target), f"{name}({', '.join(given)})"
        vector = self._begun(to)
        if to.base in self.arguments:
            self.items.append(f"found = {_part_of(to.base, vector)} = {found}")
            found = "found"
        self.items.append(f"{self._all(vector)} = {found}.tolist()")

    def each(self, sizes: Sizes, to: Value, op: str, x: Value, place: str, *before: Item) -> None:
        """Add a statement for each entry."""
        if sizes[0].known != self.states:
            raise self.wrong(to.base, "is not a vector of states")
        places = [[self.known(self.d, j)] for j in range(self.states)]
        if not to.sizes:
            self.items.append(
                f" {op} ".join([*map(str, before), *(x.within(TIGHT, j) for j in places)])
            )
            return
        values, vector = [x.entry(j) for j in places], self._begun(to, op)
        self.items += [f"{to.entry(j)} {op}= {y}" for j, y in zip(places, values, strict=True)]
        if to.base in self.arguments:
            whole = self._all(vector)
            whole = whole if vector == to.base else f"array(({whole}))"
            self.items.append(f"{_part_of(to.base, vector)} = {whole}")


def _part_of(base: str, vector: str) -> str:
    """The array, or its row, of which a vector has the entries."""
    return f"{base}[{vector[len(base) :].removeprefix('_') or ':'}]"
