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
import math
import platform
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
import scipy

from eomgen.base.errors import RunError
from eomgen.base.files import is_ours, marked, read_plain, write_whole
from eomgen.study.accuracy.ladder import Rung, Status, Work, order
from eomgen.tables.integrators import INTEGRATORS

STATUSES: tuple[Status, ...] = ("ok", "wrong", "failed", "over", "refused")
COLUMNS = (
    "method",
    "kind",
    "order",
    "dt_s",
    "rtol",
    "atol",
    "status",
    "error",
    "error_is",
    "final_error",
    "final_error_is",
    "energy_drift",
    "joint_gap_m",
    "quaternion_defect",
    "time_s",
    "time_spread_s",
    "repeats",
    "work_units",
    "steps",
    "derivatives",
    "jacobians",
    "reason",
    "stopped_at_s",
)
"""Errors and drifts have no unit: they are relative to the motion's own scale, or its energy."""
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
    table = csv.writer(buffer, lineterminator="\n")
    table.writerow([*COLUMNS, *same, GENERATION, KEY])
    rest = [*same.values(), _cell(generation), key]
    table.writerows([*_row(work), *rest] for work in ordered(works))
    write_whole(path, marked(buffer.getvalue()), force=force)


def ordered(works: Iterable[Work]) -> list[Work]:
    """The runs sorted by method, each method's from coarse to fine."""
    rank = {method: k for k, method in enumerate(INTEGRATORS)}
    return sorted(works, key=lambda w: (rank[w.rung.method], -(w.rung.dt or w.rung.rtol or 0.0)))


def load(path: Path, key: str) -> tuple[Mapping[Rung, Work], float | None]:
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
    return {work.rung: work for work in works}, generation


def _row(work: Work) -> list[object]:
    rung = work.rung
    at_most = [AT_MOST if flag else MEASURED for flag in work.at_most]
    return [
        rung.method,
        INTEGRATORS[rung.method].kind,
        _cell(order(rung.method)),
        _cell(rung.dt),
        _cell(rung.rtol),
        _cell(rung.atol),
        work.status,
        _cell(work.error),
        "" if math.isnan(work.error) else at_most[0],
        _cell(work.final_error),
        "" if math.isnan(work.final_error) else at_most[1],
        _cell(work.energy_drift),
        _cell(work.joint_gap),
        _cell(work.quaternion_defect),
        repr(work.seconds),
        _cell(work.spread),
        work.repeats,
        _cell(work.units),
        work.steps,
        work.derivatives,
        work.jacobians,
        " ".join(work.reason.split()),
        _cell(work.stopped_at),
    ]


def _cell(value: float | None) -> str:
    """The shortest text that reads back exactly; empty for None and nan."""
    return "" if value is None or math.isnan(value) else repr(value)


def _work(row: Mapping[str, str]) -> Work:
    """The run in a row. Raises `ValueError` or `KeyError` if the row is malformed."""

    def number(column: str) -> float:
        return float(row[column]) if row[column] else math.nan

    def optional(column: str) -> float | None:
        return float(row[column]) if row[column] else None

    if row["method"] not in INTEGRATORS or row["status"] not in STATUSES:
        raise ValueError("no such method or status")
    if None in row.values():
        raise ValueError("a row is incomplete")
    return Work(
        Rung(row["method"], optional("dt_s"), optional("rtol"), optional("atol")),
        next(status for status in STATUSES if status == row["status"]),
        float(row["time_s"]),
        int(row["repeats"]),
        error=number("error"),
        final_error=number("final_error"),
        at_most=(row["error_is"] == AT_MOST, row["final_error_is"] == AT_MOST),
        energy_drift=number("energy_drift"),
        joint_gap=number("joint_gap_m"),
        quaternion_defect=number("quaternion_defect"),
        steps=int(row["steps"]),
        derivatives=int(row["derivatives"]),
        jacobians=int(row["jacobians"]),
        reason=row["reason"],
        stopped_at=number("stopped_at_s"),
        spread=number("time_spread_s"),
        units=number("work_units"),
    )
