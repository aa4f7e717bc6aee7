"""The recurrences of Taylor coefficients as text of the engine's language.

`first_coefficients` computes coefficient 0 of all series of a program and coefficient 1 of the
states; `next_coefficients` coefficients k of all series, from those of the states, and k + 1 of
these. It is given the sums of products over what lies between the first and the last coefficients:
each product has a column in `left` and in `right`, whose rows are the coefficients of its factors.
The terms with the first coefficients are added one by one, those that are known last in the end:
how fast a step is depends on the longest chain of operations that need each other's results.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from eomgen.program.tape import FUNCTIONS, TIME
from eomgen.program.taylor import Quotient, Recurrences, Root, Rule, Solution, Sum, Term

WIDTH = 16
"""The number of products is a multiple of this: four vectors of four."""
SYMBOLS = {"add": "+", "sub": "-", "mul": "*", "div": "/"}
MULTIPLY_ADD = 2
"""Operations in a product that is added, by which terms are ordered."""
HEADS = """\
from math import acos, asin, atan, atan2, cos, exp, log, sin, sqrt, tan, tanh
from typing import Annotated

from eomgen.subset.words import Vector


def first_coefficients(
    t: float,
    y: Annotated[Vector, "STATES"],
    fixed: Annotated[Vector, "FIXED"],
    first: Annotated[Vector, "FIRST"],
    rates: Annotated[Vector, "STATES"],
) -> None:
{first}


def next_coefficients(
    k: int,
    fixed: Annotated[Vector, "FIXED"],
    first: Annotated[Vector, "FIRST"],
    sums: Annotated[Vector, "PRODUCTS"],
    state: Annotated[Vector, "STATES"],
    rates: Annotated[Vector, "STATES"],
    left: Annotated[Vector, "PRODUCTS"],
    right: Annotated[Vector, "PRODUCTS"],
) -> None:
{others}
"""


@dataclass(frozen=True)
class SeriesText:
    """Two functions in the engine's language, and the sizes of what they are given."""

    source: str
    fixed: int
    first: int
    products: int


def series_text(system: Recurrences, states: Sequence[str]) -> SeriesText:
    """The text of a system, for states in the given order."""
    writer = _Writer(system, states)
    first, others = ("\n".join(f"    {line}" for line in part) for part in writer.lines())
    products = -(-max(1, len(writer.products)) // WIDTH) * WIDTH
    source = HEADS.format(first=first, others=others)
    return SeriesText(source, len(system.fixed) or 1, len(writer.first) or 1, products)


class _Part(NamedTuple):
    """A signed summand of a coefficient, and after how many operations it is known."""

    known: int
    sign: int
    text: str


class _Writer:
    """The lines of both functions. Series i is z<i> at first, then s<i>."""

    def __init__(self, system: Recurrences, states: Sequence[str]) -> None:
        self.system, self.states = system, states
        self.fixed = {i: n for n, i in enumerate(system.fixed)}
        self.first: dict[Any, int] = {}
        self.products: list[tuple[int, int, bool]] = []
        self._known = dict.fromkeys(system.given.values(), 0)

    def lines(self) -> tuple[list[str], list[str]]:
        """Those of both functions."""
        system = self.system
        extended = ["by_k = 1.0 / k", "by_next = 1.0 / (k + 1)"]
        for name, i in system.given.items():
            at = "1.0 if k == 1 else 0.0" if name == TIME else f"state[{self.states.index(name)}]"
            extended.append(f"s{i} = {at}")
        coefficients = {i: self._coefficient(i, rule) for i, rule in system.rules.items()}
        kept = self._factors({i: n for n, i in enumerate(coefficients)})
        for i, text in coefficients.items():
            extended += [f"s{i} = {text}", *kept.pop(i, [])]
        extended += [line for lines in kept.values() for line in lines]
        extended += [f"rates[{j}] = {self._now(i)} * by_next" for j, i in enumerate(system.rates)]
        return self._begun(), extended

    def _factors(self, places: Mapping[int, int]) -> dict[int, list[str]]:
        """The lines that keep the factors of products, four at a time, by the series after which
        these are known; `places` are those in the order of series.
        """
        left = [(a, f"{'k * ' if slope else ''}s{a}") for a, _, slope in self.products]
        right = [(b, f"s{b}") for _, b, _ in self.products]
        lines: dict[int, list[str]] = {}
        for name, factors in (("left", left), ("right", right)):
            for n in range(0, len(factors), 4):
                some = factors[n : n + 4]
                last = max((i for i, _ in some), key=lambda i: places.get(i, -1))
                texts = [text for _, text in some] + ["0.0"] * (4 - len(some))
                line = f"{name}[{n}:{n + 4}] = [{', '.join(texts)}]"
                lines.setdefault(last, []).append(line)
        return lines

    # ---- the first coefficients ----

    def _begun(self) -> list[str]:
        system, lines = self.system, list[str]()
        for name, i in system.given.items():
            lines.append(f"z{i} = {'t' if name == TIME else f'y[{self.states.index(name)}]'}")
        for i in system.steps:
            operation, operands, _, _ = system.program.steps[i]
            lines.append(f"z{i} = {_applied(operation, [self._value(o) for o in operands])}")
        for i, rule in system.rules.items():
            if i > system.one:
                lines.append(f"z{i} = {self._auxiliary(rule)}")
        for key, place in self.first.items():
            match key:
                case "half", i:
                    value = f"0.5 / z{i}"
                case "inverse", i:
                    value = f"1.0 / {self._value(i)}"
                case i:
                    value = f"z{i}"
            lines.append(f"first[{place}] = {value}")
        return lines + [f"rates[{j}] = {self._value(i)}" for j, i in enumerate(system.rates)]

    def _auxiliary(self, rule: Rule) -> str:
        match rule:
            case Sum(terms):
                parts = (
                    f"{'+' if t.sign > 0 else '-'} {' * '.join(map(self._value, t.factors))}"
                    for t in terms
                )
                return " ".join(parts).removeprefix("+ ")
            case Root(of):
                return f"sqrt({self._value(of)})"
            case Solution(function, arguments):
                return _applied(function, [self._value(i) for i in arguments])
        raise AssertionError(f"{rule} is not auxiliary")

    def _value(self, i: int) -> str:
        """The first coefficient, in the first function."""
        if i == self.system.one:
            return "1.0"
        return f"fixed[{self.fixed[i]}]" if i in self.fixed else f"z{i}"

    # ---- the others ----

    def _kept(self, key: Any) -> str:
        return f"first[{self.first.setdefault(key, len(self.first))}]"

    def _zeroth(self, i: int) -> str:
        """The first coefficient, in the second function."""
        return self._kept(i) if self._moves(i) else self._value(i)

    def _moves(self, i: int) -> bool:
        return i not in self.fixed and i != self.system.one

    def _now(self, i: int) -> str:
        return f"s{i}" if self._moves(i) else "0.0"

    def _coefficient(self, i: int, rule: Rule) -> str:
        """Coefficient k of a series."""
        match rule:
            case Sum(terms):
                parts, sums = self._split(terms)
                return self._sum(i, parts, sums)
            case Quotient(terms, below):
                parts, sums = self._split(terms)
                if self._moves(below):
                    parts.append(self._part(-1, below, self._zeroth(i)))
                    sums.append(self._product(-1, below, i))
                return self._sum(i, parts, sums, self._kept(("inverse", below)))
            case Root(of):
                sums = [self._product(-1, i, i)]
                return self._sum(i, [self._part(1, of)], sums, self._kept(("half", i)))
            case Solution(_, _, terms, below):
                parts, sums = [], []
                for sign, u, v in terms:
                    parts.append(self._part(sign, u, "" if v is None else self._zeroth(v)))
                    if v is not None and self._moves(v):
                        sums.append(self._product(sign, u, v, slope=True))
                if below is not None:
                    sums.append(self._product(-1, i, below, slope=True))
                divisor = "" if below is None else self._kept(("inverse", below))
                return self._sum(i, parts, sums, divisor, by="by_k * ")

    def _part(self, sign: int, i: int, factor: str = "") -> _Part:
        known = self._known[i] + (MULTIPLY_ADD if factor else 0)
        return _Part(known, sign, f"{factor} * s{i}" if factor else f"s{i}")

    def _product(self, sign: int, a: int, b: int, *, slope: bool = False) -> str:
        """The sum of products of two series between their first and last coefficients."""
        key = (a, b, slope)
        if key not in self.products:
            self.products.append(key)
        return f"{'-' if sign < 0 else '+'} sums[{self.products.index(key)}]"

    def _split(self, terms: Iterable[Term]) -> tuple[list[_Part], list[str]]:
        """Terms as parts with the first coefficients, and sums over the others."""
        parts, sums = list[_Part](), list[str]()
        for sign, a, b in terms:
            if b is None:
                parts += [self._part(sign, a)] if self._moves(a) else []
            elif not self._moves(a):
                parts += [self._part(sign, b, self._value(a))] if self._moves(b) else []
            else:
                sums.append(self._product(sign, a, b))
                if a == b:
                    parts.append(self._part(sign, a, f"2.0 * {self._zeroth(a)}"))
                else:
                    parts.append(self._part(sign, a, self._zeroth(b)))
                    parts.append(self._part(sign, b, self._zeroth(a)))
        return parts, sums

    def _sum(
        self, i: int, parts: list[_Part], sums: Sequence[str], factor: str = "", by: str = ""
    ) -> str:
        """Coefficient k as a sum of sums of products, times `by`, and parts; times a factor."""
        texts = [" ".join(sums).removeprefix("+ ")] if sums else []
        if by and len(sums) == 1:
            sign, rest = ("-", sums[0][2:]) if sums[0][0] == "-" else ("", sums[0][2:])
            texts = [f"{sign}{by}{rest}"]
        elif by and sums:
            texts = [f"{by}({texts[0]})"]
        known = 0
        for part in sorted(parts):
            known = max(known + 1 if texts else 0, part.known)
            sign = "-" if part.sign < 0 else "+" if texts else ""
            texts.append(f"{sign} {part.text}" if texts else f"{sign}{part.text}")
        text = " ".join(texts) or "0.0"
        self._known[i] = known + bool(factor)
        return f"({text}) * {factor}" if factor else text


def _applied(operation: str, operands: Sequence[str]) -> str:
    """The text of an operation of a program."""
    if operation in FUNCTIONS:
        return f"{operation}({', '.join(operands)})"
    if operation == "neg":
        return f"-{operands[0]}"
    return f" {SYMBOLS[operation]} ".join(operands)
