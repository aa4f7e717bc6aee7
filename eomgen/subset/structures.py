"""The engine's records as C's structures, for `ctypes`."""

import ctypes
from dataclasses import fields
from functools import cache
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import numpy as np

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


def filled(record: Any) -> ctypes.Structure:
    """A structure with the numbers of a record and the addresses of its arrays, which must lie
    together and live as long.
    """
    kind: Any = type(record)
    made = structure(kind)()
    for f in fields(record):
        value = getattr(record, f.name)
        setattr(made, f.name, value.ctypes.data if isinstance(value, np.ndarray) else value)
    return made


def take(record: Any, made: ctypes.Structure) -> None:
    """Give a record the numbers of its structure; those in its arrays have changed in place."""
    for f in fields(record):
        if not isinstance(value := getattr(record, f.name), np.ndarray):
            setattr(record, f.name, type(value)(getattr(made, f.name)))
