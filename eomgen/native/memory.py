"""Memory that C writes to."""

import ctypes
from functools import lru_cache
from math import prod
from typing import Any, NamedTuple, TypeVar

import numpy as np

from eomgen.subset.structures import address, extent, parts_of, structure

T = TypeVar("T")
KINDS = (np.float64, np.int64)


class _Part(NamedTuple):
    """An array of a block: its name, the number of its kind, where it lies, and its shape."""

    name: str
    kind: int
    first: int
    last: int
    shape: tuple[int, ...]


@lru_cache(64)
def _layout(record: Any, given: tuple[tuple[str, int], ...]) -> tuple[list[_Part], list[int]]:
    """The arrays of a record but those given, and the sizes of the blocks that hold them; `given`
    are sizes, and -1 for an array.
    """
    of, parts, sizes = dict(given), list[_Part](), [0, 0]
    for name, (kind, lengths) in parts_of(record).arrays.items():
        if name in of:
            continue
        k, shape = KINDS.index(kind), tuple(extent(length, of) for length in lengths)
        last = sizes[k] + prod(shape)
        parts.append(_Part(name, k, sizes[k], last, shape))
        sizes[k] = last
    return parts, sizes


def room(record: type[T], **given: Any) -> tuple[T, ctypes.Structure]:
    """A record, and what C is given of it: as `subset.structures.with_room` and `filled` make them,
    but its arrays lie in one block for each kind of number, and are not set to anything.
    """
    known = tuple([(name, x if x.__class__ is int else -1) for name, x in given.items()])
    kind: Any = record
    parts, sizes = _layout(kind, known)
    blocks = [np.empty(size, kind) for size, kind in zip(sizes, KINDS, strict=True)]
    starts = [address(block) if block.size else 0 for block in blocks]
    names = parts_of(kind).names
    made = {name: x for name, x in given.items() if name in names}
    of_c: Any = structure(kind)
    places = of_c()
    for name, x in made.items():
        is_array = x.__class__ is np.ndarray
        setattr(places, name, x if not is_array else address(x) if x.size else 0)
    for name, kind, first, last, shape in parts:
        made[name] = blocks[kind][first:last].reshape(shape)
        setattr(places, name, starts[kind] + 8 * first)
    return record(**made), places
