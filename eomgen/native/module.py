"""A compiled module: the functions of a generated Python module, computed by C kernels.

A kernel reports whether the floating-point unit raised an overflow, a division by zero or an
invalid operation. If not, its result has the bits that the Python module would return; columns of
the derivative have those with the sines and cosines of `eomgen.run.sine`. In all other cases the
Python module computes the result or raises its error. It also checks parameters that are new.
"""

import ctypes
import math
from collections.abc import Callable, Iterable
from types import ModuleType
from typing import Any

import numpy as np

from eomgen.engine.structures import address
from eomgen.native.beside import BESIDE, function, reader_of
from eomgen.run.module import given_values
from eomgen.run.problem import FloatArray

MOST_KNOWN = 64
"""Largest number of parameter sets whose constants are kept."""
USUAL = 1e60
"""Kernels are used for parameters with sizes from 1 / USUAL to USUAL …"""
USUAL_CONSTANT = 1e100
"""… and constants from its inverse up to it, apart from weights of about 1e-200. Products of
these do not underflow by accident.
"""
EXACT = 2**53
"""Largest time that kernels take: a whole number up to it is a float; nan and inf are beyond."""
_FLOAT, _POINTER, _LONG, _REAL = np.dtype(float), ctypes.c_void_p, ctypes.c_long, ctypes.c_double


def compiled_module(module: Any, library: ctypes.CDLL) -> Any:
    """A module with the functions of `module`, computed by the library of its kernels.

    See `native.library.built`.
    """
    made = ModuleType(f"{module.NAME}_compiled", module.__doc__)
    made.__dict__.update({k: v for k, v in vars(module).items() if not k.startswith("__")})
    kernels = Kernels(module, library)
    for name, shape in outputs_of(library).items():
        if name in BESIDE:
            setattr(made, name, kernels.beside(name, shape))
        elif name != "initial_state":  # which the Python module has at hand
            setattr(made, name, kernels.output(name, shape))
    return made


def outputs_of(library: ctypes.CDLL) -> dict[str, tuple[int, ...]]:
    """The outputs of a library with their shapes."""
    text = ctypes.string_at(ctypes.addressof(ctypes.c_char.in_dll(library, "outputs"))).decode()
    lines = (line.split() for line in text.splitlines())
    return {name: tuple(map(int, shape)) for name, *shape in lines}


class Kernels:
    """The kernels of a library, and the constants of the parameter sets used so far."""

    def __init__(self, module: Any, library: ctypes.CDLL) -> None:
        self.module, self.library = module, library
        self.states, self.inputs, _, self.constants = (_LONG * 4).in_dll(library, "sizes")
        self.own = tuple(map(float, module.PARAMETERS.values()))
        self.none = np.array([*module.INPUTS.values()], dtype=np.float64)
        self.none.flags.writeable = False
        self._known: dict[bytes, Any] = {}

    def held(self, p: Any) -> Any:
        """The constants of parameters, a C array; None if the Python module must be used."""
        values = _ordered(self.own if p is None else p, self.module.PARAMETERS)
        if values is None or values.shape != (len(self.own),):
            return None
        key = values.tobytes()
        if key not in self._known:
            if len(self._known) >= MOST_KNOWN:
                self._known.clear()
            self._known[key] = self._made(values)
        return self._known[key]

    def _made(self, values: FloatArray) -> Any:
        self.module.initial_state(values)  # raises the error of parameters that are refused
        k = (_REAL * max(1, self.constants))()
        call = self.library.constants_of
        call.argtypes = [_POINTER, _POINTER]
        wrong = call(values.tobytes(), k)
        return k if are_usual(values.tolist(), k) and not wrong else None

    def given(self, u: Any, *columns: int) -> FloatArray | None:
        """Inputs as an array; None if the Python module must be used."""
        if u is None:
            return self.none
        values = _ordered(u, self.module.INPUTS)
        if values is None or values.shape not in ((self.inputs,), (self.inputs, *columns)):
            return None
        return values

    def output(self, name: str, shape: tuple[int, ...]) -> Callable[..., Any]:
        """The function of an output: (t, y, p=None, u=None), where y may have columns."""
        python, states = getattr(self.module, name), self.states
        own, none = self.held(None), self.none.tobytes()
        buffer = _REAL * math.prod(shape)
        one = self.library[f"checked_{name}"]
        one.argtypes = [_REAL, *[_POINTER] * 5]
        columns = self._columns(name, shape) if math.prod(shape) else python

        def function(t: float, y: Any, p: Any = None, u: Any = None) -> Any:
            usual = y.__class__ is np.ndarray and y.dtype is _FLOAT and y.shape[:1] == (states,)
            if usual and isinstance(t, (float, int)) and abs(t) <= EXACT:
                if y.ndim == 2 and y.shape[1]:
                    return columns(t, y, p, u)
                k = own if p is None else self.held(p)
                given = None if u is None else self.given(u)
                if y.ndim == 1 and k is not None and (u is None or given is not None):
                    out = buffer()
                    pushes = none if given is None else given.tobytes()
                    if one(t, y.tobytes(), k, pushes, None, out):
                        return (
                            np.frombuffer(memoryview(out)).reshape(shape)
                            if shape
                            else np.float64(out[0])
                        )
            return python(t, y, p, u)

        function.__name__, function.__doc__ = name, python.__doc__
        return function

    def beside(self, name: str, shape: tuple[int, ...]) -> Callable[..., Any]:
        """The function of an output that takes further numbers: see `eomgen.native.beside`."""
        python = getattr(self.module, name)
        call, buffer = self.library[f"checked_{name}"], _REAL * math.prod(shape)
        call.argtypes = [_REAL, *[_POINTER] * 5]

        def one(t: float, y: FloatArray, p: Any, u: Any, extra: FloatArray) -> FloatArray | None:
            k, given = self.held(p), self.given(u)
            if k is None or given is None or not abs(t) <= EXACT:
                return None
            out = buffer()
            if not call(t, y.tobytes(), k, given.tobytes(), extra.tobytes(), out):
                return None
            return np.frombuffer(memoryview(out)).reshape(shape)

        return function(python, one, reader_of(self.module, name, shape))

    def _columns(self, name: str, shape: tuple[int, ...]) -> Callable[..., FloatArray]:
        """The function of an output for columns of states."""
        python = getattr(self.module, name)
        many = self.library[f"columns_{name}"]
        many.argtypes = [_LONG, _REAL, *[_POINTER] * 3, ctypes.c_int, _POINTER]
        own, none = self.held(None), self.none.ctypes.data

        def columns(t: float, y: FloatArray, p: Any, u: Any) -> FloatArray:
            count = y.shape[1]
            k, given = own if p is None else self.held(p), self.given(u, count)
            if k is None or given is None:
                return np.asarray(python(t, y, p, u))
            y, given = np.ascontiguousarray(y), np.ascontiguousarray(given)
            pushes, each = none if u is None else address(given), given.ndim == 2
            result = np.empty((*shape, count))
            if not many(count, t, address(y), k, pushes, each, address(result)):
                left = np.flatnonzero(np.isnan(result.reshape(-1, count)[0]))
                u = given[:, left] if each else u
                result[..., left] = python(t, y[:, left], p, u)
            return result

        return columns


def usual_constants(module: Any, name: str, p: Any) -> Any:
    """The constants of one function of a module at parameters `p`, a C array; None if its kernel
    cannot compute with them.
    """
    constants = (module._DEFAULT if p is None else module._parameters(p))[name]
    values = {**module.PARAMETERS, **given_values(module, p)[0]}
    if not are_usual(values.values(), constants):
        return None
    return (_REAL * max(1, len(constants)))(*constants)


def are_usual(parameters: Iterable[float], constants: Iterable[float]) -> bool:
    """Whether kernels can compute with such numbers: products of these do not underflow."""
    sizes = [abs(x) for x in constants if x and not 1e-240 < abs(x) < 1e-160]
    usual = all(1 / USUAL < abs(x) < USUAL for x in parameters if x)
    return usual and all(1 / USUAL_CONSTANT < size < USUAL_CONSTANT for size in sizes)


def _ordered(values: Any, defaults: dict[str, float]) -> FloatArray | None:
    """Values by name or in order as an array of floats; None if they are anything else."""
    if hasattr(values, "keys"):
        if set(values) - set(defaults):
            return None
        values = [values.get(name, default) for name, default in defaults.items()]
    try:
        array = np.asarray(values)
    except ValueError:
        return None
    if array.dtype is not _FLOAT or np.ma.is_masked(values):
        return None
    return array
