"""What compiled steps call beside the derivative: each function lies in a library of its own."""

import ctypes
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from eomgen.native.module import outputs_of, usual_constants

_POINTER, _WHOLE = ctypes.c_void_p, ctypes.c_int64


class Function(NamedTuple):
    """A compiled function: its address, its constants, and the number of its results."""

    address: int
    constants: Any
    size: int


class FunctionStructure(ctypes.Structure):
    """`function` of `templates/c/projection.c.jinja`."""

    _fields_ = (("value", _POINTER), ("k", _POINTER), ("count", _WHOLE))


def functions(module: Any, libraries: Mapping[str, ctypes.CDLL], p: Any) -> dict[str, Function]:
    """The functions of these libraries, by name, at parameters `p`; without those whose kernels
    cannot compute with them.
    """
    found = {}
    for name, library in libraries.items():
        constants = usual_constants(module, name, p)
        if constants is not None:
            address = ctypes.cast(library[f"checked_{name}"], _POINTER).value
            assert address is not None
            found[name] = Function(
                address, ctypes.cast(constants, _POINTER), math.prod(outputs_of(library)[name])
            )
    return found
