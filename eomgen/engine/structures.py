"""The engine's records as C's structures, for `ctypes`."""

import ctypes
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from math import prod
from operator import attrgetter
from typing import Annotated, Any, NamedTuple, TypeVar, cast, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from eomgen.subset.words import Whole

T = TypeVar("T")
TYPES: dict[Any, Any] = {float: ctypes.c_double, int: ctypes.c_int64, bool: ctypes.c_int64}


class Parts(NamedTuple):
    """The fields of a record.

    names    of all, in order
    values   gives their values
    numbers  whether they are flags
    arrays   their kinds of numbers, and their sizes, as text
    records  their types, and for how many unknowns they have room, as text
    """

    names: tuple[str, ...]
    values: Callable[[Any], tuple[Any, ...]]
    numbers: Mapping[str, bool]
    arrays: Mapping[str, tuple[type, list[str]]]
    records: Mapping[str, tuple[Any, str]]


@cache
def parts_of(record: Any) -> Parts:
    """Those of a type of records."""
    hints = get_type_hints(record, include_extras=True)
    names = tuple(f.name for f in fields(record))
    annotated = (name for name in names if get_origin(hints[name]) is Annotated)
    sized = {name: get_args(hints[name]) for name in annotated}
    return Parts(
        names,
        attrgetter(*names),
        {name: hints[name] is bool for name in names if hints[name] in TYPES},
        {
            name: (np.int64 if of == Whole else np.float64, sizes)
            for name, (of, *sizes) in sized.items()
            if not is_dataclass(of)
        },
        {name: (of, size) for name, (of, size, *_) in sized.items() if is_dataclass(of)},
    )


@cache
def structure(record: type) -> type[ctypes.Structure]:
    """The structure of a record: numbers, and the addresses of its arrays and records."""
    hints = get_type_hints(record)
    given = [(name, TYPES.get(hints[name], ctypes.c_void_p)) for name in parts_of(record).names]
    return type(record.__name__, (ctypes.Structure,), {"_fields_": given})


def with_room(record: type[T], **given: Any) -> T:
    """A record with these numbers, arrays and records; its other arrays are of zeros, in the sizes
    that it states, of which those that are not its fields are given, too. Its other records have
    room for n unknowns, as it states.
    """
    parts = parts_of(record)  # type: ignore[arg-type]
    made = {name: x for name, x in given.items() if name in parts.names}
    for name, (kind, sizes) in parts.arrays.items():
        if name not in made:
            made[name] = np.zeros([extent(size, given) for size in sizes], kind)
    for name, (of, size) in parts.records.items():
        if name not in made:
            made[name] = with_room(of, n=extent(size, given))
    return record(**made)


def extent(text: str, given: Mapping[str, Any]) -> int:
    """The value of a size such as "n" or "2 * rows"."""
    found: int = given.get(text, 0)
    return found or prod(given[x] if x in given else int(x) for x in text.split(" * "))


def address(array: NDArray[Any]) -> int:
    """Where the numbers of a contiguous array lie. NumPy's own answer takes microseconds."""
    numbers: Any = array  # which has no type that says that it is a buffer
    try:
        return ctypes.addressof(ctypes.c_char.from_buffer(numbers))
    except (TypeError, ValueError):  # it is read-only, or has none
        return array.ctypes.data


def filled(record: Any) -> ctypes.Structure:
    """A structure with the numbers of a record and the addresses of its arrays, which must lie
    together and live as long, and of its records.
    """
    kind: Any = type(record)
    parts, given = parts_of(kind), []
    own = {name: filled(getattr(record, name)) for name in parts.records}
    for name, x in zip(parts.names, parts.values(record), strict=True):
        if name in parts.arrays:
            given.append(address(x) if x.size else 0)
        else:
            given.append(ctypes.addressof(own[name]) if name in own else x)
    made: Any = structure(kind)(*given)
    made.kept = own
    return cast(ctypes.Structure, made)


def take(record: Any, made: ctypes.Structure) -> None:
    """Give a record the numbers of its structure; those in its arrays have changed in place."""
    kind: Any = type(record)
    parts = parts_of(kind)
    for name, is_flag in parts.numbers.items():
        value = getattr(made, name)
        setattr(record, name, value != 0 if is_flag else value)
    for name in parts.records:
        take(getattr(record, name), made.kept[name])


def copied(record: T) -> T:
    """A record with copies of its arrays."""
    kind: Any = type(record)
    parts = parts_of(kind)
    both = zip(parts.names, parts.values(record), strict=True)
    return cast(T, kind(*[x.copy() if name in parts.arrays else x for name, x in both]))
