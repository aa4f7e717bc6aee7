"""The result of a sweep."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eomgen.errors import RunError, nearest
from eomgen.run.problem import FloatArray
from eomgen.sweep.design import Design
from eomgen.sweep.members import FINISHED, WORDS


@dataclass(frozen=True, eq=False)
class Ensemble:
    """The runs of n members. If they are kept in a folder, arrays are memory maps of its files:
    what is not used stays on disk.

    scene      the scene's name
    design     what is varied: names, values (n, k), axes of a grid
    states     names of the ny states
    final      (n, ny), the state at the end, or where a member stopped; nan if it was refused
    t          (n,), the time of that, s
    codes      (n,), how members ended; see `status`
    messages   (n,), why a member did not finish, or ""
    times      (m,), of the rows, s
    rows       (n, m, ny), states at these times, nan after a stop; None if only ends were kept
    outputs    functions of the module by name: (n, m, …) at these times, or (n, …) at the end
    """

    scene: str
    design: Design
    states: tuple[str, ...]
    final: FloatArray
    t: FloatArray
    codes: NDArray[np.int8]
    messages: NDArray[Any]
    times: FloatArray
    rows: FloatArray | None
    outputs: Mapping[str, FloatArray]

    def __len__(self) -> int:
        return len(self.final)

    @property
    def finished(self) -> NDArray[np.bool_]:
        """(n,), whether each member reached its end time."""
        return np.asarray(self.codes == FINISHED)

    @property
    def status(self) -> list[str]:
        """Of each member: "finished", "stopped" or "refused"."""
        return [WORDS[code] for code in self.codes.tolist()]

    def of(self, name: str) -> FloatArray:
        """A state or an output at the end, or a varied value, of all members: (n, …).

        Raises `RunError` for an unknown name.
        """
        if name in self.states:
            return np.asarray(self.final[:, self.states.index(name)])
        if name in self.outputs:
            values = self.outputs[name]
            return values if self.rows is None else np.asarray(values[:, -1])
        if name in self.design.names:
            return np.asarray(self.design.values[:, self.design.names.index(name)])
        known = (*self.states, *self.outputs, *self.design.names)
        listed = ", ".join(known)
        raise RunError(f"of: unknown name '{name}'{nearest(name, known)}; known: {listed}")

    def on_grid(self, name: str) -> FloatArray:
        """The same over the axes of a grid: (n1, n2, …). Raises `RunError` without a grid."""
        if not self.design.axes:
            raise RunError("on_grid: the members are no grid")
        values = self.of(name)
        return values.reshape(*map(len, self.design.axes), *values.shape[1:])

    def quantiles(self, name: str, shares: tuple[float, ...] = (0.05, 0.5, 0.95)) -> FloatArray:
        """Quantiles over the members, of a state at each of `times`: (len(shares), m).

        Members without a value at a time do not count there. Raises `RunError` for an unknown
        state, or if only ends were kept.
        """
        if self.rows is None:
            raise RunError("quantiles: only ends were kept; give samples = 101")
        if name not in self.states:
            raise RunError(f"quantiles: unknown state '{name}'{nearest(name, self.states)}")
        column = self.rows[:, :, self.states.index(name)]
        found = np.full((len(shares), len(self.times)), np.nan)
        for i in range(len(self.times)):
            there = column[np.isfinite(column[:, i]), i]
            if there.size:
                found[:, i] = np.quantile(there, shares)
        return found
