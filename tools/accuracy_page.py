"""Draws the figures of docs/accuracy.md, and its front, from runs in compiled code:
`python tools/accuracy_page.py [SCENE …]`.

The front has for each scene and each error the quickest run that was measured. A digest of what
each scene's runs are made of stands in the page; `tests/project/test_accuracy_page.py` compares it.
"""

import argparse
import csv
import hashlib
import re
import shutil
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from eomgen.commands.main import main as eomgen
from eomgen.scene.reader import find_scene
from eomgen.study.accuracy import ladder
from eomgen.study.accuracy.reading import TARGETS
from eomgen.tables.integrators import INTEGRATORS, IntegratorSpec

DOCS = Path(__file__).parent.parent / "docs"
PAGE, MEASURED = DOCS / "accuracy.md", Path("out/accuracy")
FRONT = {
    "pendulum": "smooth",
    "double_pendulum": "chaotic",
    "two_body": "free in space",
    "four_bar": "a loop",
    "stiff_hinge": "stiff",
    "light_cart_pole": "spiky",
}
"""The scenes of the front, each with a figure, and what they stand for."""
METHODS = [name for name in INTEGRATORS if not name.endswith("_differences")]
HEAD = "| scene | error | time | derivatives | command |\n|---|---|---|---|---|\n"
START, END = "<!-- front -->\n", "<!-- end of front -->\n"


def file_of(scene: str) -> Path:
    """The file of a scene, built in or of the page."""
    own = DOCS / f"{scene}.toml"
    return own if own.exists() else find_scene(scene)


def argument(scene: str) -> str:
    """A scene as commands take it in the folder of the project."""
    return f"docs/{scene}.toml" if file_of(scene).parent == DOCS else scene


def digest(scene: str) -> str:
    """A digest of what the runs of a scene are made of: its text, the methods, and the tolerances
    and steps at which each is run.
    """
    specs = [spec for spec in INTEGRATORS.values() if not spec.outputs]
    own = [
        repr(spec).replace(", outputs=()", "")  # as they were measured
        for spec in specs
        if spec.package == IntegratorSpec.package
    ]
    rules = (ladder.COARSEST, ladder.LOOSEST, ladder.TIGHTEST, ladder.ATOL_SHARE, TARGETS)
    text = "\n".join([file_of(scene).read_text("utf-8"), *own, repr(rules)])
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def digests(page: str) -> dict[str, str]:
    """The digests in the page, by scene."""
    return dict(re.findall(r"<!-- (\w+) was measured of ([0-9a-f]{12}) -->", page))


def lines(scene: str, rows: Iterable[Mapping[str, str]]) -> Iterator[str]:
    """The lines of the front for a scene, from its table of runs."""
    done = [row for row in rows if row["status"] == "ok"]
    for target in TARGETS:
        good = [row for row in done if float(row["error"]) <= target]
        if not good:
            why = "none of these runs; `--accuracy` may find one"
            yield f"| {scene} | {target:.0e} | – | – | {why} |\n"
            continue
        row = min(good, key=lambda row: float(row["time_s"]))
        names = {"dt": "dt_s", "rtol": "rtol", "atol": "atol"}
        given = [f"--{name} {row[key]}" for name, key in names.items() if row[key]]
        command = " ".join(
            [f"eomgen simulate {argument(scene)} --integrator {row['method']}", *given]
        )
        seconds = f"{1e3 * float(row['time_s']):.2g} ms"
        yield f"| {scene} | {target:.0e} | {seconds} | {row['derivatives']} | `{command}` |\n"


def measure(scene: str, seconds: float, run_time: float) -> None:
    """Run all methods, and copy the figure."""
    methods = ",".join(METHODS)
    given = {
        "--backend": "c",
        "--methods": methods,
        "--time": seconds,
        "--run-time": run_time,
        "-o": MEASURED,
    }
    options = [str(x) for pair in given.items() for x in pair]
    if eomgen(["accuracy", argument(scene), "--quick", "--no-arithmetic", "--force", *options]):
        sys.exit(1)
    shutil.copy(MEASURED / f"{scene}_accuracy.png", DOCS / f"accuracy_{scene}.png")


def write_front(scene: str) -> None:
    """Write the lines of a scene, and its digest, into the page."""
    before, rest = PAGE.read_text("utf-8").split(START)
    front, after = rest.split(END)
    kept: dict[str, list[str]] = {}
    for line in re.findall(r"\| \w+ \| .*\n", front.replace(HEAD, "")):
        kept.setdefault(line.split()[1], []).append(line)
    with (MEASURED / f"{scene}_accuracy.csv").open(encoding="utf-8") as table:
        kept[scene] = list(lines(scene, csv.DictReader(table)))
    known = {**digests(front), scene: digest(scene)}
    marks = [f"<!-- {name} was measured of {known[name]} -->\n" for name in sorted(known)]
    body = [line for name in FRONT for line in kept.get(name, [])]
    PAGE.write_text("".join([before, START, *marks, "\n", HEAD, *body, "\n", END, after]), "utf-8")


def main() -> None:
    """Measure some scenes, or all, and write the page's front."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("scenes", nargs="*", default=list(FRONT), help=", ".join(FRONT))
    parser.add_argument("--time", type=float, default=300.0, help="s for a scene")
    parser.add_argument("--run-time", type=float, default=0.1, help="s for a run")
    given = parser.parse_args()
    for scene in given.scenes:
        measure(scene, given.time, given.run_time)
        write_front(scene)


if __name__ == "__main__":
    main()
