"""The engine's records as C's structures, for `ctypes`."""

import ctypes
from collections.abc import Iterator
from dataclasses import fields
from functools import cache
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from eomgen.subset.words import Whole

T = TypeVar("T")
TYPES: dict[Any, Any] = {float: ctypes.c_double, int: ctypes.c_int64, bool: ctypes.c_int64}


@cache
def structure(record: type) -> type[ctypes.Structure]:
    """The structure of a record: numbers, and the addresses of its arrays."""
    hints = get_type_hints(record, include_extras=True)
    given = [
        (f.name, ctypes.c_void_p if _is_array(hints[f.name]) else TYPES[hints[f.name]])
        for f in fields(record)
    ]
    return type(record.__name__, (ctypes.Structure,), {"_fields_": given})


def _is_array(hint: Any) -> bool:
    return get_origin(hint) is Annotated and len(get_args(hint)) > 1


def with_room(record: type[T], **given: Any) -> T:
    """A record with these numbers and arrays; its other arrays are of zeros, in the sizes that it
    states, of which those that are not its fields are given, too.
    """
    names, arrays = fields_of(record)  # type: ignore[arg-type]
    made = {name: x for name, x in given.items() if name in names}
    for name, sizes, kind in arrays:
        if name not in made:
            made[name] = np.zeros([(given[n] if n else 1) * factor for n, factor in sizes], kind)
    return record(**made)


def arrays_of(record: Any) -> Iterator[tuple[str, bool, list[str]]]:
    """The arrays of a record: their names, whether they hold whole numbers, and their sizes."""
    hints = get_type_hints(record, include_extras=True)
    for f in fields(record):
        if _is_array(hints[f.name]):
            array, *sizes = get_args(hints[f.name])
            yield f.name, array == Whole, sizes


@cache
def fields_of(record: Any) -> tuple[set[str], list[tuple[str, list[tuple[str, int]], Any]]]:
    """The names of a record's fields, and its arrays: their names, sizes, each a name times a
    number, and kinds.
    """
    arrays = [
        (name, [_size(size) for size in sizes], np.int64 if is_whole else np.float64)
        for name, is_whole, sizes in arrays_of(record)
    ]
    return {f.name for f in fields(record)}, arrays


def _size(text: str) -> tuple[str, int]:
    factor, _, name = text.rpartition(" * ")
    return ("", int(name)) if name.isdigit() else (name, int(factor or 1))


def address(array: NDArray[Any]) -> int:
    """Where the numbers of a contiguous array lie. NumPy's own answer takes microseconds."""
    numbers: Any = array  # which has no type that says that it is a buffer
    try:
        return ctypes.addressof(ctypes.c_char.from_buffer(numbers))
    except (TypeError, ValueError):  # it is read-only, or has none
        return array.ctypes.data


def filled(record: Any) -> ctypes.Structure:
    """A structure with the numbers of a record and the addresses of its arrays, which must lie
    together and live as long.
    """
    kind: Any = type(record)
    made = structure(kind)
    values = (getattr(record, name) for name, *_ in made._fields_)
    return made(
        *((address(x) if x.size else 0) if isinstance(x, np.ndarray) else x for x in values)
    )


def take(record: Any, made: ctypes.Structure) -> None:
    """Give a record the numbers of its structure; those in its arrays have changed in place."""
    for f in fields(record):
        if not isinstance(value := getattr(record, f.name), np.ndarray):
            setattr(record, f.name, type(value)(getattr(made, f.name)))
