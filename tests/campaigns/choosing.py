"""Does `--accuracy` hold, what does the search take, and would another run have been quicker?

    python tests/campaigns/choosing.py [--own] [--count N] [--keep FOLDER] [--against FOLDER]
        [--reference S] [--limit S] [--methods A,B,…] [SCENE …]

For each scene (all built-in ones; with --own those of `tests/accuracy_scenes.py`) and each target:
the true error of the run chosen, its estimate, its work and that of the whole search. Runs are made
in compiled code, as `eomgen simulate` makes long ones. Errors are those of the last state, against
a closed form where there is one and `eomgen.study.accuracy.reference` where not. Times are of the
processor. With --methods, beside each stands the quickest run of these over a ladder of tolerances
or steps whose true error is below the target, found afterwards.

What is done is kept in FOLDER and not done again. So a change of the search is judged by two
folders: `--keep before`, then after the change `--keep after --against before`.
"""

import argparse
import json
import math
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

sys.path.append(str(Path(__file__).parent.parent))

from accuracy_scenes import SCENES, case_of, closed_end, made

from eomgen.base.errors import RunError
from eomgen.run.problem import FloatArray
from eomgen.scene.reader import built_in_names, find_scene
from eomgen.study.accuracy.choosing import meet
from eomgen.study.accuracy.measure import error
from eomgen.study.accuracy.methods import method_of
from eomgen.study.accuracy.reference import reference
from eomgen.study.accuracy.trial import Case, Setting, Tried

TARGETS = (1e-3, 1e-6, 1e-9)
REFERENCES = Path("out/references")
FACTOR = 3.0
"""What is reported: how many times lie within this many times the quickest."""
EPS = float(np.finfo(float).eps)

Row = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Truth:
    """The last state `y` (ny,), what it may be off, in parts of the scale, and how it is known;
    the `scale` is that of the run where it is None.
    """

    y: FloatArray
    off: float
    origin: str
    scale: FloatArray | None = None


class LateError(Exception):
    """A search took longer than allowed."""


def late(*_: object) -> None:
    raise LateError


def truth_of(scene: str, seconds: float) -> Truth:
    """A scene's last state, in closed form or in extended precision."""
    end = closed_end(scene) if scene in SCENES else None
    if end is not None:
        return Truth(np.array([float(x) for x in end]), EPS, "closed form")
    model, module, wanted = made(scene)
    true = reference(model, module, t_end=wanted.t_end, seconds=seconds, folder=REFERENCES)
    return Truth(true.y[-1], true.final_error, true.origin.split(",")[0], true.scale)


def timed(run: Callable[[], Any]) -> tuple[Any, float]:
    """What a call gives, and how long it takes the processor, s."""
    began = time.process_time()
    return run(), time.process_time() - began


def true_error(case: Case, true: Truth, run: Tried) -> float:
    """What a run's last state is off; infinite if it breaks off."""
    if not run.trajectory.finished:
        return math.inf
    scale = case.scale(run.extent) if true.scale is None else true.scale
    return error(run.trajectory.y[-1], true.y, scale)


def chosen(case: Case, true: Truth, target: float, limit: float) -> Row:
    """What the search for a target chooses, and what it takes; it is ended after `limit`, s of the
    processor.
    """
    made, run = [0.0], Case.run

    def counted(self: Case, *given: Any, **named: Any) -> Tried:
        tried = run(self, *given, **named)
        made[0] += tried.work
        return tried

    Case.run = counted  # type: ignore[method-assign]
    signal.setitimer(signal.ITIMER_PROF, limit)
    try:
        choice, spent = timed(lambda: meet(case, target))
    except LateError:
        return {"met": False, "reason": "late", "search": limit, "total": made[0], "runs": 0}
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        Case.run = run  # type: ignore[method-assign]
    tried = choice.tried
    return {
        "options": tried.setting.options,
        "met": choice.met,
        "reason": choice.reason,
        "true": true_error(case, true, tried),
        "estimate": choice.error,
        "work": tried.work,
        "total": made[0],
        "search": spent,
        "runs": choice.runs,
        "extent": tried.extent.tolist(),
    }


def ladder(case: Case, extent: FloatArray, names: Iterable[str]) -> Iterator[Setting]:
    """Settings of the methods, the loosest of each first; equal steps give the rows asked for."""
    for name in names:
        method = method_of(name)
        if method.equal_steps:
            for k in range(7):
                yield Setting(name, dt=case.t_end / (case.rows - 1) / 2**k)
        else:
            for k in range(3, 14):
                yield case.setting(method, 10.0**-k, extent)


def quickest(case: Case, true: Truth, rows: Sequence[Row], names: Sequence[str]) -> None:
    """Write beside each row the time of its run, and the quickest run of these methods that would
    have done.
    """
    for row in rows:
        words = row["options"].split()
        given = {key[2:]: float(x) for key, x in zip(words[2::2], words[3::2], strict=True)}
        _, row["seconds"] = timed(lambda: case.run(Setting(words[1], **given)))  # noqa: B023
        row["quickest"], row["by"] = row["seconds"], row["options"]
    given_up = set()
    most, extent = max(row["work"] for row in rows), np.array(rows[-1]["extent"])
    for setting in ladder(case, extent, names):
        # A method is given up once it takes longer than anything of interest, or is exact enough.
        if setting.integrator in given_up:
            continue
        try:
            run, seconds = timed(lambda setting=setting: case.run(setting, most=most))
        except RunError:  # it is not for this motion
            given_up.add(setting.integrator)
            continue
        found = true_error(case, true, run)
        if run.cut or found < min(TARGETS):
            given_up.add(setting.integrator)
        for row in rows:
            if found < row["target"] and seconds < row["quickest"]:
                row["quickest"], row["by"] = seconds, setting.options


def case_rows(scene: str, given: argparse.Namespace) -> list[Row]:
    """One row a target."""
    case, true = case_of(scene, compiled=True), truth_of(scene, given.reference)
    about = {"truth": true.origin, "reference": true.off}
    rows = []
    for target in TARGETS:
        row = {"scene": scene, "target": target, **about, **chosen(case, true, target, given.limit)}
        rows.append(row)
        print({key: value for key, value in row.items() if key != "extent"}, flush=True)
    ended = [row for row in rows if "options" in row]
    if given.methods and ended:
        quickest(case, true, ended, given.methods.split(","))
    return rows


def show(rows: Sequence[Row]) -> None:
    """The table, a scene a line, and what it amounts to."""
    heads = " | ".join(f"{target:.0e}" for target in TARGETS)
    print(f"| scene | {heads} |\n|---|" + "---|" * len(TARGETS))
    for scene in dict.fromkeys(row["scene"] for row in rows):
        cells = [cell(row) for row in rows if row["scene"] == scene]
        print(f"| {scene} | {' | '.join(cells)} |")
    met = [row for row in rows if row["met"]]
    judged = [row for row in met if row["reference"] < row["target"] / 3]
    below = sum(row["true"] <= row["target"] for row in judged)
    worst = max((row["true"] / row["target"] for row in judged), default=0.0)
    sure = max((row["true"] / row["estimate"] for row in judged), default=0.0)
    spent = sum(row["search"] for row in rows)
    print(
        f"\n{below} of {len(judged)} below their target, the worst at {worst:.2g} of it; "
        f"true error at most {sure:.2g} of the estimate"
    )
    print(
        f"{len(rows) - len(met)} of {len(rows)} refused; {sum(row['runs'] for row in rows)} runs, "
        f"{spent:.0f} s of the processor"
    )
    times = [row["seconds"] / row["quickest"] for row in met if "quickest" in row]
    search = [row["search"] / row["quickest"] for row in met if "quickest" in row]
    if times:
        quick = sum(ratio <= FACTOR for ratio in times)
        print(
            f"{quick} of {len(times)} within {FACTOR:g} times the quickest, median "
            f"{median(times):.2g}; with the search, median {median(search):.2g}"
        )


def cell(row: Row) -> str:
    """One scene at one target: true error, time and its ratio to the quickest, and the methods."""
    if "options" not in row:
        return "refused: late"
    if not row["met"]:
        return f"refused, at {row['true']:.0e}"
    own = row["options"].split()[1]
    found = f"{row['true']:.0e} by {own}, {row['search']:.2g} s with the search"
    if "quickest" not in row:
        return found
    ratio, by = row["seconds"] / row["quickest"], row["by"].split()[1]
    found = f"{row['true']:.0e} in {row['seconds']:.2g} s by {own}"
    return f"{found}, {ratio:.1f} × {by}" if ratio > 1 else found


def compare(rows: Sequence[Row], before: Mapping[tuple[str, float], Row]) -> None:
    """What has changed: rows met, and the work of the runs and searches for rows met both times."""
    pairs = [(before[at], row) for row in rows if (at := (row["scene"], row["target"])) in before]
    print(
        f"\nbefore: {sum(old['met'] for old, _ in pairs)} of {len(pairs)} met, "
        f"{sum(old['search'] for old, _ in pairs):.0f} s; "
        f"now: {sum(new['met'] for _, new in pairs)}, "
        f"{sum(new['search'] for _, new in pairs):.0f} s of the processor"
    )
    for old, new in pairs:
        if old["met"] != new["met"]:
            words = "now met" if new["met"] else f"now refused: {new['reason']}"
            print(f"    {new['scene']} at {new['target']:.0e}: {words}")
    for what in ("work", "total"):
        shares = sorted(new[what] / old[what] for old, new in pairs if old["met"] and new["met"])
        if shares:
            tenth = len(shares) // 10
            print(
                f"{what}, now to before: median {median(shares):.2f}, "
                f"{shares[tenth]:.2f} to {shares[-1 - tenth]:.2f} without a tenth at either end, "
                f"at most {shares[-1]:.2f}"
            )


def kept_rows(folder: Path) -> list[Row]:
    """The rows in a folder."""
    return [row for path in sorted(folder.glob("*.json")) for row in json.loads(path.read_text())]


def main() -> None:
    """Do what is not yet done, and show all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("scenes", nargs="*")
    parser.add_argument("--own", action="store_true", help="scenes that are not built in")
    parser.add_argument("--count", type=int, help="so many of the scenes, evenly spread")
    parser.add_argument("--keep", type=Path, default=Path("out/choosing"))
    parser.add_argument("--against", type=Path, help="what was kept before a change")
    parser.add_argument("--reference", type=float, default=120.0, help="s for extended precision")
    parser.add_argument("--limit", type=float, default=60.0, help="s of the processor, a search")
    parser.add_argument("--methods", default="", help="for the quickest run")
    given = parser.parse_args()
    for folder in (given.keep, REFERENCES):
        folder.mkdir(parents=True, exist_ok=True)
    signal.signal(signal.SIGPROF, late)
    scenes = given.scenes or list(SCENES if given.own else built_in_names())
    if given.count:
        scenes = [scenes[i * len(scenes) // given.count] for i in range(given.count)]
    rows = []
    for scene in scenes:
        name = scene if scene in SCENES else find_scene(scene).stem
        path = given.keep / f"{name}.json"
        if not path.exists():
            path.write_text(json.dumps(case_rows(scene, given), indent=1))
        rows += json.loads(path.read_text())
    show(rows)
    if given.against:
        before = {(row["scene"], row["target"]): row for row in kept_rows(given.against)}
        compare(rows, before)


if __name__ == "__main__":
    main()
