"""The result of a sweep."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eomgen.base.displays import Displayed
from eomgen.base.errors import RunError, nearest
from eomgen.base.frozen import Frozen
from eomgen.language.base import identifier
from eomgen.results.design import Design
from eomgen.results.labelled import need_package
from eomgen.run.problem import FloatArray

if TYPE_CHECKING:
    from xarray import Dataset

FINISHED, STOPPED, REFUSED = 0, 1, 2
"""How a member ended: at its end time, before it, or not at all."""
WORDS = ("finished", "stopped", "refused")
SHARES = (0.05, 0.5, 0.95)
"""Shares of the members below the quantiles that are given if no others are asked for."""
MOST_NUMBERS = 2**22
"""Greatest number of numbers of which statistics are computed at once."""


@dataclass(frozen=True, eq=False, repr=False)
class Ensemble(Frozen, Displayed):
    """The runs of n members. If they are kept in a folder, arrays are memory maps of its files:
    what is not used stays on disk.

    scene      the scene's name
    design     what is varied: names, values (n, k), axes of a grid
    states     names of the ny states
    final      (n, ny), the state at the end, or where a member stopped; nan if it was refused
    t          (n,), the time of that, s
    codes      (n,), how members ended; see `status`
    messages   (n,), why a member did not finish, what of its start was moved to meet
               constraints, or ""
    times      (m,), of the rows, s
    rows       (n, m, ny), states at these times, nan after a stop; None if only ends were kept
    outputs    functions of the module by name: (n, m, …) at these times, or (n, …) at the end
    units      units by name, as far as known
    """

    shown = ("scene", "design", "states", "ended", "t", "final", "times", "outputs")

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
    units: Mapping[str, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.final)

    @property
    def finished(self) -> NDArray[np.bool_]:
        """(n,), whether each member reached its end time."""
        return np.asarray(self.codes == FINISHED)

    @property
    def ended(self) -> dict[str, int]:
        """How many members finished, stopped or were refused."""
        return {word: int((self.codes == code).sum()) for code, word in enumerate(WORDS)}

    @property
    def status(self) -> list[str]:
        """Of each member: "finished", "stopped" or "refused"."""
        return [WORDS[code] for code in self.codes.tolist()]

    def of(self, name: str) -> FloatArray:
        """A state or an output at the end, or a varied value, of all members: (n, …).

        Raises `RunError` for an unknown name.
        """
        name = identifier(name)
        if name in self.states:
            return np.asarray(self.final[:, self.states.index(name)])
        if name in self.outputs:
            values = self.outputs[name]
            return values if self.rows is None else np.asarray(values[:, -1])
        if name in self.design.names:
            return np.asarray(self.design.values[:, self.design.names.index(name)])
        known = tuple(dict.fromkeys((*self.states, *self.outputs, *self.design.names)))
        listed = ", ".join(known)
        raise RunError(f"of: unknown name '{name}'{nearest(name, known)}; known: {listed}")

    def on_grid(self, name: str) -> FloatArray:
        """The same over the axes of a grid: (n1, n2, …). Raises `RunError` without a grid."""
        if not self.design.axes:
            raise RunError("on_grid: the members do not form a grid")
        values = self.of(name)
        return values.reshape(*map(len, self.design.axes), *values.shape[1:])

    def statistics(self, name: str, shares: Sequence[float] = SHARES) -> "Statistics":
        """Statistics over the members of a state or an output with one number, at each of `times`,
        or at the end if only ends were kept.

        Members without a value at a time do not count there. Only a part of the times is in memory
        at once. Raises `RunError` for an unknown name, or an output with several numbers.
        """
        name = identifier(name)
        self.of(name)
        if self.rows is None:
            ends = self.of(name).astype(float)
            ends[~self.finished] = np.nan
            column, times = ends[:, None], self.times[-1:]
        elif name in self.states:
            column, times = self.rows[:, :, self.states.index(name)], self.times
        else:
            column, times = self.outputs.get(name, self.of(name)[:, None, None]), self.times
        if column.ndim > 2:
            raise RunError(f"statistics: {name} is not a state or an output with one number")
        at_once = max(1, MOST_NUMBERS // len(self))
        parts = [
            _statistics(np.array(column[:, start : start + at_once], dtype=float), shares)
            for start in range(0, len(times), at_once)
        ]
        joined = np.concatenate(parts, axis=1)
        count, mean, deviation = joined[:3]
        return Statistics(name, times, count.astype(np.int64), mean, deviation, joined[3:])

    def quantiles(self, name: str, shares: Sequence[float] = SHARES) -> FloatArray:
        """Quantiles over the members, of a state or an output with one number at each of `times`:
        (len(shares), m).

        Members without a value at a time do not count there. Raises `RunError` for an unknown
        name, or if only ends were kept.
        """
        if self.rows is None:
            raise RunError("quantiles: only ends were kept; give samples = 101")
        return self.statistics(name, shares).quantiles

    def to_xarray(self) -> "Dataset":
        """The runs as an xarray.Dataset, each variable with its `units` where they are known.

        Varied names are dimensions if they form a grid; else `member` is the dimension, along which
        they are coordinates. With rows, `t` is a dimension, too; `end_time` and `status` say how
        each member ended. Of a state that is varied, what it becomes is called NAME_run. Raises
        `RunError` without xarray.
        """
        need_package("xarray", "Ensemble.to_xarray")
        import xarray

        design, units = self.design, self.units
        if design.axes:
            dims, lengths = tuple(design.names), tuple(map(len, design.axes))
            given: dict[str, Any] = {
                name: (name, np.asarray(axis), _attributes(units, name))
                for name, axis in zip(dims, design.axes, strict=True)
            }
        else:
            dims, lengths = ("member",), (len(self),)
            given = {
                name: ("member", column, _attributes(units, name))
                for name, column in zip(design.names, design.values.T, strict=True)
            }
        along = () if self.rows is None else ("t",)
        if along:
            given["t"] = ("t", self.times, {"units": "s"})

        def variable(name: str, values: FloatArray, over: tuple[str, ...]) -> Any:
            rest = tuple(f"{name}_{i}" for i in range(values.ndim - 1 - len(over)))
            shaped = values.reshape(*lengths, *values.shape[1:])
            return ((*dims, *over, *rest), shaped, _attributes(units, name))

        states = self.final if self.rows is None else self.rows
        variables = {
            # A state that is varied is a coordinate already: what it becomes has a name of its own.
            (f"{name}_run" if name in given else name): variable(name, states[..., i], along)
            for i, name in enumerate(self.states)
        }
        variables |= {name: variable(name, each, along) for name, each in self.outputs.items()}
        variables["end_time"] = variable("end_time", self.t, ())
        variables["status"] = (dims, np.array(self.status).reshape(lengths))
        return xarray.Dataset(variables, coords=given, attrs={"scene": self.scene})


class Statistics(NamedTuple):
    """Statistics of a quantity over the members of a sweep, in its unit.

    times      (m,), s
    members    (m,), how many have a value at each of them; nan stands for statistics of none
    mean       (m,)
    deviation  (m,), the standard deviation of the sample, nan for a single member
    quantiles  (k, m), one row for each share
    """

    name: str
    times: FloatArray
    members: NDArray[np.int64]
    mean: FloatArray
    deviation: FloatArray
    quantiles: FloatArray


def _statistics(values: FloatArray, shares: Sequence[float]) -> FloatArray:
    """Rows of counts, means, deviations and quantiles of the finite values in each column."""
    found = np.full((3 + len(shares), values.shape[1]), np.nan)
    for i, column in enumerate(values.T):
        there = column[np.isfinite(column)]
        found[0, i] = there.size
        if not there.size:
            continue
        # In a unit, a power of two, in which sums and squares of great values do not overflow.
        exponent = np.frexp(np.abs(there).max())[1]
        there = np.ldexp(there, -exponent)
        parts = [there.mean(), there.std(ddof=1) if there.size > 1 else np.nan]
        with np.errstate(over="ignore"):
            found[1:, i] = np.ldexp([*parts, *np.quantile(there, shares)], exponent)
    return found


def _attributes(units: Mapping[str, str], name: str) -> dict[str, str]:
    unit = "s" if name == "end_time" else units.get(name, "").partition(" | ")[0]
    return {"units": unit} if unit else {}
