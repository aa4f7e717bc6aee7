"""What the text of the engine may call, as Python and NumPy run it.

The text is ordinary Python with few kinds of things:

- numbers: `float`, `int`, `bool`; records, which are dataclasses of numbers, of arrays, and of
  records, with their size n: `Annotated[Factors, "2 * rows"]`;
- arrays of floats, `Vector` and `Matrix`, and of whole numbers, `Whole`, with their sizes:
  `Annotated[Matrix, "n", "n"]`, where n is an argument, or a size that the printer is given;
- `Known`: what is a Python object when the text is printed, such as a tableau. Functions are
  printed once for each, and loops over `unrolled(...)` of it are written out;
- sums with factors that are known: `combined(row, k)`;
- assignments, `if`, `while`, `for … in range(…)`, `break`, `continue`, `return`, and calls of other
  functions of the text. A protocol names the functions that the engine is given.

Array statements are elementwise: `place = y + h * k[i]`, `a[i, p:] -= factor * a[p, p:]`. In Python
NumPy runs them, in C and JavaScript they are loops; each entry has the same operations in the same
order, and so the same bits. `place = …` makes a new array, `place[:] = …` changes one. An array has
one name: `copy(x)`. Arrays are never resized; functions change those that they are given. An index
may be an array of whole numbers, which differ: `place[positions] += h * rates`. A record's array
may be assigned as a whole, `step.place = place`; then only one of the two is used, or none changed.
Entries may be given at once, `place[0:2] = [a, b]`.

Where few numbers are taken one by one, lists are several times as fast in Python as arrays:
`numbers` and `counts`, of which an entry is `a[i][j]`. Elsewhere they are arrays too, and
Python gives functions that take entries only either of them.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from math import exp, inf, isfinite, log, nan, sqrt
from types import FunctionType
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Known", "Matrix", "Row", "Vector", "Whole", "added", "all_within", "combined", "copy",
    "counts", "exp", "in_loops", "inf", "isfinite", "larger", "log", "nan", "next_after",
    "numbers", "ordered", "product", "rows", "sqrt", "transposed", "uniform", "unrolled",
    "with_arrays", "with_lists", "zeros",
]  # fmt: skip

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Whole = NDArray[np.int64]
Known = Any
T = TypeVar("T")
F = TypeVar("F", bound=Callable[..., Any])


_LOOPS: dict[Callable[..., Any], Any] = {}
"""The functions of the text in the place of which others run."""
_sum, _sums = np.add.reduce, np.add.accumulate


class Row(tuple[tuple[int, float], ...]):
    """Some factors, each with its number, ascending: those of a sum."""

    @cached_property
    def column(self) -> Matrix:
        """All factors up to the last one, with 0 where there is none, (n, 1)."""
        factors = dict(self)
        return np.array([[factors.get(j, 0.0)] for j in range(max(factors) + 1)])


def zeros(*sizes: int) -> Vector:
    """An array of zeros, of these sizes."""
    return np.zeros(sizes)


def numbers(*sizes: int) -> Any:
    """A list of zeros, or one of such rows."""
    n, *rest = sizes
    return [numbers(*rest) for _ in range(n)] if rest else [0.0] * n


def counts(n: int) -> Any:
    """A list of n whole numbers, which are 0."""
    return [0] * n


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


def combined(row: Row, k: Any) -> Vector:
    """The sum of vectors k[j] times the factors of a row, in order, from 0 on. An object in place
    of an array may have it ready.
    """
    if own := getattr(k, "combined", None):
        return cast(Vector, own(row))
    column = row.column
    products: Matrix = column * k[: len(column)]
    # NumPy would add a single column pairwise.
    is_one = products.shape[1] == 1
    total: Vector = 0.0 + _sums(products)[-1] if is_one else _sum(products, initial=0.0)
    return total


def ordered(x: Vector) -> float:
    """The sum of the entries of a vector, in order, from 0 on."""
    return 0.0 + _sums(x).item(-1) if len(x) else 0.0


def all_within(x: Vector, limits: Vector) -> bool:
    """Whether each entry of x is at most that of the limits; one that is nan is not."""
    return bool((x <= limits).all())


def product(a: Matrix, x: Vector) -> Vector:
    """The matrix by the vector, each row's sum in order, from 0 on; or by columns."""
    n = len(x)
    factors = a[:, :, None] if x.ndim == 2 else a
    return 0.0 + np.add.accumulate(factors * x, axis=1)[:, -1] if n else np.zeros(len(a))


def larger(a: Vector, b: Vector | float) -> Vector:
    """The larger one of each two entries."""
    return np.maximum(a, b)


def transposed(x: Matrix) -> Matrix:
    """A matrix with rows as columns; it is read, not kept."""
    return x.T


def next_after(t: float) -> float:
    """The next number above t."""
    return math.nextafter(t, inf)


def uniform(seed: float, stream: float, number: float, attempt: float) -> float:
    """A number from 0 to 1 without 1, of 53 random bits that follow from four whole numbers below
    2^53: S. Vigna's splitmix64, whose state takes one of them before each of four steps.
    """
    state = 0
    for given in (seed, stream, number, attempt):
        state = ((state ^ int(given)) + 0x9E3779B97F4A7C15) % 2**64
        state = ((state ^ (state >> 30)) * 0xBF58476D1CE4E5B9) % 2**64
        state = ((state ^ (state >> 27)) * 0x94D049BB133111EB) % 2**64
        state ^= state >> 31
    return float((state >> 11) * 2.0**-53)


def unrolled(values: Sequence[T]) -> Sequence[T]:
    """Values that are known when the text is printed: the loop over them is written out."""
    return values


def with_arrays(other: F) -> Callable[[F], F]:
    """Decorates a function in the place of which Python runs another one, which has the same bits
    and is quicker there because it has no loops.
    """

    def decorated(function: F) -> F:
        _LOOPS[other] = function
        return other

    return decorated


def in_loops(function: F) -> F:
    """A function that is run as it stands, with all that it calls of its module: for few numbers in
    lists that is quicker.
    """
    text: Any = _LOOPS.get(function, function)
    own = dict(text.__globals__)
    for name, x in text.__globals__.items():
        if callable(x) and (loops := _LOOPS.get(x)):
            own[name] = FunctionType(loops.__code__, own)
    return cast(F, own[text.__name__])


def with_lists(method: str) -> Callable[[F], F]:
    """Decorates a function in the place of which Python runs a method of its first argument, if
    that has one: with the same bits, and quicker for few numbers, because these are in lists.
    """

    def decorated(function: F) -> F:
        def called(first: Any, *others: Any) -> Any:
            own = getattr(first, method, None)
            return own(*others) if own else function(first, *others)

        _LOOPS[called] = function
        return cast(F, called)

    return decorated
