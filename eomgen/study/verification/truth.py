"""Accelerations in 60 digits, for the exact values of the numbers in scene and state."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eomgen.codegen.recording import Recording
from eomgen.dynamics.dynamics import Dynamics
from eomgen.dynamics.start.diagnostics import values_at
from eomgen.model.model import Model
from eomgen.model.states import velocity_states
from eomgen.program.extended import evaluator
from eomgen.program.program import Output, finish, interpreter
from eomgen.program.tape import TIME, ExactTape
from eomgen.run.problem import FloatArray
from eomgen.scalars.extended import MP, Bits, Digits, exact
from eomgen.study.precision.extended import Array, extended

Exact = NDArray[np.object_]
"""An array of 60-digit numbers."""


class Truth:
    """v̇ of a model of form 'velocity', with inputs 0 and no contact forces.

    The articulated-body algorithm computes it from its own recording, in which nothing was
    rounded or rearranged. `factored` computes the same by LᵀDL factors, without a recording.
    """

    def __init__(self, model: Model) -> None:
        record = Recording(model, "aba", tape=ExactTape())
        self.model = model
        self._states = [state.name for state in velocity_states(model)]
        nodes = tuple(node.index for node in record.vd)
        program = finish(record.tape, {"vd": Output((len(nodes),), nodes)}, ())
        self._accelerations = evaluator(program, "vd")
        self._extended = interpreter(program, "vd", Bits())

    def __call__(self, t: FloatArray, y: FloatArray) -> Exact:
        """v̇ (nv, n) at times t (n,) and states y (n, ny); a column of None if it fails there."""
        return np.array(list(map(self._at, t.tolist(), y.tolist())), dtype=object).T

    def _at(self, t: float, y: list[float]) -> list[Any]:
        states = dict(zip(self._states, y, strict=True))
        inputs = {i.name: 0.0 for i in self.model.inputs}
        try:
            return self._accelerations({**states, **self.model.defaults, **inputs, TIME: t})
        except (ArithmeticError, ValueError):
            return [None] * len(self.model.velocities)

    def extended(
        self, t: Any, y: Any, inputs: Mapping[str, Any], parameters: Mapping[str, Any]
    ) -> Array:
        """v̇ (nv,) at one state, from the same recording, for extended-precision numbers; nan if it
        fails. To be called within `extended_digits()`.
        """
        given = dict(zip(self._states, extended(y), strict=True))
        values = {**self.model.defaults, **parameters}
        values |= {i.name: inputs.get(i.name, 0.0) for i in self.model.inputs} | {TIME: t}
        given |= dict(zip(values, extended(list(values.values())), strict=True))
        return extended(self._extended(given))

    def factored(self, t: float, y: FloatArray) -> Exact:
        """v̇ (nv,) at one state, by LᵀDL factors."""
        values = values_at(
            self.model,
            MP.mpf(t),
            list(exact(y)),
            {name: MP.mpf(value) for name, value in self.model.defaults.items()},
            {i.name: MP.mpf(0) for i in self.model.inputs},
        )
        return np.array(Dynamics(self.model, values, Digits()).forward("ldl")(None), dtype=object)
