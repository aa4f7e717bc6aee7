"""How wide formulas are, and how those that are too wide come apart."""

from collections.abc import Iterator
from typing import Any

import sympy as sp

from eomgen.derivation.steps import Equation
from eomgen.show.notation import parsed


def entries(equation: Equation) -> Iterator[Equation]:
    """A matrix equation as one equation for each entry, of a matrix for those that are not 0; of a
    symmetric mass matrix without those below the diagonal.
    """
    left, matrix = equation.left, equation.right
    mass = (
        getattr(left, "name", "").startswith("M")
        and matrix.rows > 1
        and matrix.is_symmetric(simplify=False)
    )
    for i in range(matrix.rows):
        for j in range(matrix.cols):
            vanishes = matrix.cols > 1 and matrix.rows > 1 and matrix[i, j] == 0
            if vanishes or (mass and j < i):
                continue
            if isinstance(left, sp.MatrixBase):
                yield Equation(left[i, j], matrix[i, j])
                continue
            index = [n + 1 for n, size in ((i, matrix.rows), (j, matrix.cols)) if size > 1]
            joint = "," if "_" in left.name else "_"
            symbol = sp.Symbol(f"{left.name}{joint}{','.join(map(str, index))}")
            yield Equation(symbol, matrix[i, j])


def row_lines(matrix: Any, line: float) -> list[list[Any]] | None:
    """The entries of a row that is wider than a line, in lines; None for any other matrix."""
    if not isinstance(matrix, sp.MatrixBase) or matrix.rows > 1 or size_of(matrix) <= line:
        return None
    found: list[list[Any]] = [[]]
    length = 6.0
    for e in matrix:
        if length + size_of(e) + 2 > line:
            found.append([])
            length = 6.0
        found[-1].append(e)
        length += size_of(e) + 2
    return found


def in_parts(term: Any, most: float) -> Iterator[Any]:
    """A term; one wider than `most` as the products of its widest sum's terms with the rest."""
    sums = [x for x in sp.Mul.make_args(term) if isinstance(x, sp.Add)]
    if not sums or size_of(term) <= most:
        yield term
        return
    widest = max(sums, key=size_of)
    rest = [x for x in sp.Mul.make_args(term) if x is not widest]
    for part in widest.args:
        yield from in_parts(sp.Mul(*rest, part), most)


def is_wide(matrix: Any, line: float) -> bool:
    """Whether a matrix is wider than a line."""
    if not isinstance(matrix, sp.MatrixBase):
        return False
    return size_of(matrix) > line


def size_of(e: Any) -> float:
    """About how wide an expression is, in halves of the letter M; a fraction is as wide as its
    wider part.
    """
    if isinstance(e, sp.MatrixBase):
        columns = range(e.cols)
        return 2 + sum(
            2 + max((size_of(e[i, j]) for i in range(e.rows)), default=0.0) for j in columns
        )
    if isinstance(e, sp.BlockMatrix):
        return size_of(e.blocks)
    if e.is_Symbol or isinstance(e, sp.MatrixSymbol):
        parts = parsed(e.name)
        below = sum(map(len, parts.below)) + max(0, len(parts.below) - 1)
        return 1.1 * len(parts.letter) + 0.75 * below + (0.3 if below else 0)
    if e.is_Number:
        return float(len(str(e))) if e.is_Integer else 4.0
    if e.is_Mul:
        top, bottom = sp.fraction(e)
        if bottom != 1:
            return max(size_of(top), size_of(bottom)) + 1
        return sum(size_of(x) + (2.0 if isinstance(x, sp.Add) else 0.4) for x in e.args)
    if e.is_Pow and e.args[1].is_Number:
        return size_of(e.args[0]) + (2.5 if e.args[0].is_Add else 0.8)
    if e.is_Function:
        name = type(e).__name__
        return len(name) + 1.5 + sum(size_of(x) + 1 for x in e.args)
    if isinstance(e, sp.Piecewise):
        return 4 + max(size_of(value) + size_of(when) for value, when in e.args)
    return sum(size_of(x) + 2 for x in e.args) if e.args else 4.0
