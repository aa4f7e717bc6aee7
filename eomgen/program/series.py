"""Taylor coefficients of a solution by its recurrences, over any scalars.

This states each rule in its plainest form. Compiled code computes the same: `eomgen.native.taylor`.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from eomgen.program.tape import ARITHMETIC, FUNCTIONS
from eomgen.program.taylor import Quotient, Recurrences, Root, Rule, Solution, Sum, Term
from eomgen.scalars.protocol import Scalars


def coefficients(
    system: Recurrences,
    fixed: Mapping[int, Any],
    t: Any,
    y: Mapping[str, Any],
    order: int,
    scalars: Scalars,
) -> list[list[Any]]:
    """The Taylor coefficients of a solution, (order + 1, ny), from its state `y` at t on.

    `fixed` are the values of the system's fixed steps, `y` the states by name, in order.
    """
    series = _Series(system, fixed, t, y, scalars)
    found, rates = [list(y.values())], system.rates
    for k in range(order):
        number = scalars.number(float(k + 1))
        found.append([series.at(i, k) / number for i in rates])
        if k + 1 < order:
            series.extend(dict(zip(y, found[-1], strict=True)), k + 1)
    return found


class _Series:
    """The coefficients of all series so far."""

    def __init__(
        self,
        system: Recurrences,
        fixed: Mapping[int, Any],
        t: Any,
        y: Mapping[str, Any],
        scalars: Scalars,
    ) -> None:
        self._system, self._scalars = system, scalars
        self._zero, self._one = scalars.number(0.0), scalars.number(1.0)
        self._first = {**fixed, system.one: self._one}
        self._first |= {i: y.get(name, t) for name, i in system.given.items()}
        self._start()
        self._of = {i: [self._first[i]] for i in (*system.given.values(), *system.rules)}

    def at(self, i: int, k: int) -> Any:
        """Coefficient k of a series or of a fixed number."""
        if i in self._of:
            return self._of[i][k]
        return self._first[i] if k == 0 else self._zero

    def extend(self, states: Mapping[str, Any], k: int) -> None:
        """Add coefficient k to all series, from that of the states."""
        time = self._one if k == 1 else self._zero
        for name, i in self._system.given.items():
            self._of[i].append(states.get(name, time))
        for i, rule in self._system.rules.items():
            self._of[i].append(self._coefficient(i, rule, k))

    def _start(self) -> None:
        """The first coefficients: the values of the program, and of auxiliary steps."""
        values, program = self._first, self._system.program
        for i in self._system.steps:
            operation, operands, _, _ = program.steps[i]
            parts = [values[o] for o in operands]
            if operation in FUNCTIONS:
                values[i] = self._scalars.call(operation, *parts)
            else:
                values[i] = -parts[0] if operation == "neg" else ARITHMETIC[operation](*parts)
        for i, rule in self._system.rules.items():
            if i > self._system.one:
                match rule:
                    case Sum(terms):
                        values[i] = self._value(terms)
                    case Root(of):
                        values[i] = self._scalars.call("sqrt", values[of])
                    case Solution(function, arguments):
                        parts = [values[o] for o in arguments]
                        values[i] = self._scalars.call(function, *parts)

    def _value(self, terms: Sequence[Term]) -> Any:
        total = self._zero
        for sign, left, right in terms:
            part = self._first[left] if right is None else self._first[left] * self._first[right]
            total = total + part if sign > 0 else total - part
        return total

    def _coefficient(self, i: int, rule: Rule, k: int) -> Any:
        match rule:
            case Sum(terms):
                return self._sum(terms, k)
            case Quotient(terms, below):
                rest = self._product(below, i, k, range(1, k + 1))
                return (self._sum(terms, k) - rest) / self._first[below]
            case Root(of):
                rest = self._product(i, i, k, range(1, k))
                return (self.at(of, k) - rest) / (self._first[i] + self._first[i])
            case Solution(_, _, terms, below):
                total = self._zero
                for sign, u, v in terms:
                    part = self._slope(u, v, k, range(1, k + 1))
                    total = total + part if sign > 0 else total - part
                if below is None:
                    return total
                return (total - self._slope(i, below, k, range(1, k))) / self._first[below]

    def _sum(self, terms: Sequence[Term], k: int) -> Any:
        total = self._zero
        for sign, left, right in terms:
            part = (
                self.at(left, k) if right is None else self._product(left, right, k, range(k + 1))
            )
            total = total + part if sign > 0 else total - part
        return total

    def _product(self, a: int, b: int, k: int, places: range) -> Any:
        """The sum of a_i b_(k-i) over some i."""
        total = self._zero
        for i in places:
            total = total + self.at(a, i) * self.at(b, k - i)
        return total

    def _slope(self, u: int, v: int | None, k: int, places: range) -> Any:
        """Coefficient k of the integral of u' v, with i over `places`: Σ i u_i v_(k-i) / k."""
        if v is None:
            return self.at(u, k)
        total = self._zero
        for i in places:
            total = total + self._scalars.number(float(i)) * self.at(u, i) * self.at(v, k - i)
        return total / self._scalars.number(float(k))
