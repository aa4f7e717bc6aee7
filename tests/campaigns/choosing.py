"""Does `--accuracy` hold? Scenes, targets, and the cheapest run that would have done.

    python tests/campaigns/choosing.py [--keep FOLDER] [--reference S] [--times N]
        [--methods A,B,…] [SCENE …]

For each scene (all built-in ones) and each target: the true error of the run chosen, its estimate,
and its time beside that of the cheapest run of any method over a ladder of tolerances or steps
whose true error is below the target, found afterwards. Errors are those of the last state, against
`eomgen.study.reference`. Times are of the processor, the least of N. What is done is kept in FOLDER
and not done again.
"""

import argparse
import json
import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from eomgen.build import build_model
from eomgen.errors import RunError
from eomgen.run.integrators import INTEGRATORS
from eomgen.run.module import as_problem, load_module
from eomgen.scene.reader import built_in_names, find_scene, read_scene
from eomgen.store import generated_code
from eomgen.study.choosing import meet
from eomgen.study.measure import error
from eomgen.study.reference import Reference, reference
from eomgen.study.trial import Case, Setting, method_of

TARGETS = (1e-3, 1e-6, 1e-9)
FACTOR, SHARE, WORST = 3.0, 0.95, 10.0
"""What must hold: the time within so many times the cheapest; so many cases below their target;
none above so many times it."""


def prepared(scene: str, folder: Path | None, seconds: float) -> tuple[Case, Reference]:
    """A scene's own run, at its own parameters, and what it is compared with."""
    model = build_model(read_scene(scene))
    module = load_module(generated_code(model).module, model.name)
    t_end = model.simulation.t_end
    kept = {"rest_speed": model.simulation.rest_speed, "samples": 1001}
    case = Case(as_problem(module, model=model), t_end, module.UNITS, kept)
    true = reference(model, module, t_end=t_end, seconds=seconds, folder=folder)
    return case, true


def ladder(case: Case, true: Reference, names: Iterable[str]) -> Iterator[Setting]:
    """Settings of the methods, the loosest of each first; equal steps give the rows asked for."""
    for name in names:
        method = method_of(name)
        if method.equal_steps:
            for k in range(7):
                yield Setting(name, dt=case.t_end / (case.rows - 1) / 2**k)
        else:
            for k in range(2, 14):
                yield case.setting(method, 10.0**-k, true.y)


def true_error(case: Case, true: Reference, setting: Setting, most: float) -> tuple[float, float]:
    """A run's true error, infinite if it breaks off or its method is not for this motion, and its
    work, s.
    """
    try:
        run = case.run(setting, most=most)
    except RunError:
        return math.inf, math.inf
    ended = run.trajectory.finished
    return error(run.trajectory.y[-1], true.y[-1], true.scale) if ended else math.inf, run.work


def case_rows(scene: str, given: argparse.Namespace) -> list[dict[str, Any]]:
    """One row a target."""
    case, true = prepared(scene, given.keep, given.reference)
    rows: list[dict[str, Any]] = []
    for target in TARGETS:
        choice = meet(case, target)
        run = choice.tried
        again = [case.run(run.setting).work for _ in range(given.times if run.work < 2 else 0)]
        row = {
            "scene": scene,
            "target": target,
            "reference": true.final_error,
            "options": run.setting.options,
            "met": choice.met,
            "true": error(run.trajectory.y[-1], true.y[-1], true.scale),
            "estimate": choice.error,
            "work": min([run.work, *again]),
            "pilot": choice.seconds / run.seconds,
            "runs": choice.runs,
        }
        print(row, flush=True)
        rows.append(row)
    most = max(row["work"] for row in rows)
    cheapest = dict.fromkeys(TARGETS, (math.inf, ""))
    given_up = set()
    for setting in ladder(case, true, given.methods.split(",")):
        # A method is given up once it takes longer than anything of interest.
        if setting.integrator in given_up:
            continue
        found, work = true_error(case, true, setting, most)
        if not work < most:
            given_up.add(setting.integrator)
        for row in rows:
            target = row["target"]
            if found < target and work < min(cheapest[target][0], row["work"]):
                for _ in range(given.times if work < 2 else 0):
                    work = min(work, true_error(case, true, setting, most)[1])
                cheapest[target] = (work, setting.options)
    for row in rows:
        work, options = cheapest[row["target"]]
        row["cheapest"], row["by"] = (work, options) if options else (row["work"], row["options"])
    return rows


def show(rows: list[dict[str, Any]]) -> None:
    """The table, and what it amounts to."""
    print(
        f"{'scene':<20}{'target':>8}{'true/target':>13}{'est./true':>11}{'time/cheapest':>15}  runs"
    )
    for row in rows:
        ratio = row["work"] / row["cheapest"]
        print(
            f"{row['scene']:<20}{row['target']:>8.0e}{row['true'] / row['target']:>13.2g}"
            f"{row['estimate'] / max(row['true'], 1e-300):>11.2g}{ratio:>10.2f}"
            f"{row['pilot'] * ratio:>7.1f}{row['runs']:>4}  {row['options'][13:]}"
            f" ({row['by'][13:]}){'' if row['met'] else '  said to be out of reach'}"
            f"{'' if row['reference'] < row['target'] / 3 else '  reference too rough'}"
        )
    judged = [row for row in rows if row["met"] and row["reference"] < row["target"] / 3]
    below = sum(row["true"] <= row["target"] for row in judged)
    worst = max((row["true"] / row["target"] for row in judged), default=0.0)
    quick = sum(row["work"] <= FACTOR * row["cheapest"] for row in judged)
    out = sum(not row["met"] for row in rows)
    print(
        f"{below} of {len(judged)} below their target (wanted {SHARE:.0%}), worst {worst:.2g} of it"
    )
    print(f"{quick} of {len(judged)} within {FACTOR:g} times the cheapest")
    print(f"{out} of {len(rows)} said to be out of reach")


def main() -> None:
    """Do what is not yet done, and show all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("scenes", nargs="*", default=list(built_in_names()))
    parser.add_argument("--keep", type=Path, default=Path("out/choosing"))
    parser.add_argument("--reference", type=float, default=120.0, help="s for long numbers")
    parser.add_argument("--times", type=int, default=3)
    parser.add_argument("--methods", default=",".join(INTEGRATORS), help="for the cheapest run")
    given = parser.parse_args()
    given.keep.mkdir(parents=True, exist_ok=True)
    rows = []
    for scene in given.scenes:
        path = given.keep / f"{find_scene(scene).stem}.json"
        if not path.exists():
            path.write_text(json.dumps(case_rows(scene, given), indent=1))
        rows += json.loads(path.read_text())
        show(rows)


if __name__ == "__main__":
    main()
