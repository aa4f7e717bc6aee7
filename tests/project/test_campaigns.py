"""Campaigns and benchmarks, which no test runs, find what they import of the tests."""

import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parent.parent
IMPORTED = """
import os, runpy, sys
given = list(sys.path)
for path in sys.argv[1:]:
    folder = os.path.dirname(path)
    tests = os.path.join(os.path.dirname(folder), "")
    sys.path.insert(0, folder)  # as for a script
    try:
        runpy.run_path(path, run_name="imported")
    except ModuleNotFoundError as error:  # an extra may be missing
        print(path, error.name)
    sys.path[:] = given
    for name, module in list(sys.modules.items()):
        # A checkout may be in a folder of that name, with its environment inside.
        if str(getattr(module, "__file__", "")).startswith(tests):
            del sys.modules[name]
"""


@pytest.mark.apart
def test_they_find_what_they_import() -> None:
    paths = [str(p) for room in ("campaigns", "benchmarks") for p in (TESTS / room).glob("*.py")]
    asked = [sys.executable, "-c", IMPORTED, *sorted(paths)]
    done = subprocess.run(asked, cwd=TESTS.parent, capture_output=True, text=True, check=True)
    ours = {path.stem for path in TESTS.rglob("*.py")}
    assert [line for line in done.stdout.splitlines() if line.split()[1] in ours] == []
