"""Taylor series of the solution of y' = f(t, y) from the program of f, by recurrences.

If x and z are series in t, then (x z)_k = Σ x_i z_(k-i). Quotients, roots and functions follow from
the products or the differential equations that they satisfy, such as (sin x)' = x' cos x: Moore,
Interval Analysis, 1966, chapter 11; Jorba and Zou, A software package for the numerical integration
of ODEs by means of high-order Taylor methods, Experimental Mathematics 14, 2005.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from eomgen.program.program import Program, live_steps
from eomgen.program.tape import TIME, Step
from eomgen.scalars.functions import CORNERS


class Term(NamedTuple):
    """A signed series, or product of two; if a factor is fixed, it is the left one."""

    sign: int
    left: int
    right: int | None = None

    @property
    def factors(self) -> tuple[int, ...]:
        """The series multiplied."""
        return (self.left,) if self.right is None else (self.left, self.right)


@dataclass(frozen=True)
class Sum:
    """The sum of terms."""

    terms: tuple[Term, ...]


@dataclass(frozen=True)
class Quotient:
    """The sum of terms, divided by a series or a fixed number."""

    terms: tuple[Term, ...]
    below: int


@dataclass(frozen=True)
class Root:
    """The square root of a series."""

    of: int


@dataclass(frozen=True)
class Solution:
    """The series c that satisfies w c' = Σ ± u' v, where v or w are 1 if they are None.

    Its first coefficient is a function of those of the arguments. Its coefficient k depends on
    those of u up to k, but of v and w up to k - 1 only.
    """

    function: str
    arguments: tuple[int, ...]
    terms: tuple[Term, ...]
    below: int | None = None


Rule = Sum | Quotient | Root | Solution


class NoSeriesError(Exception):
    """A function without a Taylor series; the text is its name."""


@dataclass(frozen=True)
class Recurrences:
    """Rules for the series between the states and their derivatives.

    Numbers below `len(program.steps)` are steps of the program; those from there on are auxiliary.

    given    the inputs that are series: time and the states, by name
    steps    steps of the program that change along a motion, `given` apart, in order
    rules    the rule of each series, in an order in which coefficients can be computed; steps that
             other rules contain have none
    fixed    the other steps that these or `rates` use, which do not change, in order
    one      the number of the auxiliary step 1, which is fixed
    rates    the derivatives of the states, in their order
    """

    program: Program
    given: Mapping[str, int]
    steps: tuple[int, ...]
    rules: Mapping[int, Rule]
    fixed: tuple[int, ...]
    one: int
    rates: tuple[int, ...]


def recurrences(program: Program, states: Sequence[str], output: str = "derivative") -> Recurrences:
    """The recurrences of y' = `output`, where `states` are the inputs that are components of y.

    Raises `NoSeriesError` if a function with a corner or a jump depends on them, or on time.
    """
    steps, rates = program.steps, program.outputs[output].nodes
    given, moving = dict[str, int](), set[int]()
    live = live_steps(program, rates)
    for i in live:
        step = steps[i]
        if step.operation == "input" and (step.value == TIME or step.value in states):
            given[str(step.value)] = i
        if i in given.values() or any(o in moving for o in step.operands):
            moving.add(i)
    inside = [i for i in live if i in moving and steps[i].operation != "input"]
    rules = _Rules(
        program, moving, Counter([*rates, *(o for i in live for o in steps[i].operands)])
    )
    for i in inside:
        rules.add(i, steps[i])
    used = {o for i in inside for o in steps[i].operands} | set(rates)
    fixed = tuple(i for i in live if i in used and i not in moving)
    return Recurrences(program, given, tuple(inside), rules.found, fixed, rules.one, rates)


class _Rules:
    """The rules of a program's steps; a sum that is used once becomes part of what uses it."""

    def __init__(self, program: Program, moving: set[int], uses: Mapping[int, int]) -> None:
        self._moving, self._uses = moving, uses
        self.one = len(program.steps)
        self._next = self.one + 1
        self._pairs: dict[tuple[str, int], int] = {
            (step.operation, step.operands[0]): i
            for i, step in enumerate(program.steps)
            if step.operation in ("sin", "cos") and i in moving
        }
        self.found: dict[int, Rule] = {}

    def add(self, i: int, step: Step) -> None:
        """Add the rules of a step, and auxiliary ones that it needs."""
        of = step.operands
        match step.operation:
            case "add" | "sub":
                second = 1 if step.operation == "add" else -1
                self.found[i] = Sum((*self._terms(1, of[0]), *self._terms(second, of[1])))
            case "neg":
                self.found[i] = Sum(self._terms(-1, of[0]))
            case "mul":
                self.found[i] = Sum((self._product(*of),))
            case "div":
                self.found[i] = Quotient(self._terms(1, of[0]), of[1])
            case "sqrt":
                self.found[i] = Root(of[0])
            case function if function in CORNERS:
                raise NoSeriesError(function)
            case "sin" | "cos":
                self._add_pair(of[0])
            case function:
                self._add_function(i, function, of)

    def _terms(self, sign: int, i: int) -> tuple[Term, ...]:
        rule = self.found.get(i)
        if isinstance(rule, Sum) and self._uses[i] == 1:
            del self.found[i]
            return tuple(Term(sign * term.sign, *term.factors) for term in rule.terms)
        return (Term(sign, i),)

    def _product(self, a: int, b: int) -> Term:
        return Term(1, a, b) if b in self._moving else Term(1, b, a)

    def _auxiliary(self, rule: Rule) -> int:
        self._next += 1
        self.found[self._next - 1] = rule
        return self._next - 1

    def _add_pair(self, x: int) -> None:
        """sin x and cos x: each one's derivative contains the other."""
        sine, cosine = (self._pairs.get((name, x)) for name in ("sin", "cos"))
        if sine in self.found or cosine in self.found:
            return
        if sine is None:
            sine, self._next = self._next, self._next + 1
        if cosine is None:
            cosine, self._next = self._next, self._next + 1
        self.found[sine] = Solution("sin", (x,), (Term(1, x, cosine),))
        self.found[cosine] = Solution("cos", (x,), (Term(-1, x, sine),))

    def _add_function(self, i: int, function: str, of: tuple[int, ...]) -> None:
        x, one = of[0], Term(1, self.one)
        match function:
            case "exp":
                self.found[i] = Solution(function, of, (Term(1, x, i),))
            case "log":
                self.found[i] = Solution(function, of, (Term(1, x),), x)
            case "tan" | "tanh":
                # The derivative is x' (1 ± i²), of which only earlier coefficients are used.
                slope = self._next
                self.found[i] = Solution(function, of, (Term(1, x, slope),))
                self._auxiliary(Sum((one, Term(1 if function == "tan" else -1, i, i))))
            case "atan":
                below = self._auxiliary(Sum((one, Term(1, x, x))))
                self.found[i] = Solution(function, of, (Term(1, x),), below)
            case "asin" | "acos":
                below = self._auxiliary(Root(self._auxiliary(Sum((one, Term(-1, x, x))))))
                sign = 1 if function == "asin" else -1
                self.found[i] = Solution(function, of, (Term(sign, x),), below)
            case "atan2":
                y, x = of
                squares = tuple(Term(1, z, z) for z in of if z in self._moving)
                still = tuple(self._product(z, z) for z in of if z not in self._moving)
                below = self._auxiliary(Sum((*squares, *still)))
                terms = [Term(1, y, x)] if y in self._moving else []
                terms += [Term(-1, x, y)] if x in self._moving else []
                self.found[i] = Solution(function, of, tuple(terms), below)
            case _:
                raise AssertionError(f"no series is known for {function}")
