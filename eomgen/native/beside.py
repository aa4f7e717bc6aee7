"""Functions of a compiled module that take further numbers beside the state.

These are forward and inverse dynamics, implicit steps, impacts of contacts, and what holds these.
Arguments that are not plain floats and arrays of the expected lengths are left to the Python
module, and so are columns of states.
"""

import inspect
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from eomgen.run.problem import FloatArray
from eomgen.tables.outputs import DYNAMICS, OUTPUTS

BESIDE = (*DYNAMICS, "implicit_step", "impact", "held")
_FLOAT = np.dtype(float)


class Given(NamedTuple):
    """Time, state and the further numbers of a call."""

    t: float
    y: FloatArray
    extra: FloatArray


Reader = Callable[[Mapping[str, Any]], Given | None]
"""Reads the arguments of a call, by name; None for those that are left to the Python module."""


def function(
    python: Callable[..., Any], one: Callable[..., FloatArray | None], reader: Reader
) -> Callable[..., Any]:
    """The function with the arguments of `python`. `one` takes time, state, parameters, inputs and
    the further numbers, and returns None for what `python` must compute.
    """
    known = inspect.signature(python).parameters
    names, needed = tuple(known), {n for n, p in known.items() if p.default is p.empty}

    def compiled(*given: Any, **named: Any) -> Any:
        values = {**dict(zip(names, given, strict=False)), **named}
        if len(values) == len(given) + len(named) and needed <= values.keys() <= known.keys():
            read = reader(values)
            if read is not None:
                t, y, extra = read
                found = one(t, y, values.get("p"), values.get("u"), extra)
                if found is not None:
                    return found
        return python(*given, **named)

    compiled.__name__, compiled.__doc__ = python.__name__, python.__doc__
    return compiled


def reader_of(module: Any, name: str, shape: tuple[int, ...]) -> Reader:
    """The reader of a function of `BESIDE` that returns an array of this shape."""
    ny = len(module.STATES)
    if name == "impact":
        return _impact(ny, len(module.CONTACTS))
    if name == "held":
        return _held(ny, len(module.CONTACTS))
    if name == "implicit_step":
        return partial(_stepped, ny)
    spec = OUTPUTS[name]
    forces = shape[spec.of(module.DIMENSIONS)[0].index("nv")]
    nq, nv = len(module.POSITIONS), forces
    if getattr(module, "FOLLOWING", ()):  # a velocity for each constraint
        nv = forces - len(module.CONSTRAINTS)
    return _dynamics((nq, nv, ny - nq - nv), forces, spec.beside)


def _dynamics(sizes: tuple[int, int, int], forces: int, beside: str) -> Reader:
    """Coordinates, velocities and further states of these sizes, and `forces` forces or
    accelerations.
    """
    no_force, at_rest = np.zeros(forces), np.zeros(sizes[2])

    def read(values: Mapping[str, Any]) -> Given | None:
        q, v, t = values["q"], values["v"], values.get("t", 0.0)
        extra, x = values.get(beside), values.get("x")
        extra, x = no_force if extra is None else extra, at_rest if x is None else x
        if not (isinstance(t, float) and _are_plain(q, v, x, extra)):
            return None
        if (len(q), len(v), len(x)) != sizes or len(extra) != forces:
            return None
        return Given(t, np.concatenate((q, v, x)), extra)

    return read


def _impact(ny: int, nc: int) -> Reader:
    def read(values: Mapping[str, Any]) -> Given | None:
        t, y, contact, bounce = (
            values["t"],
            values["y"],
            values["contact"],
            values.get("bounce", 1.0),
        )
        if not (isinstance(t, float) and isinstance(bounce, float) and _are_plain(y)):
            return None
        if len(y) != ny or contact.__class__ is not int or not 0 <= contact < nc:
            return None
        return Given(t, y, impact_numbers(nc, contact, bounce))

    return read


def impact_numbers(contacts: int, contact: int, bounce: float) -> FloatArray:
    """The further numbers of the kernel of impacts: which contact strikes, and its bounce."""
    numbers = np.zeros(contacts + 1)
    numbers[contact], numbers[-1] = 1.0, bounce
    return numbers


def _stepped(ny: int, values: Mapping[str, Any]) -> Given | None:
    t, y, h = values["t"], values["y"], values["h"]
    if not (isinstance(t, float) and isinstance(h, float) and _are_plain(y)) or len(y) != ny:
        return None
    return Given(t, y, np.array([h]))


def _held(ny: int, nc: int) -> Reader:
    def read(values: Mapping[str, Any]) -> Given | None:
        t, y, forces = values["t"], values["y"], values["forces"]
        if not (isinstance(t, float) and _are_plain(y, forces)) or (len(y), len(forces)) != (
            ny,
            nc,
        ):
            return None
        return Given(t, y, forces)

    return read


def _are_plain(*arrays: Any) -> bool:
    """Whether all are arrays (n,) of floats."""
    return all(a.__class__ is np.ndarray and a.dtype is _FLOAT and a.ndim == 1 for a in arrays)
