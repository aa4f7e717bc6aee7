"""A program in float32, and the speed of a generated module in float32."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eomgen.codegen.system import System
from eomgen.program.program import interpret
from eomgen.program.tape import TIME
from eomgen.run.problem import FloatArray
from eomgen.scalars.floats import BY_NUMPY
from eomgen.scalars.functions import FUNCTIONS
from eomgen.scalars.protocol import Scalars

Singles = NDArray[np.float32]
LEAST: np.float32 = np.finfo(np.float32).smallest_normal
"""Replaces values that underflow, such as small weights that keep a divisor from being 0."""

_NUMPY = {**BY_NUMPY, "step": lambda x: np.heaviside(x, np.float32(0.0))}


class Single(Scalars):
    """Scalars of a program: float32 numbers or arrays."""

    def number(self, value: float) -> np.float32:
        """The float32 nearest to a double; the smallest normal one if that would underflow to 0."""
        nearest = np.float32(value)
        return LEAST * np.float32(math.copysign(1.0, value)) if value and not nearest else nearest

    def call(self, function: str, *arguments: Any) -> Any:
        """The value of a function of formulas."""
        return _NUMPY[function](*arguments)


def in_single(system: System, output: str, t: FloatArray, y: FloatArray) -> Singles:
    """An output of a system at times t (n,) and states y (n, ny), with inputs 0: in its own shape
    plus a last axis of n. Every input and every operation is rounded to float32.
    """
    model, columns = system.model, y.astype(np.float32).T
    given: dict[str, Any] = dict(zip((s.name for s in system.states), columns, strict=True))
    given |= {p.name: np.float32(p.default) for p in model.parameters}
    given |= {i.name: np.float32(0.0) for i in model.inputs} | {TIME: t.astype(np.float32)}
    with np.errstate(all="ignore"):
        values = interpret(system.program, output, given, Single())
    result = np.empty((len(values), len(y)), dtype=np.float32)
    for row, value in zip(result, values, strict=True):
        assert value.dtype == np.float32, f"{output} is beyond the range of float32"
        row[:] = value
    return result.reshape((*system.program.outputs[output].shape, len(y)))


def kernel_in_single(module: Any, output: str) -> Callable[[Singles], Singles]:
    """The generated function of an output for one state (ny,) or columns of states (ny, k) in
    float32, to be timed. Its constants are the module's own, rounded.
    """
    kernel = getattr(module, f"_{output}")
    taken = kernel.__code__.co_varnames[: kernel.__code__.co_argcount]
    functions = {name: _NUMPY[name] for name in FUNCTIONS if name in taken}
    constants = tuple(np.float32(k) for k in module._DEFAULT[output])
    inputs = (np.float32(0.0),) * len(module.INPUTS)
    time = {"t": np.float32(0.0)} if "t" in taken else {}

    def call(y: Singles) -> Singles:
        values = kernel(y if y.ndim == 2 else tuple(y), constants, inputs, **time, **functions)
        result = np.empty((len(values), *y.shape[1:]), dtype=np.float32)
        for i, value in enumerate(values):
            result[i] = value
        return result

    return call
