"""Memory that C writes to."""

import ctypes
from collections.abc import Sequence
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

_BYTE = ctypes.c_char


def address(array: NDArray[Any]) -> int:
    """Where the numbers of a contiguous array lie. NumPy's own answer takes microseconds."""
    numbers: Any = array  # which has no type that says that it is a buffer
    try:
        return ctypes.addressof(_BYTE.from_buffer(numbers))
    except (TypeError, ValueError):  # it is read-only, or has none
        return array.ctypes.data


def placed(
    shapes: Sequence[tuple[int, ...]], kind: type = np.float64
) -> tuple[list[NDArray[Any]], list[int]]:
    """Arrays of these shapes, of numbers of 8 bytes, in one block, and their addresses."""
    sizes = [prod(shape) for shape in shapes]
    block: NDArray[Any] = np.empty(sum(sizes), kind)
    start, first = address(block), 0
    arrays, addresses = [], []
    for shape, size in zip(shapes, sizes, strict=True):
        arrays.append(block[first : first + size].reshape(shape))
        addresses.append(start + 8 * first)
        first += size
    return arrays, addresses
