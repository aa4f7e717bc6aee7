"""Every built-in scene derived in all three formats, and the LaTeX compiled.

    python tests/campaigns/derivations.py [SCENE ...] [-o FOLDER]

prints for each scene the seconds that each format took, with the pages that `pdflatex
-halt-on-error` makes of the LaTeX and the lines that are wider than the page, if it is installed.
It takes a minute or two on one core. The exit code is 1 if anything was refused.
`tests/derivation/test_exposition.py` does the same for a few scenes, without `pdflatex`.
"""

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import eomgen
from eomgen.scene.reader import built_in_names

ENDINGS = {"text": "txt", "html": "html", "latex": "tex"}


def main() -> int:
    """Derive, write, compile; a line for each scene."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", metavar="SCENE")
    parser.add_argument("-o", "--output", type=Path)
    given = parser.parse_args()
    folder = given.output or Path(tempfile.mkdtemp())
    folder.mkdir(parents=True, exist_ok=True)
    refused = 0
    print(f"{'scene':<20}{'derived':>8}" + "".join(f"{name:>8}" for name in ENDINGS) + "  paper")
    for scene in given.scenes or built_in_names():
        start = time.perf_counter()
        try:
            found = eomgen.derive(scene)
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
        refused += not compiled
        print(f"{line}  {paper}", flush=True)
    print(f"written to {folder}; {refused} refused")
    return int(refused > 0)


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
