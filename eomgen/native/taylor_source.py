"""C source of the recurrences of Taylor coefficients: what `templates/c/taylor.c.jinja` is filled
with.

Coefficients of a series that products need are kept in order, some times their index, `A`, and
those of the other factor in reverse, `R`: so a sum of products runs through two arrays in one
direction, several at a time. The terms with the first and the last coefficients are added to it one
by one, those that are known last in the end: how fast a step is depends on the longest chain of
operations that need each other's results.
"""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from eomgen.program.tape import FUNCTIONS, TIME
from eomgen.program.taylor import Quotient, Recurrences, Root, Rule, Solution, Sum, Term

WIDTH = 4
"""Sums of products that are computed together, each by as many lanes."""
SMALL, BLOCKS = 64, 4
"""With more sums than this, several times `WIDTH` of them are computed by each call; else code
for each number of terms is inlined."""
LATER = 30
"""So many series later than its last factor the products of a call are computed: what has just been
stored number by number cannot be loaded as a vector at once. In small systems they come last."""
SYMBOLS = {"add": "+", "sub": "-", "mul": "*", "div": "/"}
MULTIPLY_ADD = 4
"""Latency of an operation, in cycles, by which terms are ordered."""


class Part(NamedTuple):
    """A signed summand of a coefficient, and when it is known, in cycles."""

    known: int
    sign: int
    text: str


class Writer:
    """The lines that compute the coefficients of a system, for states in the given order."""

    def __init__(self, system: Recurrences, states: Sequence[str]) -> None:
        self._system, self._states = system, states
        self._fixed = {i: n for n, i in enumerate(system.fixed)}
        self._kept: dict[str, dict[Any, int]] = {name: {} for name in "ARZI"}
        self._known: dict[int, int] = {}
        self.start: list[str] = []
        self._products: list[tuple[int, int, bool]] = []
        self._texts: dict[int, str] = {}
        for name, i in system.given.items():
            self._known[i] = 0
            at = "t" if name == TIME else f"y[{states.index(name)}]"
            self.start.append(f"const double z{i} = {at};")
        for i, rule in system.rules.items():
            self._write(i, rule)
        self._start()

    @property
    def context(self) -> dict[str, Any]:
        """Values for the template."""
        given = [
            (i, "k == 1" if name == TIME else f"next[{self._states.index(name)}]")
            for name, i in self._system.given.items()
        ]
        blocks = BLOCKS if len(self._products) > SMALL else 1
        factors, lines = self._interleaved(WIDTH * blocks)
        return {
            "states": len(self._states),
            "width": WIDTH,
            "blocks": blocks,
            "unrolled": blocks == 1,
            "start": self.start,
            "first": [self._first(i) for i in self._system.rates],
            "given": given,
            "factors": factors,
            "lines": lines,
            "rates": [self._now(i) for i in self._system.rates],
            "sizes": {name: max(1, len(kept)) for name, kept in self._kept.items()},
        }

    def _interleaved(self, together: int) -> tuple[list[tuple[int, int]], list[str]]:
        """The places of the factors of each product, and the lines for coefficient k.

        Among these are calls that begin to compute coefficient k + 1: each adds up the products of
        `together` sums as soon as their factors are known. They need nothing that the lines around
        them compute, so the processor does both at once.
        """
        rank = {i: n for n, i in enumerate([*self._system.given.values(), *self._texts])}
        ready = [max(rank[a], rank[b]) for a, b, _ in self._products]
        order = sorted(range(len(ready)), key=lambda n: ready[n])
        numbers = sorted(range(len(order)), key=order.__getitem__)
        factors = [self._factors(*self._products[n]) for n in order]
        stores: dict[int, list[str]] = {}
        for (i, slope), place in self._kept["A"].items():
            text = f"A[{place}][k - 1] = {'k * ' if slope else ''}s{i};"
            stores.setdefault(i, []).append(text)
        for i, place in self._kept["R"].items():
            stores.setdefault(i, []).append(f"R[{place}][HIGHEST - k] = s{i};")
        calls: dict[int, list[str]] = {}
        later = LATER if len(order) > SMALL else len(rank)
        for first in range(0, len(order), together):
            last = ready[order[min(first + together, len(order)) - 1]] + later
            calls.setdefault(min(last, len(rank) - 1), []).append(f"MULTIPLY({first});")
        lines = []
        for i, n in rank.items():
            if i in self._texts:
                lines.append(self._texts[i].format(*numbers))
            lines += [*stores.get(i, []), *calls.get(n, [])]
        missing = -len(factors) % together
        return [*factors, *[(0, 0)] * missing], lines

    def _factors(self, a: int, b: int, slope: bool) -> tuple[int, int]:
        """The places of two factors; they change places if arrays are kept for that already."""
        kept, back = self._kept["A"], self._kept["R"]
        if not slope and ((a, False) not in kept) + (b not in back) > (
            ((b, False) not in kept) + (a not in back)
        ):
            a, b = b, a
        return kept.setdefault((a, slope), len(kept)), back.setdefault(b, len(back))

    def _place(self, array: str, key: Any) -> str:
        kept = self._kept[array]
        return f"{array}[{kept.setdefault(key, len(kept))}]"

    def _first(self, i: int) -> str:
        """The first coefficient, in the part that computes them."""
        if i == self._system.one:
            return "1.0"
        return f"K[{self._fixed[i]}]" if i in self._fixed else f"z{i}"

    def _zeroth(self, i: int) -> str:
        """The first coefficient, in the part that computes the others."""
        if i == self._system.one or i in self._fixed:
            return self._first(i)
        return self._place("Z", i)

    def _moves(self, i: int) -> bool:
        return i not in self._fixed and i != self._system.one

    def _now(self, i: int) -> str:
        """Coefficient k."""
        return f"s{i}" if self._moves(i) else "0.0"

    def _write(self, i: int, rule: Rule) -> None:
        match rule:
            case Sum(terms):
                parts, products = self._split(terms)
                self._add(i, parts, products)
            case Quotient(terms, below):
                parts, products = self._split(terms)
                if self._moves(below):
                    parts.append(self._part(-1, below, self._zeroth(i)))
                    products.append((-1, False, below, i))
                self._add(i, parts, products, self._place("I", below))
            case Root(of):
                half = self._place("I", ("half", i))
                self._add(i, [self._part(1, of)], [(-1, False, i, i)], half)
            case Solution(_, _, terms, below):
                parts, products = [], []
                for sign, u, v in terms:
                    factor = self._zeroth(v) if v is not None else ""
                    parts.append(self._part(sign, u, factor))
                    if v is not None and self._moves(v):
                        products.append((sign, True, u, v))
                if below is not None:
                    products.append((-1, True, i, below))
                divisor = "" if below is None else self._place("I", below)
                self._add(i, parts, products, divisor, of_slopes=True)

    def _part(self, sign: int, i: int, factor: str = "") -> Part:
        known = self._known[i] + (MULTIPLY_ADD if factor else 0)
        return Part(known, sign, f"{factor} * s{i}" if factor else f"s{i}")

    def _split(self, terms: Iterable[Term]) -> tuple[list[Part], list[tuple[int, bool, int, int]]]:
        """Terms as parts with the first or the last coefficients, and sums over the others."""
        parts: list[Part] = []
        products: list[tuple[int, bool, int, int]] = []
        for sign, a, b in terms:
            if b is None:
                parts += [self._part(sign, a)] if self._moves(a) else []
            elif not self._moves(a):
                parts += [self._part(sign, b, self._zeroth(a))] if self._moves(b) else []
            else:
                products.append((sign, False, a, b))
                if a == b:
                    parts.append(self._part(sign, a, f"2.0 * {self._zeroth(a)}"))
                else:
                    parts.append(self._part(sign, a, self._zeroth(b)))
                    parts.append(self._part(sign, b, self._zeroth(a)))
        return parts, products

    def _add(
        self,
        i: int,
        parts: list[Part],
        products: Sequence[tuple[int, bool, int, int]],
        factor: str = "",
        *,
        of_slopes: bool = False,
    ) -> None:
        """Write coefficient k as a sum of parts and sums of products, times a factor."""
        texts = list[str]()
        for sign, slope, a, b in products:
            texts.append(
                f"{'-' if sign < 0 else '+' if texts else ''} d[{{{len(self._products)}}}]"
            )
            self._products.append((a, b, slope))
        if of_slopes and texts:
            texts = [f"({' '.join(texts)}) * by_k"]
        known = 0
        for part in sorted(parts):
            known = max(known + MULTIPLY_ADD if texts else 0, part.known)
            mark = "-" if part.sign < 0 else "+" if texts else ""
            texts.append(f"{mark} {part.text}" if texts else f"{mark}{part.text}")
        text = " ".join(texts) or "0.0"
        self._texts[i] = f"const double s{i} = {f'({text}) * {factor}' if factor else text};"
        self._known[i] = known + (MULTIPLY_ADD if factor else 0)

    def _start(self) -> None:
        """Write the first coefficients, and what is derived from them."""
        program, first = self._system.program, self._first
        for i in self._system.steps:
            operation, operands, _, _ = program.steps[i]
            parts = [first(o) for o in operands]
            if operation == "neg":
                text = f"-{parts[0]}"
            elif operation in FUNCTIONS:
                text = f"{operation}({', '.join(parts)})"
            else:
                text = f" {SYMBOLS[operation]} ".join(parts)
            self.start.append(f"const double z{i} = {text};")
        for i, rule in self._system.rules.items():
            if i > self._system.one:
                self.start.append(f"const double z{i} = {self._auxiliary(rule)};")
        for key, place in self._kept["Z"].items():
            self.start.append(f"Z[{place}] = z{key};")
        for key, place in self._kept["I"].items():
            halved = isinstance(key, tuple)
            text = f"0.5 / z{key[1]}" if halved else f"1.0 / {first(key)}"
            self.start.append(f"I[{place}] = {text};")

    def _auxiliary(self, rule: Rule) -> str:
        match rule:
            case Sum(terms):
                return "".join(
                    f" {'+' if term.sign > 0 else '-'} {' * '.join(map(self._first, term.factors))}"
                    for term in terms
                ).removeprefix(" + ")
            case Root(of):
                return f"sqrt({self._first(of)})"
            case Solution(function, arguments):
                return f"{function}({', '.join(map(self._first, arguments))})"
        raise AssertionError(f"{rule} is not auxiliary")
