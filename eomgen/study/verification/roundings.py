"""How far rounding moves each component of what a module computes.

The module's program runs in random arithmetic: each result of an operation is moved by up to an
ulp, `RUNS` times (J. Vignes, "A stochastic arithmetic for reliable scientific computation",
Math. Comput. Simul. 35 (1993), 233). The spread of a component over these runs is what its own
operations make of rounding errors there. A component that is off by many times its spread is
wrong, however small it is beside others.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from eomgen.codegen.interface import Function, Interface
from eomgen.program.program import Program, interpreter
from eomgen.program.tape import TIME
from eomgen.run.problem import FloatArray
from eomgen.scalars.floats import BY_NUMPY
from eomgen.scalars.protocol import Scalars

RUNS = 32
"""Runs in random arithmetic; the spread is known to an eighth."""
ULP = 2.0**-52
"""The ulp of 1: results are moved by up to it, because less would be rounded away."""
SHORT = 2.0**20
"""A constant that is a whole multiple of its inverse counts as exact: 0.5, 2, 3."""
EXACT = frozenset({"abs", "min", "max", "step", "select", "sign"})
"""Functions that do not round."""
NOTHING = 1e-30
"""A smaller error is none, in any unit: 60 digits of what vanishes leave it."""
TABLE = 9973
"""Random errors that operations take in turn; a prime, so that no pattern of operations fits."""


class _Runs:
    """A number in each run."""

    __slots__ = ("arithmetic", "values")

    def __init__(self, values: FloatArray, arithmetic: "RandomArithmetic") -> None:
        self.values, self.arithmetic = values, arithmetic

    def __add__(self, other: "_Runs") -> "_Runs":
        return self.arithmetic.rounded(self.values + other.values)

    def __sub__(self, other: "_Runs") -> "_Runs":
        return self.arithmetic.rounded(self.values - other.values)

    def __mul__(self, other: "_Runs") -> "_Runs":
        return self.arithmetic.rounded(self.values * other.values)

    def __truediv__(self, other: "_Runs") -> "_Runs":
        return self.arithmetic.rounded(self.values / other.values)

    def __neg__(self) -> "_Runs":
        return _Runs(-self.values, self.arithmetic)


class RandomArithmetic(Scalars):
    """Scalars that are `RUNS` numbers, each rounded at random."""

    def __init__(self, seed: int = 0) -> None:
        rng = np.random.default_rng(seed)
        self._errors = rng.uniform(-ULP, ULP, (TABLE, RUNS))
        self._next = 0

    def rounded(self, values: FloatArray) -> _Runs:
        """The numbers, each moved by up to an ulp."""
        self._next = (self._next + 1) % TABLE
        return _Runs(values + values * self._errors[self._next], self)

    def exact(self, value: float) -> _Runs:
        """The same number in all runs."""
        return _Runs(np.full(RUNS, value), self)

    def number(self, value: Any) -> _Runs:
        """A constant, itself rounded unless it is short."""
        found = self.exact(float(value))
        return found if (value * SHORT) % 1.0 == 0.0 else self.rounded(found.values)

    def call(self, function: str, *arguments: _Runs) -> _Runs:
        """A function of formulas."""
        values = BY_NUMPY[function](*(x.values for x in arguments))
        return _Runs(values, self) if function in EXACT else self.rounded(values)


class Roundings:
    """The spreads of the outputs of programs, each with the interface of its module. An output is
    that of the first program that has it.
    """

    def __init__(self, programs: Sequence[tuple[Program, Interface]]) -> None:
        self._programs = programs
        self._arithmetic = RandomArithmetic()
        self._prepared = cache(self._evaluator)

    def runs(
        self, name: str, t: float, y: Mapping[str, float], u: Mapping[str, float], *extra: Any
    ) -> FloatArray:
        """An output in each run, (..., RUNS), at a state whose numbers are given by name, with the
        numbers that it takes beside; not finite where it fails.
        """
        function, interface, evaluate = self._prepared(name)
        number = self._arithmetic.exact
        # The length of a quaternion is 1 but for rounding, which formulas feel differently.
        loose = {i for indices in interface.quaternions for i in indices}
        given = {p.name: number(p.default) for p in interface.parameters}
        given |= {i.name: number(u.get(i.name, 0.0)) for i in interface.inputs}
        for i, state in enumerate(interface.states):
            exact = number(y[state.name])
            given[state.name] = self._arithmetic.rounded(exact.values) if i in loose else exact
        more = np.ravel(extra).tolist()
        given |= dict(zip(function.extra, map(number, more), strict=True)) | {TIME: number(t)}
        with np.errstate(all="ignore"):
            found = np.array([x.values for x in evaluate(given)])
        shape = function.shape[:1] if function.tangent else function.shape
        return found.reshape(*shape, RUNS)

    def tangent(self, name: str) -> bool:
        """Whether an output is the product of a matrix with a direction, which it takes beside."""
        return self._prepared(name)[0].tangent

    def _evaluator(
        self, name: str
    ) -> tuple[Function, Interface, Callable[[Mapping[str, Any]], list[Any]]]:
        for program, interface in self._programs:
            for function in interface.functions:
                if function.name == name:
                    return function, interface, interpreter(program, name, self._arithmetic)
        raise KeyError(name)


def spread(runs: FloatArray) -> FloatArray:
    """The standard deviation over the runs."""
    return np.asarray(np.std(runs, axis=-1))


def worst_share(error: FloatArray, allowed: FloatArray) -> tuple[float, int]:
    """The greatest ratio of an error to what rounding makes of its component, and its index. What
    is no error is none of its size; where no size is known, as at a division by 0, there is none.
    """
    error, allowed = np.broadcast_arrays(np.abs(np.ravel(error)), np.ravel(allowed) + NOTHING)
    if not error.size:
        return 0.0, 0
    with np.errstate(all="ignore"):
        shares = np.where(error == 0.0, 0.0, error / allowed)
    shares = np.where(np.isfinite(allowed), shares, 0.0)
    worst = int(np.argmax(np.where(np.isnan(shares), np.inf, shares)))
    return float(shares[worst]), worst
