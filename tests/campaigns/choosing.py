"""Does `--accuracy` hold? Scenes, targets, and the quickest run that would have done.

    python tests/campaigns/choosing.py [--own] [--keep FOLDER] [--reference S]
        [--methods A,B,…] [SCENE …]

For each scene (all built-in ones; with --own those of `tests/accuracy_scenes.py`) and each target:
the true error of the run chosen, its estimate, its time and that of the whole search, beside that
of the quickest run of any method over a ladder of tolerances or steps whose true error is below the
target, found afterwards. Errors are those of the last state, against a closed form where there is
one and `eomgen.study.accuracy.reference` where not. Times are of the processor. What is done is
kept in FOLDER and not done again.
"""

import argparse
import json
import math
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.append(str(Path(__file__).parent.parent))

from accuracy_scenes import SCENES, closed_end, text

from eomgen.base.errors import RunError
from eomgen.model.elaborate import elaborate
from eomgen.run.module import load_module
from eomgen.run.problem import FloatArray
from eomgen.scene.reader import built_in_names, find_scene, parse_scene, read_scene
from eomgen.store import generated_code
from eomgen.study.accuracy.choosing import meet
from eomgen.study.accuracy.localised import under_scrutiny
from eomgen.study.accuracy.measure import error
from eomgen.study.accuracy.methods import method_of
from eomgen.study.accuracy.moved import moved_problem
from eomgen.study.accuracy.reference import reference
from eomgen.study.accuracy.trial import Case, Setting, Tried
from eomgen.study.diagnosis import problem_of

TARGETS = (1e-3, 1e-6, 1e-9)
METHODS = "DOP853,LSODA,Radau,RK45,rk4,gauss_6"
"""Among which the quickest is looked for afterwards."""
FACTOR = 3.0
"""What is reported: how many times lie within this many times the quickest."""
EPS = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class Truth:
    """The last state `y` (ny,), what it may be off, in parts of the scale, and how it is known;
    the `scale` is that of the run where it is None.
    """

    y: FloatArray
    off: float
    origin: str
    scale: FloatArray | None = None


def prepared(scene: str, own: bool, folder: Path, seconds: float) -> tuple[Case, Truth]:
    """A scene's own run, at its own parameters, and what it is compared with."""
    tables = parse_scene(text(scene)) if own else read_scene(scene)
    model, wanted = elaborate(tables), tables.simulation
    module = load_module(generated_code(model).module, model.name)
    t_end = wanted.t_end
    kept = {"rest_speed": wanted.rest_speed, "samples": 1001}
    problem, moved = problem_of(module, model=model), moved_problem(module, model)
    problem = under_scrutiny(problem, model, module)
    case = Case(problem, t_end, module.UNITS, kept, moved=moved)
    end = closed_end(scene) if own else None
    if end is not None:
        return case, Truth(np.array([float(x) for x in end]), EPS, "closed form")
    true = reference(model, module, t_end=t_end, seconds=seconds, folder=folder)
    return case, Truth(true.y[-1], true.final_error, true.origin.split(",")[0], true.scale)


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


def case_rows(scene: str, given: argparse.Namespace) -> list[dict[str, Any]]:
    """One row a target."""
    case, true = prepared(scene, given.own, given.keep, given.reference)
    rows: list[dict[str, Any]] = []
    most, extent = 0.0, None
    for target in TARGETS:
        choice, spent = timed(lambda target=target: meet(case, target))
        run: Tried = choice.tried
        _, seconds = timed(lambda run=run: case.run(run.setting))
        row = {
            "scene": scene,
            "target": target,
            "truth": true.origin,
            "reference": true.off,
            "options": run.setting.options,
            "met": choice.met,
            "reason": choice.reason,
            "true": true_error(case, true, run),
            "estimate": choice.error,
            "seconds": seconds,
            "search": spent,
            "runs": choice.runs,
            "quickest": seconds,
            "by": run.setting.options,
        }
        print(row, flush=True)
        rows.append(row)
        most, extent = max(most, run.work), run.extent
    given_up = set()
    for setting in ladder(case, extent, given.methods.split(",")):
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
    return rows


def show(rows: list[dict[str, Any]]) -> None:
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
    times = sorted(row["seconds"] / row["quickest"] for row in met)
    search = sorted(row["search"] / row["quickest"] for row in met)
    print(
        f"\n{below} of {len(judged)} below their target, the worst at {worst:.2g} of it; "
        f"true error at most {sure:.2g} of the estimate"
    )
    print(f"{len(rows) - len(met)} of {len(rows)} refused")
    quick = sum(ratio <= FACTOR for ratio in times)
    print(
        f"{quick} of {len(met)} within {FACTOR:g} times the quickest, median {median(times):.2g}; "
        f"with the search, median {median(search):.2g}"
    )


def cell(row: dict[str, Any]) -> str:
    """One scene at one target: true error, time and its ratio to the quickest, and the methods."""
    if not row["met"]:
        return f"refused, at {row['true']:.0e}"
    own, by = row["options"].split()[1], row["by"].split()[1]
    ratio = row["seconds"] / row["quickest"]
    found = f"{row['true']:.0e} in {row['seconds']:.2g} s by {own}"
    return f"{found}, {ratio:.1f} × {by}" if ratio > 1 else found


def median(values: list[float]) -> float:
    """The middle one of sorted values; nan of none."""
    return values[len(values) // 2] if values else math.nan


def main() -> None:
    """Do what is not yet done, and show all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("scenes", nargs="*")
    parser.add_argument("--own", action="store_true", help="scenes that are not built in")
    parser.add_argument("--keep", type=Path, default=Path("out/choosing"))
    parser.add_argument("--reference", type=float, default=120.0, help="s for extended precision")
    parser.add_argument("--methods", default=METHODS, help="for the quickest run")
    given = parser.parse_args()
    given.keep.mkdir(parents=True, exist_ok=True)
    rows = []
    for scene in given.scenes or (SCENES if given.own else built_in_names()):
        name = scene if given.own else find_scene(scene).stem
        path = given.keep / f"{name}.json"
        if not path.exists():
            path.write_text(json.dumps(case_rows(scene, given), indent=1))
        rows += json.loads(path.read_text())
    show(rows)


if __name__ == "__main__":
    main()
