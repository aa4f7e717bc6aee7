"""Every built-in scene's page in headless Chromium.

    python tests/campaigns/browser.py [SCENE …] [--pages DIR] [--workers N]

Each page loads without an error and without a request, plays, scrubs, obeys sliders, the pointer
and the keys, fits a phone, and shows bodies where the state has them, within the picture, of which
they fill at least a third in the course of the run; see tests/browser.py. It needs the extra
`browser`, and Chromium.
"""

import argparse
import os
import sys
import tempfile
import time
import traceback
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from browser import check_page, chromium, missing

import eomgen
from eomgen.show.gallery import megabytes
from eomgen.show.page import save_page

SLOWEST_FIRST = (
    "ragdoll walker_motors hanging_figure human_figure stiff_beam quadruped puma560".split()
)


def tried(name: str, folder: Path) -> tuple[bool, str]:
    """Whether the page of a scene does what it must, and a line on it."""
    began = time.monotonic()
    try:
        run = eomgen.simulate(name)
        path = folder / f"{run.model.name}.html"
        save_page(run.motion, run.page(), path)
        made = time.monotonic() - began
        with chromium() as browser:
            found = check_page(browser, path, run)
    except Exception:  # whatever it is, the other scenes are tried
        return False, f"{name}: {traceback.format_exc()}"
    times = f"made in {made:.0f} s, tried in {time.monotonic() - began - made:.0f} s"
    return True, f"{run.model.name}: {megabytes(path.stat().st_size)}; {found}; {times}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", help="files or names (all built-in ones)")
    parser.add_argument("--pages", type=Path, help="keep the pages in this folder")
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    given = parser.parse_args()
    if why := missing():
        print(f"skipped: {why}")
        return 0
    names = given.scenes or sorted(eomgen.built_in_names(), key=lambda n: n not in SLOWEST_FIRST)
    failed = []
    with (
        tempfile.TemporaryDirectory() as temporary,
        ProcessPoolExecutor(given.workers) as pool,
    ):
        folder = given.pages or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        jobs = {pool.submit(tried, name, folder): name for name in names}
        for job in as_completed(jobs):
            good, line = job.result()
            failed += [] if good else [jobs[job]]
            print(line, flush=True)
    print(f"{len(names) - len(failed)} of {len(names)} pages do what they must")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
