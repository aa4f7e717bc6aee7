"""What all public functions do before they begin."""

import inspect
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

import numpy as np

from eomgen.base.errors import RunError

P = ParamSpec("P")
R = TypeVar("R")
NUMBERS = {float: "a number", float | None: "a number", int: "a whole number"}
NUMBERS |= {int | None: "a whole number"}
"""Types of arguments that are numbers, and what these are called."""


def public(function: Callable[P, R]) -> Callable[P, R]:
    """The function with arguments checked that are to be numbers, by their annotations.

    It raises `RunError` for a text or a list in place of a number. While it runs, NumPy's settings
    for floating-point errors are NumPy's own, whatever those of the caller are.
    """
    signature = inspect.signature(function)
    wanted = {
        name: NUMBERS[parameter.annotation]
        for name, parameter in signature.parameters.items()
        if parameter.annotation in NUMBERS
    }

    @wraps(function)
    def checked(*args: P.args, **named: P.kwargs) -> R:
        for name, value in signature.bind(*args, **named).arguments.items():
            if name in wanted and value is not None and not _is_number(value, wanted[name]):
                raise RunError(f"{name}: {value!r} is not {wanted[name]}; give one")
        with np.errstate(divide="warn", over="warn", under="ignore", invalid="warn"):
            return function(*args, **named)

    return checked


def _is_number(value: object, what: str) -> bool:
    kinds = "iu" if what == "a whole number" else "iuf"
    return np.ndim(value) == 0 and np.asarray(value).dtype.kind in kinds  # type: ignore[arg-type]
