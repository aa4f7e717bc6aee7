"""Measurements as columns by name: of a file, a DataFrame or a mapping."""

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from eomgen.base.errors import RunError
from eomgen.base.files import read_plain
from eomgen.run.problem import FloatArray

LARGEST = 10**8
"""Size of the largest file that is read, bytes."""


class Frame(Protocol):
    """A table with columns by name, such as a DataFrame of pandas."""

    @property
    def columns(self) -> Any:
        """The names of its columns."""

    def __getitem__(self, name: Any, /) -> Any:
        """A column."""


Data = str | PathLike[str] | Frame | Mapping[str, Any]
"""An experiment: a path, a table with columns by name, or columns by name."""


@dataclass(frozen=True, eq=False)
class Log:
    """An experiment.

    place    what messages call it
    t        (n,), ascending, s
    columns  the others by name, (n,); nan where there is no sample
    """

    place: str
    t: FloatArray
    columns: Mapping[str, FloatArray]


def read_log(data: Data, place: str) -> Log:
    """The experiment of a path of comma-separated values, a DataFrame (or whatever has columns) or
    a mapping. Columns of texts have no sample.

    Raises `RunError`, which begins with `place`, without times that ascend, or if columns differ in
    length. It is the path of a file.
    """
    if isinstance(data, str | PathLike):
        place = str(data)
        columns = _of_file(Path(data), place)
    elif isinstance(data, Mapping):
        columns = {str(name): _numbers(values) for name, values in data.items()}
    elif hasattr(data, "columns"):
        columns = {str(name): _numbers(data[name]) for name in data.columns}
        index = getattr(data, "index", None)
        if "t" not in columns and getattr(index, "name", None) == "t":
            columns["t"] = _numbers(index)
    else:
        raise RunError(
            f"{place}: {type(data).__name__} is none; give a path, a DataFrame or a mapping with t"
        )
    return _checked(columns, place)


def _checked(given: dict[str, FloatArray | None], place: str) -> Log:
    t = given.pop("t", None)
    if t is None:
        raise RunError(f"{place}: has no column t of times in s; name one t")
    none = np.full(t.shape, np.nan)
    columns = {name: none if values is None else values for name, values in given.items()}
    for name, values in columns.items():
        if values.shape != t.shape:
            raise RunError(
                f"{place}: {name} has {len(values)} values and t has {len(t)}; give one for each "
                "time, nan where there is none"
            )
    if len(t) < 2 or not np.isfinite(t).all() or np.any(np.diff(t) <= 0):
        raise RunError(
            f"{place}: the times t must be two or more, finite, and ascend; sort them, and give "
            "each only once"
        )
    return Log(place, t, columns)


def _numbers(values: Any) -> FloatArray | None:
    """A column of numbers, with nan for infinite ones; None if it is none."""
    try:
        found = np.array(values, dtype=float)
    except (TypeError, ValueError):
        return None
    found[np.isinf(found)] = np.nan
    return found if found.ndim == 1 else None


def _of_file(path: Path, place: str) -> dict[str, FloatArray | None]:
    """The columns of a file whose first line has their names. Empty cells are missing samples."""
    try:
        text = read_plain(path, LARGEST, name=place).decode("utf-8-sig")
        rows = [row for row in csv.reader(text.splitlines()) if any(map(str.strip, row))]
    except (UnicodeDecodeError, csv.Error) as error:
        raise RunError(f"{place}: is not a table of text: {error}") from None
    names = [word.strip() for word in rows[0]] if rows else []
    for row in rows[1:]:
        if len(row) != len(names):
            raise RunError(
                f"{place}: a row has {len(row)} values and the first line {len(names)} names: "
                f"{','.join(row)[:40]}"
            )
    if twice := next((name for name in names if name and names.count(name) > 1), None):
        raise RunError(f"{place}: the column {twice} is given twice; name one otherwise")
    cells = zip(*rows[1:], strict=True) if len(rows) > 1 else [() for _ in names]
    return {name: _of_cells(column) for name, column in zip(names, cells, strict=True)}


def _of_cells(cells: tuple[str, ...]) -> FloatArray | None:
    try:
        return _numbers([float(cell) if cell.strip() else math.nan for cell in cells])
    except ValueError:
        return None
