"""The equations of an exposition in numbers, in order, from given values."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import sympy as sp

from eomgen.derivation.spatial import ForceCross, MotionCross
from eomgen.derivation.steps import Definition, Equation
from eomgen.derivation.symbols import Expr
from eomgen.scalars.functions import BY_MATH

Numbers = dict[str, Any]
"""Floats of symbols and arrays of matrix symbols, by name."""


def define(definitions: Iterable[Definition], known: Numbers) -> None:
    """Add the values of definitions to what is known."""
    for symbol, value in definitions:
        known[symbol.name] = number(value, known)


def follow(equations: Iterable[Equation], known: Numbers) -> None:
    """Add the values of the left sides of matrix equations to what is known."""
    for equation in equations:
        value = array(equation.right, known)
        if isinstance(equation.left, sp.MatrixBase):  # the components of a vector
            known.update(zip((x.name for x in equation.left), value.ravel(), strict=True))
            continue
        known[equation.left.name] = value
        letter, _, rest = equation.left.name.partition("_")
        if letter in ("r", "c") and value.shape == (3, 1):
            (x,), (y,), (z,) = value
            known[f"{letter}^×_{rest}"] = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def number(e: Expr, known: Numbers) -> float:
    """The value of a scalar expression."""
    if e.is_Symbol:
        value = known[e.name]
        return float(value[0, 0]) if isinstance(value, np.ndarray) else value
    if e.is_Number or e.is_NumberSymbol:
        return float(e)
    if e.is_Add:
        return math.fsum(number(x, known) for x in e.args)
    if e.is_Mul:
        return math.prod(number(x, known) for x in e.args)
    if e.is_Pow:
        base, power = (number(x, known) for x in e.args)
        return float(base**power)
    if isinstance(e, sp.Piecewise):
        for value, condition in e.args:
            if condition == True or _holds(condition, known):  # noqa: E712 - SymPy's own truth
                return number(value, known)
    name = {"Abs": "abs"}.get(e.func.__name__, e.func.__name__)
    return BY_MATH[name](*(number(x, known) for x in e.args))


def _holds(condition: Expr, known: Numbers) -> bool:
    left, right = (number(x, known) for x in condition.args)
    return left < right if isinstance(condition, sp.StrictLessThan) else left > right


def array(e: Expr, known: Numbers) -> Any:
    """The value of a matrix expression."""
    if isinstance(e, sp.MatrixSymbol):
        return np.atleast_2d(known[e.name])
    if isinstance(e, sp.Identity):
        return np.eye(e.rows)
    if isinstance(e, sp.ZeroMatrix):
        return np.zeros(e.shape)
    if isinstance(e, sp.MatrixBase):
        return np.array([[number(x, known) for x in row] for row in e.tolist()])
    if isinstance(e, sp.BlockMatrix):
        blocks = e.blocks
        return np.block([[array(blocks[i, j], known) for j in range(blocks.cols)]
                         for i in range(blocks.rows)])  # fmt: skip
    if isinstance(e, MotionCross | ForceCross):
        v, m = (array(x, known) for x in e.args)
        dual = isinstance(e, ForceCross)
        return np.column_stack([crossed(v.ravel(), column, dual=dual) for column in m.T])
    if e.is_MatAdd:
        return sum(array(x, known) for x in e.args)
    if e.is_MatMul:
        result: Any = 1.0
        for x in e.args:
            part = array(x, known) if x.is_Matrix else number(x, known)
            result = result @ part if np.ndim(result) and np.ndim(part) else result * part
        return result
    if isinstance(e, sp.Transpose):
        return array(e.arg, known).T
    if isinstance(e, sp.Inverse):
        return np.linalg.inv(array(e.arg, known))
    return np.array([[number(e, known)]])


def crossed(v: Any, m: Any, *, dual: bool) -> Any:
    """v × m, or v ×* f, of spatial or planar vectors."""
    if len(v) == 3:
        w, x, y = v
        if dual:
            return np.array([x * m[2] - y * m[1], -w * m[2], w * m[1]])
        return np.array([0.0, y * m[0] - w * m[2], w * m[1] - x * m[0]])
    w, u, a, b = v[:3], v[3:], m[:3], m[3:]
    if dual:
        return np.concatenate([np.cross(w, a) + np.cross(u, b), np.cross(w, b)])
    return np.concatenate([np.cross(w, a), np.cross(w, b) + np.cross(u, a)])
