"""Numbers of 60 digits, by MPFR, and arrays of them: the reference for doubles."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import gmpy2
import numpy as np
from gmpy2 import mpfr

from eomgen.run.problem import FloatArray
from eomgen.scalars.extended import MP

BITS = MP.prec
"""Bits of the significand: 60 digits."""
NOTHING = 1e-25
"""A sum of extended numbers below this fraction of its terms counts as a rounding error."""
Array = Any
"""An array of extended numbers."""


@contextmanager
def extended_digits() -> Iterator[None]:
    """A block in which extended numbers have `BITS` bits, and undefined values are nan."""
    with gmpy2.context(precision=BITS), np.errstate(all="ignore"):
        yield


def extended(values: Any) -> Array:
    """A double or an extended number, or an array of them, converted exactly to extended."""
    array = np.asarray(values, dtype=object)
    return np.asarray(_LONG(array), dtype=object) if array.size else array


_LONG = np.frompyfunc(mpfr, 1, 1)


def zeros(*shape: int) -> Array:
    """An array of zeros."""
    return np.full(shape, mpfr(0), dtype=object)


def eye() -> Array:
    """The identity matrix (3, 3)."""
    return extended(np.eye(3))


def roots(values: Iterable[Any]) -> Array:
    """The square root of each number, (n,)."""
    return extended([x ** mpfr(0.5) for x in values])


def of_unit_length(y: Array, quaternions: Iterable[Iterable[int]]) -> Array:
    """A state (n,) with its quaternions, given by their indices, normalised."""
    found = y.copy()
    for indices in map(list, quaternions):
        found[indices] = found[indices] / (found[indices] @ found[indices]) ** mpfr(0.5)
    return found


def along(rate: Array, slopes: Array) -> Array:
    """The time derivative Σ rate_i slopes_i of a quantity with derivatives `slopes` (nv, …)."""
    if not len(rate):
        return zeros(*slopes.shape[1:])
    return np.tensordot(rate, slopes, axes=(0, 0))


def solved(matrix: Array, right: Array) -> Array:
    """The x of matrix x = right, by elimination with pivoting; `right` is a vector or columns.

    Raises `ZeroDivisionError` if the matrix is singular.
    """
    a, b, n = matrix.copy(), right.copy(), len(matrix)
    for k in range(n):
        pivot = k + max(range(n - k), key=lambda i: abs(a[k + i, k]))
        if not a[pivot, k]:
            raise ZeroDivisionError("the mass matrix is singular")
        a[[k, pivot]], b[[k, pivot]] = a[[pivot, k]], b[[pivot, k]]
        for i in range(k + 1, n):
            if a[i, k]:
                factor = a[i, k] / a[k, k]
                a[i, k + 1 :] = a[i, k + 1 :] - factor * a[k, k + 1 :]
                b[i] = b[i] - factor * b[k]
    for k in reversed(range(n)):
        b[k] = (b[k] - a[k, k + 1 :] @ b[k + 1 :]) / a[k, k] if k + 1 < n else b[k] / a[k, k]
    return b


def doubles(values: Any) -> FloatArray:
    """Extended numbers rounded to doubles."""
    return np.asarray(values).astype(float)
