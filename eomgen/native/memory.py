"""Memory that C writes to."""

import ctypes
from math import prod
from typing import Any, TypeVar

import numpy as np

from eomgen.subset.structures import address, fields_of, structure

T = TypeVar("T")


def room(record: type[T], **given: Any) -> tuple[T, ctypes.Structure]:
    """A record, and what C is given of it: as `subset.structures.with_room` and `filled` make them,
    but its arrays lie in one block for each kind of number, and are not set to anything.
    """
    names, arrays = fields_of(record)  # type: ignore[arg-type]
    made = {name: x for name, x in given.items() if name in names}
    places = {name: address(x) if x.size else 0 for name, x in made.items() if hasattr(x, "size")}
    for kind in (np.float64, np.int64):
        own = [
            (name, [size.of(given) for size in sizes])
            for name, sizes, of in arrays
            if of is kind and name not in made
        ]
        block, first = np.empty(sum(prod(shape) for _, shape in own), kind), 0
        start = address(block) if block.size else 0
        for name, shape in own:
            size = prod(shape)
            made[name] = block[first : first + size].reshape(shape)
            places[name] = start + 8 * first
            first += size
    whole = record(**made)
    of_c: Any = structure(record)  # type: ignore[arg-type]
    return whole, of_c(*(places.get(n, getattr(whole, n)) for n, _ in of_c._fields_))
