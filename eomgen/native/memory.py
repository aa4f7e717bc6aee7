"""Memory that C writes to."""

from collections.abc import Sequence
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eomgen.subset.structures import address as address


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
