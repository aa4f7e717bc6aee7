"""Taylor coefficients of motions over balls, and their derivatives by the start, as compiled text.

The recurrences are those of `program.taylor`. A coefficient's derivative obeys the derivative of
its recurrence: with c = F(u) and w c' = Σ ± u' v, a change of the start by δ changes c by
(Σ ± v δu) / w.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from eomgen.base.loading import load_source
from eomgen.certified.balls import Ball, Balls, OverBalls, ball, function_of
from eomgen.program.kernel import fixed_values
from eomgen.program.program import Program
from eomgen.program.tape import FUNCTIONS, TIME, Step
from eomgen.program.taylor import (
    Quotient,
    Recurrences,
    Root,
    Rule,
    Solution,
    Sum,
    Term,
    recurrences,
)
from eomgen.scalars.functions import CORNERS

Series = list[Balls]
"""The coefficients of each series."""
Fixed = Sequence[Ball]

SMOOTH = [name for name in FUNCTIONS if name not in CORNERS]
SYMBOLS = {"add": "+", "sub": "-", "mul": "*", "div": "/"}
HEAD = """\
from itertools import islice
from operator import mul


def dot(a, b):
    return sum(map(mul, a, reversed(b)))


def dot_from_1(a, b):
    return sum(map(mul, islice(a, 1, None), reversed(b)))


"""


@dataclass(frozen=True, eq=False)
class Motion:
    """The recurrences of a mechanism's motion, ready to be computed.

    names    of the components of the state: those of the program, then parameters that vary
    series   computes coefficients 0 to `order` of the components and of all series, from the fixed
             values, the time, the state and the order
    change   computes coefficients 0 to `order` of the components' derivatives by the start along a
             direction, from the fixed values, all series, the direction and the order
    plain, plain_change  the same with doubles, which prove nothing
    """

    names: tuple[str, ...]
    series: Callable[[Fixed, Ball, Balls, int], tuple[Series, Series]]
    change: Callable[[Fixed, Series, Balls, int], Series]
    plain: Callable[[Fixed, float, Balls, int], tuple[Series, Series]]
    plain_change: Callable[[Fixed, Series, Balls, int], Series]
    _program: Program
    _fixed: tuple[int, ...]

    @classmethod
    def of(cls, program: Program, states: Sequence[str], varied: Sequence[str] = ()) -> "Motion":
        """That of a program with these states; parameters in `varied` are states that stay.

        Raises `NoSeriesError` if a function with a corner or a jump depends on them.
        """
        names = (*states, *varied)
        system = recurrences(program, names)
        writer = _Writer(system, names, len(states))
        module = load_source(writer.source(), "balls")
        balls = ({name: function_of(name) for name in SMOOTH}, ball(0.0), ball(1.0))
        doubles = ({name: getattr(math, name) for name in SMOOTH}, 0.0, 1.0)

        def series(numbers: Any) -> Callable[[Fixed, Ball, Balls, int], tuple[Series, Series]]:
            return lambda fixed, t, y, order: module.series(fixed, t, y, order, *numbers)

        def change(numbers: Any) -> Callable[[Fixed, Series, Balls, int], Series]:
            return lambda fixed, found, along, order: module.change(
                fixed, found, along, order, *numbers[1:]
            )

        return cls(
            *(names, series(balls), change(balls), series(doubles), change(doubles)),
            *(program, system.fixed),
        )

    def fixed(self, values: Mapping[str, Ball]) -> Fixed:
        """The values that do not change, from those of parameters and inputs."""
        found = fixed_values(self._program, self._fixed, values, OverBalls())
        return [found[i] for i in self._fixed]


class _Writer:
    """The text of both functions. Series i is the list s<i>, its first coefficient z<i>; its
    derivative is the list d<i>.
    """

    def __init__(self, system: Recurrences, names: Sequence[str], moving: int) -> None:
        self.system, self.names, self.moving = system, names, moving
        self.place = {i: n for n, i in enumerate((*system.given.values(), *system.rules))}
        self.fixed = {i: f"fixed[{n}]" for n, i in enumerate(system.fixed)}
        self.fixed[system.one] = "one"
        self.slopes, self.divisors = self._slopes(), self._divisors()

    def source(self) -> str:
        """Both functions."""
        series = "\n".join(f"    {line}" for line in self._series())
        change = "\n".join(f"    {line}" for line in self._change())
        return (
            f"{HEAD}def series(fixed, t, y, order, calls, zero, one):\n{series}\n\n\n"
            f"def change(fixed, found, direction, order, zero, one):\n{change}\n"
        )

    # ---- coefficients ----

    def _series(self) -> list[str]:
        system, lines = self.system, list[str]()
        for name, i in system.given.items():
            lines.append(f"z{i} = {'t' if name == TIME else f'y[{self.names.index(name)}]'}")
        for i in system.steps:
            lines.append(f"z{i} = {self._applied(system.program.steps[i])}")
        for i, rule in system.rules.items():
            if i > system.one:
                lines.append(f"z{i} = {self._auxiliary(rule)}")
        lines += [f"s{i} = [z{i}]" for i in self.place]
        lines += [f"u{i} = [zero]" for i in self.slopes]
        lines += [f"i{i} = 1 / {self._first(i)}" for i in self.divisors]
        n = len(self.names)
        lines.append(f"states = [[y[j]] for j in range({n})]")
        lines += ["for k in range(order):", "    if k:"]
        for name, i in system.given.items():
            next_one = "one if k == 1 else zero"
            value = next_one if name == TIME else f"states[{self.names.index(name)}][k]"
            lines += self._kept(i, value)
        for i, rule in system.rules.items():
            lines += self._kept(i, self._coefficient(i, rule))
        lines += [
            f"    states[{j}].append({self._last(i)} / (k + 1))" for j, i in enumerate(system.rates)
        ]
        lines += [f"    states[{j}].append(zero)" for j in range(self.moving, n)]
        listed = ", ".join(f"s{i}" for i in self.place)
        return [*lines, f"return states, [{listed}]"]

    def _slopes(self) -> dict[int, None]:
        """The series u whose slopes, k u_k, are used."""
        rules = [r for r in self.system.rules.values() if isinstance(r, Solution)]
        used = {t.left for r in rules for t in r.terms if t.right is not None}
        used |= {i for i, r in self.system.rules.items() if isinstance(r, Solution) and r.below}
        return dict.fromkeys(i for i in self.place if i in used)

    def _divisors(self) -> list[int]:
        rules = self.system.rules.values()
        used = {r.below for r in rules if isinstance(r, Quotient | Solution)}
        roots = {i for i, r in self.system.rules.items() if isinstance(r, Root)}
        return [i for i in (*self.fixed, *self.place) if i in used or i in roots]

    def _kept(self, i: int, value: str) -> list[str]:
        lines = [f"        s{i}.append({value})"]
        return lines + [f"        u{i}.append(k * s{i}[k])"] * (i in self.slopes)

    def _first(self, i: int) -> str:
        return f"z{i}" if i in self.place else self.fixed.get(i, f"z{i}")

    def _last(self, i: int) -> str:
        if i in self.place:
            return f"s{i}[k]"
        return f"({self.fixed[i]} if k == 0 else zero)"

    def _applied(self, step: Step) -> str:
        operands = [self._first(o) for o in step.operands]
        if step.operation in FUNCTIONS:
            return f"calls['{step.operation}']({', '.join(operands)})"
        if step.operation == "neg":
            return f"-{operands[0]}"
        return f" {SYMBOLS[step.operation]} ".join(operands)

    def _auxiliary(self, rule: Rule) -> str:
        match rule:
            case Sum(terms):
                return _signed((t.sign, " * ".join(map(self._first, t.factors))) for t in terms)
            case Root(of):
                return f"calls['sqrt']({self._first(of)})"
            case Solution(function, arguments):
                return f"calls['{function}']({', '.join(map(self._first, arguments))})"
        raise AssertionError(f"{rule} is not auxiliary")

    def _coefficient(self, i: int, rule: Rule) -> str:
        match rule:
            case Sum(terms):
                return self._sum(terms)
            case Quotient(terms, below):
                text = self._sum(terms)
                if below in self.place:
                    text = f"{text} - dot_from_1(s{below}, s{i})"
                return f"({text}) * i{below}"
            case Root(of):
                return f"(s{of}[k] - dot_from_1(s{i}, s{i}[1:])) * i{i} / 2"
            case Solution(_, _, terms, below):
                parts = self._slopes_of(terms, "dot_from_1(u{0}, s{1}[:k])", "k * s{0}[k]")
                if below in self.place:
                    parts.append((-1, f"dot_from_1(u{i}, s{below}[1:k])"))
                text = f"({_signed(parts)}) / k"
                return text if below is None else f"{text} * i{below}"

    def _slopes_of(self, terms: Sequence[Term], both: str, one: str) -> list[tuple[int, str]]:
        """Signed texts of u' v: `both` if u and v move, else `one`, times v."""
        parts = []
        for sign, u, v in terms:
            if u in self.place and v in self.place:
                parts.append((sign, both.format(u, v)))
            elif u in self.place:
                factor = "" if v is None else f" * {self.fixed[v]}"
                parts.append((sign, one.format(u) + factor))
        return parts

    def _sum(self, terms: Sequence[Term]) -> str:
        parts = []
        for sign, a, b in terms:
            if b is None:
                parts += [(sign, f"s{a}[k]")] if a in self.place else []
            elif a in self.place:
                parts.append((sign, f"dot(s{a}, s{b})"))
            elif b in self.place:
                parts.append((sign, f"{self.fixed[a]} * s{b}[k]"))
        return _signed(parts)

    # ---- their derivatives ----

    def _change(self) -> list[str]:
        system = self.system
        lines = [f"s{i} = found[{n}]" for i, n in self.place.items()]
        lines += [
            f"i{i} = 1 / {f's{i}[0]' if i in self.place else self.fixed[i]}" for i in self.divisors
        ]
        lines += [f"d{i} = []" for i in self.place]
        lines += ["states = [[d] for d in direction]", "for k in range(order):"]
        for name, i in system.given.items():
            value = "zero" if name == TIME else f"states[{self.names.index(name)}][k]"
            lines.append(f"    d{i}.append({value})")
        for i, rule in system.rules.items():
            lines.append(f"    d{i}.append({self._derivative(i, rule)})")
        for j, i in enumerate(system.rates):
            value = f"d{i}[k] / (k + 1)" if i in self.place else "zero"
            lines.append(f"    states[{j}].append({value})")
        lines += [f"    states[{j}].append(zero)" for j in range(self.moving, len(self.names))]
        return [*lines, "return states"]

    def _derivative(self, i: int, rule: Rule) -> str:
        match rule:
            case Sum(terms):
                return self._linear(terms)
            case Quotient(terms, below):
                text = self._linear(terms)
                if below in self.place:
                    text = f"{text} - dot(s{i}, d{below}) - dot_from_1(s{below}, d{i})"
                return f"({text}) * i{below}"
            case Root(of):
                return f"(d{of}[k] / 2 - dot_from_1(s{i}, d{i})) * i{i}"
            case Solution(_, _, terms, below):
                parts = self._slopes_of(terms, "dot(s{1}, d{0})", "d{0}[k]")
                if below in self.place:
                    parts.append((-1, f"dot_from_1(s{below}, d{i})"))
                text = _signed(parts)
                return text if below is None else f"({text}) * i{below}"

    def _linear(self, terms: Sequence[Term]) -> str:
        parts = []
        for sign, a, b in terms:
            if b is None:
                parts += [(sign, f"d{a}[k]")] if a in self.place else []
            elif a in self.place and a == b:
                parts.append((sign, f"2 * dot(s{a}, d{a})"))
            elif a in self.place:
                parts += [(sign, f"dot(s{a}, d{b})"), (sign, f"dot(s{b}, d{a})")]
            elif b in self.place:
                parts.append((sign, f"{self.fixed[a]} * d{b}[k]"))
        return _signed(parts)


def _signed(parts: Any) -> str:
    """The sum of signed texts."""
    text = " ".join(f"{'+' if sign > 0 else '-'} {part}" for sign, part in parts)
    return text.removeprefix("+ ") or "zero"
