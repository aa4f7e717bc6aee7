"""Accelerations in 60 digits, at exactly the numbers of scene, state and parameters."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eomgen.derivation.recursive.dynamics import Dynamics
from eomgen.derivation.recursive.finite import values_at
from eomgen.derivation.states import velocity_states
from eomgen.model import Model
from eomgen.program.digits import MP, Digits, exact
from eomgen.program.from_recursion import Recording
from eomgen.program.program import Output, finish, interpret
from eomgen.program.tape import TIME, ExactTape
from eomgen.run.problem import Floats
from eomgen.study.longs import Array, LongScalars, long

Exact = NDArray[np.object_]
"""60-digit numbers."""


class Truth:
    """v̇ of a model of form 'velocity', its inputs at 0 and no contact held.

    It is computed by articulated bodies from a recording of its own, in which nothing was rounded
    nor rearranged; `factored` is the same by another way, LᵀDL factors, from no recording at all.
    """

    def __init__(self, model: Model) -> None:
        record = Recording(model, "aba", tape=ExactTape())
        self.model = model
        self._states = [state.name for state in velocity_states(model)]
        nodes = tuple(node.index for node in record.vd)
        self._program = finish(record.tape, {"vd": Output((len(nodes),), nodes)}, ())

    def __call__(self, t: Floats, y: Floats) -> Exact:
        """v̇ (nv, n) at times t (n,) and states y (n, ny); None all over where there is none."""
        try:
            return self._columns(t, y)
        except (ArithmeticError, ValueError, TypeError):
            columns = [self._one(t[k : k + 1], y[k : k + 1]) for k in range(len(y))]
            return np.concatenate(columns, axis=1)

    def _one(self, t: Floats, y: Floats) -> Exact:
        try:
            return self._columns(t, y)
        except (ArithmeticError, ValueError, TypeError):
            return np.full((len(self.model.velocities), 1), None, dtype=object)

    def _columns(self, t: Floats, y: Floats) -> Exact:
        """Raises `ArithmeticError`, `ValueError` or `TypeError` if there is none somewhere: what
        would be complex is no real number to compare.
        """
        inputs = dict(zip(self._states, exact(y.T), strict=True))
        inputs |= _numbers(self.model.defaults) | {TIME: exact(t)}
        inputs |= {i.name: MP.mpf(0) for i in self.model.inputs}
        found = interpret(self._program, "vd", inputs, Digits())
        columns = np.array([np.broadcast_to(np.asarray(x, object), t.shape) for x in found])
        if not all(isinstance(x, MP.mpf) and MP.isfinite(x) for x in columns.ravel()):
            raise ValueError("no finite real number")
        return columns

    def long(
        self, t: Any, y: Any, inputs: Mapping[str, Any], parameters: Mapping[str, Any]
    ) -> Array:
        """v̇ (nv,) at one state, of the same recording in long numbers (`longs`), which are as long
        and much faster; nan where there is none. To be called within `long_digits()`.
        """
        given = dict(zip(self._states, long(y), strict=True))
        values = {**self.model.defaults, **parameters}
        values |= {i.name: inputs.get(i.name, 0.0) for i in self.model.inputs} | {TIME: t}
        given |= dict(zip(values, long(list(values.values())), strict=True))
        return long(interpret(self._program, "vd", given, LongScalars()))

    def factored(self, t: float, y: Floats) -> Exact:
        """v̇ (nv,) at one state."""
        values = values_at(
            self.model,
            MP.mpf(t),
            list(exact(y)),
            _numbers(self.model.defaults),
            {i.name: MP.mpf(0) for i in self.model.inputs},
        )
        return np.array(Dynamics(self.model, values, Digits()).factored_forward(), dtype=object)


def _numbers(values: Mapping[str, float]) -> dict[str, Any]:
    return {name: MP.mpf(value) for name, value in values.items()}
