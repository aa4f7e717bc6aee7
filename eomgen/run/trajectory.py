"""The result of a run, and the files that hold it."""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, field
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from eomgen.base.displays import Displayed
from eomgen.base.errors import RunError
from eomgen.base.files import is_ours, read_plain, write_whole
from eomgen.base.frozen import Frozen
from eomgen.run.archive import Array, checked, packed, unpacked
from eomgen.run.origin import Origin
from eomgen.run.problem import FloatArray
from eomgen.run.rows import all_finite
from eomgen.run.setup import Setup

FORMAT, READ = "trajectory 5", ("trajectory 5", "trajectory 4")
"""The format that is written, and those that are read: the fourth holds no setup."""
LARGEST = 2**32
"""Size of the largest file that is read, bytes: a million samples of 500 states."""
RESUME = "resume_"
"""Prefix of the members of a file from which a later run continues."""
SAVED, COLUMNS = "saved_", "columns_"
"""Prefixes of the members of a file that hold outputs, and the names of their columns."""
SETUP = "setup_"
"""Prefix of the members of a file that hold the setup."""
COUNTS = ("steps", "derivatives", "jacobians", "impacts", "capped", "cut")
Kind = Literal["impact", "rest", "lift"]
Ending = Literal["finished", "interrupted", "ended", "stopped"]
ENDINGS: tuple[Ending, ...] = get_args(Ending)


@dataclass(frozen=True)
class Outcome:
    """How a run ended.

    kind    "finished": at its end time; "interrupted": by the user; "ended": by a function that
            follows it; "stopped": by an error
    reason  why it did not finish
    remedy  what to change; "" if that is not known
    dead    whether coordinates or velocities that were taken as independent are not there, so that
            others may carry on; not kept in files
    """

    kind: Ending = "finished"
    reason: str = ""
    remedy: str = ""
    dead: bool = False

    def __str__(self) -> str:
        return "; ".join(filter(None, (self.reason, self.remedy)))


@dataclass(frozen=True)
class Event:
    """An event of a contact at time `t`, s.

    kind   "impact": it struck; "rest": from here on it is held by its contact force; "lift": it is
           no longer held
    speed  the speed with which it closed, m/s or rad/s; 0 for a lift
    """

    t: float
    contact: str
    kind: Kind
    speed: float


@dataclass(frozen=True, eq=False)
class Saved:
    """An output along a run, (n, …), and the names of its columns in tables, row by row."""

    values: FloatArray
    columns: tuple[str, ...]


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(Frozen, Displayed):
    """The states of a mechanism at n times; arrays are read-only copies, in SI units.

    name, states  name and states of the problem
    t             (n,), n >= 1, in s, never decreasing
    y             (n, ny), a row of finite numbers for each time
    integrator    name of the method
    finished      whether it reached the end time
    message       why not, and what to change, or a remark; else ""
    counts        numbers of `steps`, `derivatives`, `jacobians` and `impacts`; of steps of the
                  greatest length allowed (`capped`); and of attempts repeated because they passed
                  over a branch of the derivative (`cut`)
    events        events of contacts, in order of time; the rows just before and just after an
                  impact have the same t
    works         (n, m), J: work of each effect since the start; None if not requested
    work_names    names of these m effects
    resume        arrays by name from which a later run continues exactly, see `integrate`; empty if
                  the method cannot
    origin        what the motion depends on; None if not known
    outcome       how it ended
    saved         further outputs at each row, by name
    setup         what other outputs can be computed from; None if not known
    violations    the largest residuals of each constraint's rows, m or rad, before and after
                  projection, by name; empty without constraints. They are not in files

    Raises `ValueError` if the values are inconsistent.
    """

    shown = ("integrator", "states", "t", "y", "finished", "message", "counts")

    name: str
    states: tuple[str, ...]
    t: FloatArray
    y: FloatArray
    integrator: str
    finished: bool
    message: str
    counts: Mapping[str, int]
    events: tuple[Event, ...] = ()
    works: FloatArray | None = None
    work_names: tuple[str, ...] = ()
    resume: Mapping[str, FloatArray] = field(default_factory=dict)
    origin: Origin | None = None
    outcome: Outcome = Outcome()
    saved: Mapping[str, Saved] = field(default_factory=dict)
    setup: Setup | None = None
    violations: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.finished and self.outcome.kind == "finished":
            object.__setattr__(self, "outcome", Outcome("stopped", self.message))
        if self.finished != (self.outcome.kind == "finished"):
            raise ValueError(f"trajectory: is finished, and its outcome is {self.outcome.kind}")
        t, y = np.array(self.t, dtype=np.float64), np.array(self.y, dtype=np.float64)
        if t.ndim != 1 or not t.size:
            raise ValueError(f"trajectory: t has shape {t.shape}, not (n,) with n >= 1")
        if y.shape != (t.size, len(self.states)):
            raise ValueError(f"trajectory: y has shape {y.shape}, not {(t.size, len(self.states))}")
        if not (all_finite(t) and all_finite(y)):
            raise ValueError("trajectory: t or y is not finite")
        if (t[1:] < t[:-1]).any():
            raise ValueError("trajectory: t decreases")
        if self.counts.keys() != set(COUNTS):
            raise ValueError(f"trajectory: counts are {sorted(self.counts)}, not {COUNTS}")
        if self.works is not None:
            works = np.array(self.works, dtype=np.float64)
            if works.shape != (t.size, len(self.work_names)):
                raise ValueError(
                    f"trajectory: works have shape {works.shape}, "
                    f"not {(t.size, len(self.work_names))}"
                )
            object.__setattr__(self, "works", works)
        object.__setattr__(self, "t", t)
        object.__setattr__(self, "y", y)
        object.__setattr__(self, "counts", {key: int(self.counts[key]) for key in COUNTS})
        super().__post_init__()

    @property
    def struck(self) -> NDArray[np.int64]:
        """For each row the number of impacts at its time before it, (n,): 0 but for the rows after
        an impact, which repeat the time of the row before it.
        """
        again = np.diff(self.t, prepend=-np.inf) == 0
        counts = np.cumsum(again)
        return np.asarray(counts - np.maximum.accumulate(np.where(again, 0, counts)), np.int64)

    @property
    def held(self) -> dict[str, float]:
        """The contacts held at the end, each with the time from which on it is held, s."""
        held: dict[str, float] = {}
        for event in self.events:
            if event.kind == "rest":
                held[event.contact] = event.t
            elif event.kind == "lift":
                held.pop(event.contact, None)
        return held


def save_npz(trajectory: Trajectory, path: Path, force: bool = False) -> None:
    """Write `trajectory` as NumPy's .npz, the same bytes for the same trajectory.

    Raises `RunError` if `path` cannot be written, or if it holds a file of other origin and `force`
    is not given.
    """
    events = trajectory.events
    # `eomgen` must come first: it marks the file as ours.
    members: dict[str, Array] = {
        "eomgen": np.array(FORMAT),
        "t": trajectory.t,
        "y": trajectory.y,
        "states": _names(trajectory.states),
        "name": np.array(trajectory.name),
        "integrator": np.array(trajectory.integrator),
        "finished": np.array(trajectory.finished),
        "message": np.array(trajectory.message),
        "outcome": _names(astuple(trajectory.outcome)[:3]),
        "counts": np.array([trajectory.counts[key] for key in COUNTS], dtype=np.int64),
        "events": np.array([(event.t, event.speed) for event in events]).reshape(-1, 2),
        "event_names": _names([(event.contact, event.kind) for event in events]).reshape(-1, 2),
    }
    if trajectory.works is not None:
        members |= {"works": trajectory.works, "work_names": _names(trajectory.work_names)}
    if trajectory.struck.any():
        members["event"] = trajectory.struck
    for name, saved in trajectory.saved.items():
        members |= {f"{SAVED}{name}": saved.values, f"{COLUMNS}{name}": _names(saved.columns)}
    if trajectory.origin is not None:
        origin = trajectory.origin
        members["scene"] = _names([*origin.scene.items()]).reshape(-1, 2)
        members |= _value_members("", origin)
    if trajectory.setup is not None:
        scene = np.frombuffer(trajectory.setup.scene.encode(), dtype=np.uint8)
        members |= {f"{SETUP}scene": scene, **_value_members(SETUP, trajectory.setup)}
        if trajectory.setup.varying is not None:
            members[f"{SETUP}varying"] = trajectory.setup.varying
    members |= {f"{RESUME}{name}": trajectory.resume[name] for name in sorted(trajectory.resume)}
    write_whole(path, packed(members), force=force)


def _names(names: Any) -> Array:
    return np.array(names, dtype=np.str_)


def _value_members(prefix: str, given: Origin | Setup) -> dict[str, Array]:
    """The members of a file that hold parameters and inputs."""
    members = {}
    for kind in ("parameters", "inputs"):
        values: Mapping[str, float] = getattr(given, kind)
        members[f"{prefix}{kind}_names"] = _names([*values])
        members[f"{prefix}{kind}"] = np.array([*values.values()], dtype=np.float64)
    return members


def load_npz(path: Path) -> Trajectory:
    """The trajectory that `save_npz` wrote. Never executes code from the file.

    A digest detects damage. Raises `RunError` if the file is missing, no trajectory written by
    eomgen, or damaged.
    """
    data = read_plain(path, LARGEST)
    if not is_ours(data):
        raise RunError(f"{path}: is not a trajectory written by eomgen")
    # The errors that zipfile and NumPy raise for a broken archive have no common base class.
    try:
        members = unpacked(data)
        form = _text(members["eomgen"])
        if form in READ:
            return _trajectory(checked(members))
    except Exception:
        raise RunError(f"{path}: is damaged; simulate again") from None
    raise RunError(
        f"{path}: is in format '{form}', but this eomgen reads '{FORMAT}'; simulate again"
    )


def _trajectory(members: dict[str, Array]) -> Trajectory:
    """The trajectory in the members of an archive.

    Raises `ValueError` or `KeyError` if a member is missing, unknown, or of another type.
    """
    rest = dict(members)
    del rest["eomgen"]
    counts, finished = rest.pop("counts"), rest.pop("finished")
    if counts.dtype != np.int64 or counts.ndim != 1 or finished.dtype != np.bool_ or finished.ndim:
        raise ValueError("numbers of another type")
    worked, known = "works" in rest, "scene" in rest
    rest.pop("event", None)  # which follows from t
    pairs = zip(
        _floats(rest.pop("events"), 2).tolist(), _strings(rest.pop("event_names"), 2), strict=True
    )
    made = Trajectory(
        name=_text(rest.pop("name")),
        states=tuple(_strings(rest.pop("states"), 1)),
        t=_floats(rest.pop("t"), 1),
        y=_floats(rest.pop("y"), 2),
        integrator=_text(rest.pop("integrator")),
        finished=bool(finished),
        message=_text(rest.pop("message")),
        counts=dict(zip(COUNTS, counts.tolist(), strict=True)),
        events=tuple(Event(t, contact, kind, speed) for (t, speed), (contact, kind) in pairs),
        works=_floats(rest.pop("works"), 2) if worked else None,
        work_names=tuple(_strings(rest.pop("work_names"), 1)) if worked else (),
        resume={
            name.removeprefix(RESUME): _floats(rest.pop(name))
            for name in members
            if name.startswith(RESUME)
        },
        origin=_origin(rest) if known else None,
        outcome=_outcome(_strings(rest.pop("outcome"), 1)),
        saved={
            name.removeprefix(SAVED): Saved(
                _floats(rest.pop(name)),
                tuple(_strings(rest.pop(f"{COLUMNS}{name.removeprefix(SAVED)}"), 1)),
            )
            for name in members
            if name.startswith(SAVED)
        },
        setup=_setup(rest) if f"{SETUP}scene" in rest else None,
    )
    if rest:
        raise ValueError("members that trajectories do not have")
    return made


def _outcome(texts: Sequence[str]) -> Outcome:
    """The outcome of a run. Raises `ValueError` for an unknown kind."""
    kind, reason, remedy = texts
    (known,) = (ending for ending in ENDINGS if ending == kind)
    return Outcome(known, reason, remedy)


def _origin(rest: dict[str, Array]) -> Origin:
    """The origin of a motion, whose members are removed from `rest`."""
    values = _values(rest, "")
    return Origin(dict(_strings(rest.pop("scene"), 2)), *values)


def _setup(rest: dict[str, Array]) -> Setup:
    """The setup of a run, whose members are removed from `rest`."""
    scene, varying = rest.pop(f"{SETUP}scene"), rest.pop(f"{SETUP}varying", None)
    if scene.dtype != np.uint8 or scene.ndim != 1:
        raise ValueError("no text")
    parameters, inputs = _values(rest, SETUP)
    known = None if varying is None else _floats(varying, 2)
    return Setup(scene.tobytes().decode(), parameters, inputs, known)


def _values(rest: dict[str, Array], prefix: str) -> list[dict[str, float]]:
    """Parameters and inputs, whose members are removed from `rest`."""
    values = []
    for kind in (f"{prefix}parameters", f"{prefix}inputs"):
        names = _strings(rest.pop(f"{kind}_names"), 1)
        values.append(dict(zip(names, _floats(rest.pop(kind), 1).tolist(), strict=True)))
    return values


def _floats(array: Array, dimensions: int | None = None) -> FloatArray:
    """An array of doubles. Raises `ValueError` for another type or number of axes."""
    if array.dtype != np.float64 or dimensions not in (None, array.ndim):
        raise ValueError("not doubles, or not in that shape")
    return array


def _strings(array: Array, dimensions: int) -> list[Any]:
    """A list of texts, or of lists of texts. Raises `ValueError` for anything else."""
    if array.dtype.kind != "U" or array.ndim != dimensions:
        raise ValueError("not texts, or not in that shape")
    found: list[Any] = array.tolist()
    return found


def _text(array: Array) -> str:
    """A text. Raises `ValueError` for anything else."""
    if array.dtype.kind != "U" or array.ndim:
        raise ValueError("no text")
    return str(array)


def save_csv(trajectory: Trajectory, path: Path, force: bool = False) -> None:
    """Write `trajectory` as a table: a line of names, then for each time a row with t, y and, if
    there are works, work_<effect>, J; then what else is saved. If times repeat, which they do at
    impacts, a column `event` follows t: see `Trajectory.struck`. Rows where it is 0 have times of
    their own.

    Numbers are the shortest that read back exactly. `pandas.read_csv(path)` and
    `np.genfromtxt(path, delimiter=",", names=True)` read the table. The rest of the trajectory is
    only in the archive that `save_npz` writes. Raises `RunError` as `save_npz` does.
    """
    buffer = io.StringIO()
    table = csv.writer(buffer, lineterminator="\n")
    columns = table_of(trajectory)
    table.writerow(columns)
    table.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
    write_whole(path, buffer.getvalue(), force=force or is_own_table(path))


def is_own_table(path: Path) -> bool:
    """Whether a table is ours: its columns, its first row and its last one are those of the
    trajectory in the .npz of the same name.

    A mark in the table itself would disturb other programs that read it.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = csv.reader(file)
            head, first = next(rows, []), next(rows, [])
            last = first
            for row in rows:
                last = row
        columns = table_of(load_npz(path.with_suffix(".npz")))
        ends = [[str(column[i].item()) for column in columns.values()] for i in (0, -1)]
        return [head, first, last] == [[*columns], *ends]
    except (OSError, UnicodeDecodeError, csv.Error, RunError):
        return False


def table_of(trajectory: Trajectory) -> dict[str, NDArray[Any]]:
    """The columns of a table, (n,) each, by name."""
    columns: dict[str, NDArray[Any]] = {"t": trajectory.t}
    if trajectory.struck.any():
        columns["event"] = trajectory.struck
    columns |= zip(trajectory.states, trajectory.y.T, strict=True)
    if trajectory.works is not None:
        names = (f"work_{name}" for name in trajectory.work_names)
        columns |= zip(names, trajectory.works.T, strict=True)
    for saved in trajectory.saved.values():
        rows = saved.values.reshape(len(trajectory.t), -1)
        columns |= zip(saved.columns, rows.T, strict=True)
    return columns
