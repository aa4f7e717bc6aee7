"""Lowering of SymPy expressions to the tape.

SymPy's sums and products have many operands in no particular order of evaluation. Lowering chooses
one: factors that depend on parameters alone are multiplied first, so that their product is computed
once. Such coefficients of one product are added. Then terms with the same coefficient are added
before they are multiplied by it.
"""

import math
from collections.abc import Mapping
from typing import Any

import sympy as sp

from eomgen.program.tape import Node, Stage, Tape, power, total


class Lowering:
    """Lowers expressions to nodes of a tape.

    A symbol is either `known` as a node or `defined` by another expression. A definition is lowered
    when an expression first uses it; an unused definition adds no steps.
    """

    def __init__(self, tape: Tape, known: Mapping[Any, Node], defined: Mapping[Any, Any]) -> None:
        self._tape = tape
        self._nodes: dict[Any, Node] = dict(known)
        self._defined = defined

    def lower(self, expression: Any) -> Node:
        """The node that computes an expression.

        Raises `KeyError` for a symbol that is neither known nor defined.
        """
        node = self._nodes.get(expression)
        if node is None:
            node = self._nodes[expression] = self._lower(expression)
        return node

    def _lower(self, expression: Any) -> Node:
        if expression.is_Number:
            return self._number(expression)
        if expression.is_Symbol:
            node = self.lower(self._defined[expression])
            if node.step.operation not in ("input", "constant", "neg"):
                self._tape.named(node, expression.name.replace("__", "_"))
            return node
        if expression.is_Add:
            return self._sum(expression)
        if expression.is_Mul or expression.is_Pow:
            fixed, moving = self._factors(expression)
            return fixed * moving if fixed.step.stage <= Stage.PARAMETERS else moving
        name = type(expression).__name__
        return self._tape.apply(name, *[self.lower(part) for part in expression.args])

    def _number(self, number: Any) -> Node:
        """A number; if it is too large for a double, a product that overflows when computed."""
        if math.isfinite(float(number)):
            return self._tape.constant(float(number))
        root = self._number(sp.sqrt(abs(number)))
        return root * root if number > 0 else -(root * root)

    def _factors(self, expression: Any) -> tuple[Node, Node]:
        """A product split in two: the factors that depend on parameters alone, and the rest."""
        one = self._tape.constant(1.0)
        tops: dict[bool, list[Node]] = {True: [], False: []}
        bottoms: dict[bool, list[Node]] = {True: [], False: []}
        for factor in sp.Mul.make_args(expression):
            base, exponent = factor.as_base_exp()
            if factor.is_Rational and not factor.is_Integer:
                tops[True].append(self._tape.constant(int(factor.p)))
                bottoms[True].append(self._tape.constant(int(factor.q)))
                continue
            assert exponent.is_Integer, "roots occur only in formulas, which are not lowered here"
            node = self.lower(base)
            side = tops if exponent > 0 else bottoms
            fixed = node.step.stage <= Stage.PARAMETERS
            side[fixed].append(power(node, abs(int(exponent))))
        parts = []
        for fixed in (True, False):
            top, bottom = one, one
            for node in sorted(tops[fixed], key=lambda n: (n.step.stage, n.index)):
                top = top * node
            for node in sorted(bottoms[fixed], key=lambda n: (n.step.stage, n.index)):
                bottom = bottom * node
            parts.append(top / bottom)
        return parts[0], parts[1]

    def _sum(self, expression: Any) -> Node:
        coefficients: dict[int, tuple[Node, list[Node]]] = {}
        plain: list[Node] = []
        for term in expression.args:
            fixed, moving = self._factors(term)
            if moving.step.stage <= Stage.PARAMETERS:
                plain.append(fixed * moving)
                continue
            if moving.step.operation == "neg":
                fixed, moving = -fixed, -moving
            coefficients.setdefault(moving.index, (moving, []))[1].append(fixed)
        groups: dict[int, tuple[Node, list[Node]]] = {}
        for moving, parts in coefficients.values():
            fixed = _positive_first(parts, self._tape)
            if fixed.step.operation == "neg":
                fixed, moving = -fixed, -moving
            groups.setdefault(fixed.index, (fixed, []))[1].append(moving)
        terms = [fixed * _positive_first(parts, self._tape) for fixed, parts in groups.values()]
        return _positive_first([total(plain, self._tape), *terms], self._tape)


def _positive_first(nodes: list[Node], tape: Tape) -> Node:
    """The sum of nodes, negated ones last, so that they are subtracted from the others."""
    ordered = sorted(nodes, key=lambda node: node.step.operation == "neg")
    return total(ordered, tape)
