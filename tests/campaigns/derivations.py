"""Every built-in scene derived in all three formats, and the LaTeX compiled.

    python tests/campaigns/derivations.py [SCENE ...] [-o FOLDER]
    python tests/campaigns/derivations.py [SCENE ...] --beside CHECKOUT

prints for each scene the seconds that each format took, with the pages that `pdflatex
-halt-on-error` makes of the LaTeX and the lines that are wider than the page, if it is installed.
It takes a minute or two on one core. The exit code is 1 if anything was refused, or if a
multiplier is used that no line gives. `tests/derivation/test_exposition.py` does the same for a few
scenes, without `pdflatex`.

With another checkout it prints the processor seconds of a derivation and its text there and here.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import eomgen
from eomgen.api.derivation import Derivation
from eomgen.scene.reader import built_in_names

ENDINGS = {"text": "txt", "html": "html", "latex": "tex"}


def main() -> int:
    """Derive, write, compile; a line for each scene."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", metavar="SCENE")
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--beside", type=Path, metavar="CHECKOUT")
    given = parser.parse_args()
    if given.beside:
        return beside(given.scenes or built_in_names(), given.beside)
    folder = given.output or Path(tempfile.mkdtemp())
    folder.mkdir(parents=True, exist_ok=True)
    refused = 0
    print(f"{'scene':<20}{'derived':>8}" + "".join(f"{name:>8}" for name in ENDINGS) + "  paper")
    for scene in given.scenes or built_in_names():
        start = time.perf_counter()
        try:
            found = eomgen.derive(scene, detail="all")
        except eomgen.EomgenError as error:
            refused += 1
            print(f"{scene:<20}{error}")
            continue
        line = f"{scene:<20}{time.perf_counter() - start:>7.1f}s"
        for name, ending in ENDINGS.items():
            start = time.perf_counter()
            text = getattr(found, name)()
            (folder / f"{scene}.{ending}").write_text(text, "utf-8")
            line += f"{time.perf_counter() - start:>7.1f}s"
        paper, compiled = on_paper(folder, scene)
        free = free_multipliers(found)
        refused += not compiled or bool(free)
        paper += f", {', '.join(free)} free" if free else ""
        print(f"{line}  {paper}", flush=True)
    print(f"written to {folder}; {refused} refused")
    return int(refused > 0)


def free_multipliers(found: Derivation) -> list[str]:
    """Multipliers that are used and that no line gives."""
    given, used = set[str](), set[str]()
    for line in (line for step in found.steps for line in step.equations):
        left = {s.name for s in line.left.free_symbols}
        entries = {s.name for s in line.right.free_symbols}
        given |= left | (entries if "lambda" in left else set())
        used |= entries
    return sorted(name for name in used - given if name.startswith("lambda"))


TIMED = """
import sys, time, eomgen
eomgen.derive("pendulum").text()
for scene in sys.argv[1:]:
    start = time.process_time()
    eomgen.derive(scene).text()
    print(time.process_time() - start)
"""


def beside(scenes: Sequence[str], checkout: Path) -> int:
    """The times of each scene there and here, measured at the same time."""
    running = []
    for folder in (checkout.resolve(), Path(__file__).resolve().parents[2]):
        command, path = [sys.executable, "-c", TIMED, *scenes], {**os.environ}
        path["PYTHONPATH"] = str(folder)
        running.append(subprocess.Popen(command, env=path, stdout=subprocess.PIPE, text=True))
    print(f"{'scene':<20}{'there':>8}{'here':>8}{'ratio':>8}")
    times = [map(float, process.communicate()[0].split()) for process in running]
    for scene, there, here in zip(scenes, *times, strict=True):
        print(f"{scene:<20}{there:>7.2f}s{here:>7.2f}s{here / there:>8.2f}")
    return max(process.returncode for process in running)


def on_paper(folder: Path, scene: str) -> tuple[str, bool]:
    """What `pdflatex` makes of a scene's LaTeX, and whether it compiles."""
    if shutil.which("pdflatex") is None:
        return "no pdflatex", True
    command = ["pdflatex", "-halt-on-error", "-interaction=nonstopmode", f"{scene}.tex"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, errors="replace")
    if done.returncode:
        return next((x for x in done.stdout.splitlines() if x.startswith("!")), "failed"), False
    log = (folder / f"{scene}.log").read_text("utf-8", errors="replace")
    pages = re.search(r"\((\d+) pages?", log)
    wide = log.count("Overfull \\hbox")
    return f"{pages[1] if pages else '?'} pages, {wide} lines too wide", True


if __name__ == "__main__":
    sys.exit(main())
