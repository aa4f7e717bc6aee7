"""Every built-in scene's page in headless Chromium.

    python tests/campaigns/browser.py [SCENE …] [--pages DIR] [--workers N] [--time S]

Each page loads without an error and without a request, plays, scrubs, obeys sliders, the pointer
and the keys, fits a phone, and shows bodies where the state has them, within the picture, of which
they fill at least a third in the course of the run; see tests/browser.py. It needs the extra
`browser`, and Chromium.
"""

import argparse
import math
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

SLOWEST = "ragdoll walker_motors hanging_figure human_figure stiff_beam quadruped puma560".split()


def tried(name: str, folder: Path, until: float) -> tuple[bool | None, str]:
    """Whether the page of a scene does what it must, and a line on it; None after the time."""
    began = time.monotonic()
    if began > until:
        return None, f"{name}: not tried, the time is over"
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
    parser.add_argument("--time", type=float, default=math.inf, help="start no scene after this, s")
    given = parser.parse_args()
    if why := missing():
        print(f"skipped: {why}")
        return 0
    # What takes longest comes last if not all may be tried, else first.
    limited = math.isfinite(given.time)
    names = given.scenes or sorted(
        eomgen.built_in_names(), key=lambda name: (name in SLOWEST) == limited
    )
    found: dict[str, bool | None] = {}
    until = time.monotonic() + given.time
    with (
        tempfile.TemporaryDirectory() as temporary,
        ProcessPoolExecutor(given.workers) as pool,
    ):
        folder = given.pages or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        jobs = {pool.submit(tried, name, folder, until): name for name in names}
        for job in as_completed(jobs):
            found[jobs[job]], line = job.result()
            print(line, flush=True)
    good, left = (sum(each is x for each in found.values()) for x in (True, None))
    print(
        f"{good} of {len(names)} pages do what they must" + (f", {left} not tried" if left else "")
    )
    return 1 if good + left < len(names) else 0


if __name__ == "__main__":
    sys.exit(main())
