"""The page's mechanism and engine run by node, for tests and benchmarks."""

import json
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from shutil import which
from typing import Any

from eomgen.engine.printed import steps_of_pages

PAGE = Path(__file__).parent.parent / "templates" / "page"
SHARED = ("../javascript/contacts.js", "../javascript/loops.js")
ENGINE = ("methods.js", "adaptive.js", *SHARED, "contacts.js", "loops.js", "engine.js")
NODE = which("node")


def run_in_node(
    source: str,
    script: str,
    given: Any = None,
    seconds: float = 300,
    *,
    scripts: Sequence[str] = ENGINE,
) -> Any:
    """What the body `script` of a function returns in node, through JSON, which has null for nan.

    `source` defines `mechanism`; the script may use it, what the `scripts` of the page define, by
    default `makeEngine`, and `given`.
    """
    parts = [
        '"use strict";',
        source,
        steps_of_pages(),
        *((PAGE / name).read_text("utf-8") for name in scripts),
        "const given = JSON.parse(require('fs').readFileSync(0, 'utf8'));",
        f"process.stdout.write(JSON.stringify((() => {{\n{script}\n}})()));",
    ]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "page.js"
        path.write_text("\n".join(parts), "utf-8")
        done = subprocess.run(
            [str(NODE), str(path)],
            input=json.dumps(given),
            capture_output=True,
            text=True,
            timeout=seconds,
            check=False,
        )
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout)
