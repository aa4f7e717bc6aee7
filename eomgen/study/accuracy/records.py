"""A table of measured runs, from which an unfinished study continues.

The table is the CSV file that a user reads. It has no comment lines, as CSV readers would fail on
them; values that are the same for all runs have columns, too. One column holds a digest of what was
measured: the module, the parameters and inputs, the end time, the integrators, and the machine. If
the digest differs, the table is not used and the study starts anew.
"""

import csv
import hashlib
import io
import json
import platform
from collections.abc import Iterable, Mapping
from math import isnan, nan
from pathlib import Path
from types import MappingProxyType
from typing import Any, get_args

import numpy as np
import scipy

from eomgen.base.errors import RunError
from eomgen.base.files import is_ours, marked, read_plain, write_whole
from eomgen.study.accuracy.ladder import Status, Work, order
from eomgen.study.accuracy.trial import Setting
from eomgen.tables.integrators import INTEGRATORS

STATUSES: tuple[Status, ...] = get_args(Status)
MEASURES = {
    "energy_drift": "energy_drift",
    "joint_gap_m": "joint_gap",
    "quaternion_defect": "quaternion_defect",
    "time_s": "seconds",
    "time_spread_s": "spread",
    "work_units": "units",
    "stopped_at_s": "stopped_at",
}
"""Columns with a number of `Work`, which may be nan: empty."""
COUNTS = ("repeats", "steps", "derivatives", "jacobians")
ERRORS = ("error", "final_error")
"""Columns with an error; beside it stands whether it is one, or a bound. Errors and drifts have no
unit: they are relative to the motion's own scale, or its energy."""
COLUMNS = (
    *("method", "kind", "order", "dt_s", "rtol", "atol", "status"),
    *("error", "error_is", "final_error", "final_error_is"),
    *("energy_drift", "joint_gap_m", "quaternion_defect", "time_s", "time_spread_s", "repeats"),
    *("work_units", "steps", "derivatives", "jacobians", "reason", "stopped_at_s"),
)
GENERATION, KEY = "generation_s", "eomgen_key"
"""Columns after these and those that the caller adds."""
LARGEST = 100_000_000
"""Bytes; a longer table is not one of ours."""
TIMES = ("time_s", "time_spread_s", "repeats")
"""Columns that depend on how fast the machine is."""
AT_MOST, MEASURED = "at most", "measured"


def key(*what: object) -> str:
    """A digest of what the runs depend on, including this machine and its libraries."""
    here = Path(__file__).parent
    digest = hashlib.sha256()
    package = here.parent.parent
    own = [here / f"{name}.py" for name in ("measure", "reference", "work_precision")]
    own.append(package / "tables" / "integrators.py")
    for path in [*sorted((package / "run").rglob("*.py")), *own]:
        digest.update(path.read_bytes())
    machine = (platform.node(), platform.machine(), platform.python_version())
    text = json.dumps([*what, *machine, np.__version__, scipy.__version__], sort_keys=True)
    digest.update(text.encode())
    return digest.hexdigest()[:16]


def save(
    path: Path,
    key: str,
    works: Iterable[Work],
    *,
    generation: float | None,
    same: Mapping[str, object] = MappingProxyType({}),
    force: bool = False,
) -> None:
    """Write the table: a header, and a row for each run. All rows hold the values of `same`, by
    column name, the time that generating the module took, s, and the key.

    Rows are sorted by method and from coarse to fine. Raises `RunError` if the file cannot be
    written.
    """
    buffer = io.StringIO()
    table = csv.DictWriter(buffer, [*COLUMNS, *same, GENERATION, KEY], lineterminator="\n")
    table.writeheader()
    rest = {**same, GENERATION: _cell(generation), KEY: key}
    table.writerows({**_row(work), **rest} for work in ordered(works))
    write_whole(path, marked(buffer.getvalue()), force=force)


def ordered(works: Iterable[Work]) -> list[Work]:
    """The runs sorted by method, each method's from coarse to fine."""
    rank = {method: k for k, method in enumerate(INTEGRATORS)}
    return sorted(
        works, key=lambda w: (rank[w.setting.integrator], -(w.setting.dt or w.setting.rtol or 0.0))
    )


def load(path: Path, key: str) -> tuple[Mapping[Setting, Work], float | None]:
    """The runs in the table and the generation time, s; empty and None if there is no table, if its
    key differs, or if it is damaged.
    """
    try:
        data = read_plain(path, LARGEST)
        rows = list(csv.DictReader(io.StringIO(data.decode("utf-8"))))
        if not (is_ours(data) and rows and all(row[KEY] == key for row in rows)):
            return {}, None
        generation = float(rows[0][GENERATION]) if rows[0][GENERATION] else None
        works = [_work(row) for row in rows]
    except (RunError, ValueError, KeyError, TypeError, csv.Error):
        return {}, None
    return {work.setting: work for work in works}, generation


def _row(work: Work) -> dict[str, object]:
    setting = work.setting
    row: dict[str, object] = {
        "method": setting.integrator,
        "kind": INTEGRATORS[setting.integrator].kind,
        "order": _cell(order(setting.integrator)),
        "dt_s": _cell(setting.dt),
        "rtol": _cell(setting.rtol),
        "atol": _cell(setting.atol),
        "status": work.status,
        "reason": " ".join(work.reason.split()),
    }
    for name, at_most in zip(ERRORS, work.at_most, strict=True):
        row[name] = _cell(getattr(work, name))
        row[f"{name}_is"] = row[name] and (AT_MOST if at_most else MEASURED)
    row |= {column: _cell(getattr(work, name)) for column, name in MEASURES.items()}
    return row | {name: getattr(work, name) for name in COUNTS}


def _cell(value: float | None) -> str:
    """The shortest text that reads back exactly; empty for None and nan."""
    return "" if value is None or isnan(value) else repr(value)


def _work(row: Mapping[str, str]) -> Work:
    """The run in a row. Raises `ValueError` or `KeyError` if the row is malformed."""
    if row["method"] not in INTEGRATORS or row["status"] not in STATUSES:
        raise ValueError("no such method or status")
    if None in row.values():
        raise ValueError("a row is incomplete")
    given = {"dt_s": "dt", "rtol": "rtol", "atol": "atol"}
    found: dict[str, Any] = {name: float(row[c]) if row[c] else nan for c, name in MEASURES.items()}
    found |= {name: float(row[name]) if row[name] else nan for name in ERRORS}
    return Work(
        Setting(row["method"], **{name: float(row[c]) for c, name in given.items() if row[c]}),
        next(status for status in STATUSES if status == row["status"]),
        at_most=(row["error_is"] == AT_MOST, row["final_error_is"] == AT_MOST),
        reason=row["reason"],
        **found,
        **{name: int(row[name]) for name in COUNTS},
    )
