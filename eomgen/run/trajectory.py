"""What a run leaves behind, and the files it is kept in."""

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from eomgen.errors import RunError
from eomgen.files import is_ours, write_whole
from eomgen.run.problem import Floats

FORMAT = "trajectory 2"
RESUME = "resume_"
"""Begins the names of members of a file that a later run goes on from."""
COUNTS = ("steps", "derivatives", "jacobians", "impacts", "capped", "cut")
Kind = Literal["impact", "rest", "lift"]


@dataclass(frozen=True)
class Event:
    """What happened to a contact at time `t`, s.

    kind   "impact": it struck; "rest": from here on it is held, the force that keeps it closed
           being known at every moment; "lift": it no longer is
    speed  with which it closed, m/s or rad/s; 0 for a lift
    """

    t: float
    contact: str
    kind: Kind
    speed: float


@dataclass(frozen=True, eq=False)
class Trajectory:
    """The states of a mechanism at n times; arrays are read-only copies, in SI units.

    name, states  of the problem that was integrated
    t             (n,), n >= 1, in s, never decreasing
    y             (n, ny), one row of finite numbers per time
    integrator    the method that made it
    finished      whether it reached the end time
    message       why not, and what to change; "" if there is nothing to say
    counts        how many `steps` were made, `derivatives` and `jacobians` evaluated, and `impacts`
                  met; how many steps were as long as any may be (`capped`), and how many made
                  again, shorter, so as not to pass over a branch of the derivative (`cut`)
    events        what happened to contacts, in time; the rows just before and just after an impact
                  have the same t
    works         (n, m), J: what each effect has done since the start; None if it was not asked for
    work_names    names of these m effects
    resume        what a later run goes on from, to the same bytes as this one would have: arrays by
                  name, see `integrate`; none where the method cannot

    Raises `ValueError` if these do not fit together.
    """

    name: str
    states: tuple[str, ...]
    t: Floats
    y: Floats
    integrator: str
    finished: bool
    message: str
    counts: Mapping[str, int]
    events: tuple[Event, ...] = ()
    works: Floats | None = None
    work_names: tuple[str, ...] = ()
    resume: Mapping[str, Floats] = field(default_factory=dict)

    def __post_init__(self) -> None:
        t, y = np.array(self.t, dtype=np.float64), np.array(self.y, dtype=np.float64)
        if t.ndim != 1 or not t.size:
            raise ValueError(f"trajectory: t has shape {t.shape}, not (n,) with n >= 1")
        if y.shape != (t.size, len(self.states)):
            raise ValueError(f"trajectory: y has shape {y.shape}, not {(t.size, len(self.states))}")
        if not (np.isfinite(t).all() and np.isfinite(y).all()):
            raise ValueError("trajectory: t or y is not finite")
        if np.any(np.diff(t) < 0):
            raise ValueError("trajectory: t decreases")
        if set(self.counts) != set(COUNTS):
            raise ValueError(f"trajectory: counts are {sorted(self.counts)}, not {COUNTS}")
        arrays = [t, y]
        if self.works is not None:
            works = np.array(self.works, dtype=np.float64)
            if works.shape != (t.size, len(self.work_names)):
                raise ValueError(
                    f"trajectory: works have shape {works.shape}, "
                    f"not {(t.size, len(self.work_names))}"
                )
            arrays.append(works)
            object.__setattr__(self, "works", works)
        for array in arrays:
            array.flags.writeable = False
        object.__setattr__(self, "t", t)
        object.__setattr__(self, "y", y)
        object.__setattr__(self, "counts", {key: int(self.counts[key]) for key in COUNTS})


def save_npz(trajectory: Trajectory, path: Path, force: bool = False) -> None:
    """Write `trajectory` as NumPy's .npz, the same bytes for the same trajectory.

    Raises `RunError` if `path` cannot be written or holds a foreign file (then give `force`).
    """
    buffer = io.BytesIO()
    # Members keep this order: `eomgen` comes first, where it marks the file as ours.
    np.savez(
        buffer,
        eomgen=np.array(FORMAT),
        t=trajectory.t,
        y=trajectory.y,
        states=np.array(trajectory.states, dtype=np.str_),
        name=np.array(trajectory.name),
        integrator=np.array(trajectory.integrator),
        finished=np.array(trajectory.finished),
        message=np.array(trajectory.message),
        counts=np.array([trajectory.counts[key] for key in COUNTS], dtype=np.int64),
        events=np.array([(event.t, event.speed) for event in trajectory.events]).reshape(-1, 2),
        event_names=np.array(
            [(event.contact, event.kind) for event in trajectory.events], dtype=np.str_
        ).reshape(-1, 2),
        **_worked(trajectory),
        **_resumed(trajectory),
    )
    write_whole(path, buffer.getvalue(), force=force)


def _worked(trajectory: Trajectory) -> dict[str, Any]:
    """The members of a file that hold works; none where they were not asked for."""
    if trajectory.works is None:
        return {}
    names = np.array(trajectory.work_names, dtype=np.str_)
    return {"works": trajectory.works, "work_names": names}


def _resumed(trajectory: Trajectory) -> dict[str, Any]:
    """The members of a file that a later run goes on from."""
    return {f"{RESUME}{name}": trajectory.resume[name] for name in sorted(trajectory.resume)}


def load_npz(path: Path) -> Trajectory:
    """Return the trajectory that `save_npz` wrote; runs no code that the file may hold.

    Raises `RunError` if the file is missing, not a trajectory of ours, or damaged.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RunError(f"{path}: cannot be read: {error.strerror}") from None
    if not is_ours(data):
        raise RunError(f"{path}: is no trajectory written by eomgen")
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as members:
            form = str(members["eomgen"])
            if form == FORMAT:
                return Trajectory(
                    name=str(members["name"]),
                    states=tuple(members["states"].tolist()),
                    t=members["t"],
                    y=members["y"],
                    integrator=str(members["integrator"]),
                    finished=bool(members["finished"]),
                    message=str(members["message"]),
                    counts=dict(zip(COUNTS, members["counts"].tolist(), strict=True)),
                    events=tuple(
                        Event(t, contact, kind, speed)
                        for (t, speed), (contact, kind) in zip(
                            members["events"].tolist(), members["event_names"].tolist(), strict=True
                        )
                    ),
                    works=members.get("works"),
                    work_names=tuple(members.get("work_names", np.array(())).tolist()),
                    resume={
                        name.removeprefix(RESUME): members[name]
                        for name in members
                        if name.startswith(RESUME)
                    },
                )
    # What a broken archive makes zipfile and NumPy raise has no common base.
    except Exception as error:
        text = " ".join(str(error).split())
        raise RunError(f"{path}: is damaged ({text}); simulate again") from None
    raise RunError(
        f"{path}: is in format '{form}', but this eomgen reads '{FORMAT}'; simulate again"
    )


def save_csv(trajectory: Trajectory, path: Path, force: bool = False) -> None:
    """Write `trajectory` as a table: a comment line, the header, one row of t and y per time, and
    where works were asked for, of these: work_<effect>, J.

    Numbers are the shortest that read back exactly; `np.loadtxt(path, delimiter=",",
    skiprows=2)` loads them. Raises `RunError` as `save_npz` does.
    """
    comment = f"# eomgen trajectory of {trajectory.name}, integrator {trajectory.integrator}"
    if not trajectory.finished:
        comment += f", unfinished: {trajectory.message}"
    buffer = io.StringIO()
    buffer.write(" ".join(comment.split()) + "\n")
    table = csv.writer(buffer, lineterminator="\n")
    works = [] if trajectory.works is None else [trajectory.works]
    names = [f"work_{name}" for name in trajectory.work_names]
    table.writerow(["t", *trajectory.states, *names])
    table.writerows(np.column_stack([trajectory.t, trajectory.y, *works]).tolist())
    write_whole(path, buffer.getvalue(), force=force)
