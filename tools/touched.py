"""Run the tests of what has changed: python tools/touched.py [--base REV] [an option of pytest ...]

What has changed is what git does not have in REV (HEAD), uncommitted and new files included. A file
of a package runs the folder of tests of that package; a module that tests share runs the files that
import it; docs and the README run those of the project, which check the structure in any case.
"""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
TESTS = ROOT / "tests"
PLACES = {
    "eomgen/scene/effects": "effects",
    "eomgen/commands": "api",
    "eomgen/engine": "native run subset",
    "eomgen/model": "scene",
    "eomgen/scalars": "program",
    "eomgen/scenes": "codegen",
    "templates/c": "native",
    "templates/derivation": "derivation",
    "templates/fmu": "exports",
    "templates/gallery": "show",
    "templates/javascript": "show",
    "templates/matlab": "exports",
    "templates/page": "show",
    "templates": "codegen",
    "generated": "codegen",
}
"""Folders whose tests have other names, the inner ones first."""


def changed(base: str) -> list[str]:
    """The paths of all files that differ from a revision, and of new ones."""
    found: list[str] = []
    for words in (["diff", "--name-only", base], ["ls-files", "-o", "--exclude-standard"]):
        done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True)
        found += done.stdout.splitlines()
    return found


def tests_of(path: str) -> set[Path]:
    """The folders and files of tests for a file."""
    parts = Path(path).parts
    for folder, name in PLACES.items():
        if path.startswith(f"{folder}/"):
            return {TESTS / each for each in name.split()}
    if parts[0] == "eomgen":
        folder = TESTS / parts[1]
        return {folder} if folder.is_dir() else {TESTS / "api"}
    if parts[0] in ("tests", "tools") and path.endswith(".py"):
        if parts[-1].startswith("test_"):
            return {ROOT / path} if (ROOT / path).exists() else set()
        name = re.compile(rf"^(from|import) {Path(path).stem}\b", re.MULTILINE)
        every = TESTS.glob("*/test_*.py")
        return {file for file in every if name.search(file.read_text("utf-8"))}
    return set()


def main(words: list[str]) -> int:
    """Find them, and run them."""
    base = "HEAD"
    if words[:1] == ["--base"]:
        base, words = words[1], words[2:]
    found = {TESTS / "project"}.union(*map(tests_of, changed(base)))
    kept = sorted(p for p in found if not any(parent in found for parent in p.parents))
    command = ["pytest", *words, *(str(path.relative_to(ROOT)) for path in kept)]
    print(*command, flush=True)
    return subprocess.run([sys.executable, "-m", *command], cwd=ROOT).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
