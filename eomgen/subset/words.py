"""What the text of the engine may call, as Python and NumPy run it.

The text is ordinary Python with few kinds of things:

- numbers: `float`, `int`, `bool`; records, which are dataclasses of numbers and arrays;
- arrays of floats, `Vector` and `Matrix`, and of whole numbers, `Whole`, with their sizes:
  `Annotated[Matrix, "n", "n"]`, where n is an argument, or a size that the printer is given;
- `Known`: what is a Python object when the text is printed, such as a tableau. Functions are
  printed once for each, and loops over `unrolled(...)` of it are written out;
- assignments, `if`, `while`, `for … in range(…)`, `break`, `continue`, `return`, and calls of other
  functions of the text. A protocol names the functions that the engine is given.

Array statements are elementwise: `place = y + h * k[i]`, `a[i, p:] -= factor * a[p, p:]`. In Python
NumPy runs them, in C and JavaScript they are loops; each entry has the same operations in the same
order, and so the same bits. `place = …` makes a new array, `place[:] = …` changes one. An array has
one name: `copy(x)`. Arrays are never resized; functions change those that they are given.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from math import inf, isfinite, nan, sqrt
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Known", "Matrix", "Vector", "Whole", "added", "copy", "inf", "isfinite", "larger", "matrix",
    "nan", "next_after", "ordered", "outer", "rows", "sqrt", "transposed", "unrolled", "whole",
    "with_arrays", "with_lists", "zeros",
]  # fmt: skip

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Whole = NDArray[np.int64]
Known = Any
T = TypeVar("T")
F = TypeVar("F", bound=Callable[..., Any])


def zeros(n: int) -> Vector:
    """A vector of n zeros."""
    return np.zeros(n)


def whole(n: int) -> Whole:
    """n whole numbers, which are 0."""
    return np.zeros(n, dtype=np.int64)


def matrix(rows: int, columns: int) -> Matrix:
    """A matrix of zeros."""
    return np.zeros((rows, columns))


def rows(many: int, n: int) -> Any:
    """Room for vectors of n numbers, each to be assigned as a whole."""
    return [np.zeros(0)] * many


def copy(x: Vector) -> Vector:
    """A copy of an array, or of a part of one."""
    return np.array(x)


def added(terms: Iterable[Any]) -> Any:
    """The sum of terms, in order."""
    rest = iter(terms)
    total = next(rest)
    for term in rest:
        total = total + term
    return total


def ordered(x: Vector) -> float:
    """The sum of the entries of a vector, in order, from 0 on."""
    return 0.0 + float(np.add.accumulate(x)[-1]) if len(x) else 0.0


def larger(a: Vector, b: Vector | float) -> Vector:
    """The larger one of each two entries."""
    return np.maximum(a, b)


def outer(x: Vector, y: Vector) -> Matrix:
    """All products, a row for each entry of x."""
    return np.multiply.outer(x, y)


def transposed(x: Matrix) -> Matrix:
    """A matrix with rows as columns; it is read, not kept."""
    return x.T


def next_after(t: float) -> float:
    """The next number above t."""
    return math.nextafter(t, inf)


def unrolled(values: Sequence[T]) -> Sequence[T]:
    """Values that are known when the text is printed: the loop over them is written out."""
    return values


def with_arrays(other: F) -> Callable[[F], F]:
    """Decorates a function in the place of which Python runs another one, which has the same bits
    and is quicker there because it has no loops.
    """
    return lambda _: other


def with_lists(method: str) -> Callable[[F], F]:
    """Decorates a function in the place of which Python runs a method of its first argument, if
    that has one: with the same bits, and quicker for few numbers, because these are in lists.
    """

    def decorated(function: F) -> F:
        def called(first: Any, *others: Any) -> Any:
            own = getattr(first, method, None)
            return own(*others) if own else function(first, *others)

        return cast(F, called)

    return decorated
