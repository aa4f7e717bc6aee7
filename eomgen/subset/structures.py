"""The engine's records as C's structures, for `ctypes`."""

import ctypes
from collections.abc import Callable, Iterator, Mapping
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


@cache
def structure(record: type) -> type[ctypes.Structure]:
    """The structure of a record: numbers, and the addresses of its arrays and records."""
    hints = get_type_hints(record, include_extras=True)
    given = [(f.name, TYPES.get(hints[f.name], ctypes.c_void_p)) for f in fields(record)]
    return type(record.__name__, (ctypes.Structure,), {"_fields_": given})


def with_room(record: type[T], **given: Any) -> T:
    """A record with these numbers, arrays and records; its other arrays are of zeros, in the sizes
    that it states, of which those that are not its fields are given, too. Its other records have
    room for n unknowns, as it states.
    """
    names, arrays = fields_of(record)  # type: ignore[arg-type]
    made = {name: x for name, x in given.items() if name in names}
    for name, sizes, kind in arrays:
        if name not in made:
            made[name] = np.zeros([size.of(given) for size in sizes], kind)
    for name, (of, size) in records_of(record).items():  # type: ignore[arg-type]
        if name not in made:
            made[name] = with_room(of, n=size.of(given))
    return record(**made)


def arrays_of(record: Any) -> Iterator[tuple[str, bool, list[str]]]:
    """The arrays of a record: their names, whether they hold whole numbers, and their sizes."""
    for name, (of, *sizes) in _annotated(record):
        if not is_dataclass(of):
            yield name, of == Whole, sizes


@cache
def records_of(record: Any) -> "dict[str, tuple[Any, Size]]":
    """The records in a record: their types, and for how many unknowns they have room."""
    found = _annotated(record)
    return {name: (of, Size.of_text(*sizes)) for name, (of, *sizes) in found if is_dataclass(of)}


def _annotated(record: Any) -> Iterator[tuple[str, tuple[Any, ...]]]:
    hints = get_type_hints(record, include_extras=True)
    for f in fields(record):
        if get_origin(hints[f.name]) is Annotated:
            yield f.name, get_args(hints[f.name])


class Size(NamedTuple):
    """A number, and names by whose values it is multiplied."""

    factor: int
    names: tuple[str, ...]

    @classmethod
    def of_text(cls, text: str) -> "Size":
        """That of a text such as "2 * rows"."""
        parts = text.split(" * ")
        numbers = (int(part) for part in parts if part.isdigit())
        return cls(prod(numbers), tuple(part for part in parts if not part.isdigit()))

    def of(self, given: Mapping[str, Any]) -> int:
        """Its value."""
        value = self.factor
        for name in self.names:
            value *= given[name]
        return value


@cache
def fields_of(record: Any) -> tuple[set[str], list[tuple[str, list[Size], Any]]]:
    """The names of a record's fields, and its arrays: their names, sizes and kinds."""
    arrays = [
        (name, list(map(Size.of_text, sizes)), np.int64 if is_whole else np.float64)
        for name, is_whole, sizes in arrays_of(record)
    ]
    return {f.name for f in fields(record)}, arrays


def address(array: NDArray[Any]) -> int:
    """Where the numbers of a contiguous array lie. NumPy's own answer takes microseconds."""
    numbers: Any = array  # which has no type that says that it is a buffer
    try:
        return ctypes.addressof(ctypes.c_char.from_buffer(numbers))
    except (TypeError, ValueError):  # it is read-only, or has none
        return array.ctypes.data


class _Parts(NamedTuple):
    """The fields of a record: what gives their values, which are arrays; the numbers, and whether
    they are flags; and the records.
    """

    values: Callable[[Any], tuple[Any, ...]]
    arrays: tuple[bool, ...]
    numbers: tuple[tuple[str, bool], ...]
    records: tuple[str, ...]


@cache
def _parts(record: Any) -> _Parts:
    names = [f.name for f in fields(record)]
    hints, arrays = get_type_hints(record), {name for name, _, _ in arrays_of(record)}
    numbers = ((name, hints[name] is bool) for name in names if hints[name] in TYPES)
    are_arrays = tuple(name in arrays for name in names)
    return _Parts(attrgetter(*names), are_arrays, tuple(numbers), tuple(records_of(record)))


def filled(record: Any) -> ctypes.Structure:
    """A structure with the numbers of a record and the addresses of its arrays, which must lie
    together and live as long, and of its records.
    """
    kind: Any = type(record)
    parts, of_c = _parts(kind), structure(kind)
    values = parts.values(record)
    own = {name: filled(getattr(record, name)) for name in parts.records}
    if own:
        of = zip((f.name for f in fields(kind)), values, strict=True)
        values = tuple(ctypes.addressof(own[name]) if name in own else x for name, x in of)
    both = zip(values, parts.arrays, strict=True)
    made: Any = of_c(*[(address(x) if x.size else 0) if is_array else x for x, is_array in both])
    made.kept = own
    return cast(ctypes.Structure, made)


def take(record: Any, made: ctypes.Structure) -> None:
    """Give a record the numbers of its structure; those in its arrays have changed in place."""
    kind: Any = type(record)
    parts = _parts(kind)
    for name, is_flag in parts.numbers:
        value = getattr(made, name)
        setattr(record, name, value != 0 if is_flag else value)
    for name in parts.records:
        take(getattr(record, name), made.kept[name])


def copied(record: T) -> T:
    """A record with copies of its arrays."""
    kind: Any = type(record)
    parts = _parts(kind)
    both = zip(parts.values(record), parts.arrays, strict=True)
    return cast(T, kind(*[x.copy() if is_array else x for x, is_array in both]))
