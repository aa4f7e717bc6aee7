"""Boxes that hold a motion, with a proof."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eomgen.base.displays import Displayed
from eomgen.base.errors import RunError
from eomgen.base.files import check_writable, write_whole
from eomgen.base.frozen import Frozen

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Enclosure(Frozen, Displayed):
    """Boxes that hold the states of a motion at the times of its rows, with a proof; see `certify`.

    A component lies within `radius` of `y` + `low`, where `low` is what does not fit into a double.

    name       of the scene
    states     names of the states, then of parameters that are uncertain
    t          times that were reached, (n,), s
    y          midpoints, to the nearest double, (n, ny), SI units
    low        exact midpoints less `y`, to the nearest double, (n, ny)
    radius     upper bounds of the distance from the midpoint, (n, ny)
    wanted     the greatest radius that was asked for
    finished   whether the end was reached, with this radius if the start is exact
    message    where and why the proof ends; "" if it is finished
    bits       of the balls
    order      of the series
    steps      number of steps
    error      upper bounds of the errors of a run, (n, ny), if one was certified
    least      lower bounds of these errors
    """

    shown = ("wanted", "finished", "message", "t", "largest", "bits", "order", "steps")

    name: str
    states: tuple[str, ...]
    t: FloatArray
    y: FloatArray
    low: FloatArray
    radius: FloatArray
    wanted: float
    finished: bool
    message: str
    bits: int
    order: int
    steps: int
    error: FloatArray | None = None
    least: FloatArray | None = None

    @property
    def largest(self) -> float:
        """The greatest radius."""
        return float(self.radius.max(initial=0.0))

    def document(self) -> Mapping[str, object]:
        """The content of a JSON file: numbers that do not fit into a double as two of them."""
        rows = {
            "t": self.t,
            "y": self.y,
            "low": self.low,
            "radius": self.radius,
            "error": self.error,
            "least": self.least,
        }
        return {
            "name": self.name,
            "states": list(self.states),
            "wanted": self.wanted,
            "finished": self.finished,
            "message": self.message,
            "bits": self.bits,
            "order": self.order,
            "steps": self.steps,
            **{name: each.tolist() for name, each in rows.items() if each is not None},
        }

    def save(self, path: str | PathLike[str], *, force: bool = False) -> None:
        """Write the rows as a table `.csv`, or all as `.json`.

        Raises `RunError` for another ending, or if a file exists that this program did not write,
        unless `force`.
        """
        target = Path(path)
        kind = target.suffix.lower()
        if kind not in (".csv", ".json"):
            raise RunError(f"{path}: an enclosure is saved as .csv or .json")
        check_writable(target, force=force)
        text = self._table() if kind == ".csv" else json.dumps(self.document())
        write_whole(target, text, force=force)

    def _table(self) -> str:
        """A line for each row: the time, then of each state midpoint, rest and radius."""
        parts = {"": self.y, ".low": self.low, ".radius": self.radius}
        if self.error is not None:
            parts[".error"] = self.error
        heads = ["t", *(f"{name}{end}" for name in self.states for end in parts)]
        lines = [",".join(heads)]
        for i, t in enumerate(self.t.tolist()):
            cells = (repr(float(x[i, j])) for j in range(len(self.states)) for x in parts.values())
            lines.append(",".join([repr(t), *cells]))
        return "\n".join(lines) + "\n"
