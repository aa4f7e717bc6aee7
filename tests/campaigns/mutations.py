"""Seeded faults in the derivation, and which test catches each.

    python tests/campaigns/mutations.py [--count N] [--seed N] [--only WORD] [TEST …]

A fault flips a sign, drops a term, swaps an index or turns sin into cos, somewhere in what derives
equations, at random. Each is made in a copy of the package, against which the tests run until the
first fails; not those that compare written modules byte for byte, which catch any change. What
survives is shown with its line: either the tests have a hole, or the change means nothing.
"""

import argparse
import ast
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent.parent
ROOMS = (
    "derivation",
    "dynamics",
    "scene/joints",
    "scene/effects",
    "program/differentiate.py",
)
"""What is changed, below the package."""
TESTS = (
    *("test_handout", "test_orthogonal", "test_verify", "test_joints", "test_judges"),
    *("test_springs", "test_contact", "test_impact", "test_closed_projected", "test_identities"),
    *("test_routes", "test_laws", "test_drag", "test_controllers", "test_driven"),
    *("test_field", "test_gravity_variants", "test_effects_published", "test_sensitivity"),
    *("test_linearise", "test_quaternions", "test_pivots", "test_bad_scenes"),
)
"""In the order in which they are run, after those that are named like the changed module."""
LONGEST = 1800.0
"""Seconds for the tests of one fault: a fault that makes them hang is noticed, too."""
SWAPPED = {"sin": "cos", "cos": "sin"}


@dataclass(frozen=True)
class Fault:
    """A change of a module: of which node, in the order of `ast.walk`, and which of its changes."""

    path: Path
    place: int
    change: int

    def made(self) -> tuple[str, int, str]:
        """What was done, on which line, and the changed module."""
        tree = ast.parse(self.path.read_text(encoding="utf-8"))
        node = list(ast.walk(tree))[self.place]
        words, new = list(_changes(node))[self.change]
        line = getattr(node, "lineno", 0)
        _replace(tree, node, new)
        return words, line, ast.unparse(ast.fix_missing_locations(tree))


def faults(path: Path) -> Iterator[Fault]:
    """All faults of a module."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for place, node in enumerate(ast.walk(tree)):
        for change, _ in enumerate(_changes(node)):
            yield Fault(path, place, change)


def _changes(node: ast.AST) -> Iterator[tuple[str, ast.expr]]:
    match node:
        case ast.BinOp(left, ast.Add() | ast.Sub() as op, right) if not _is_text(left, right):
            other: ast.operator = ast.Sub() if isinstance(op, ast.Add) else ast.Add()
            yield "sign flipped", ast.BinOp(left, other, right)
            yield "term dropped", left
        case ast.UnaryOp(ast.USub(), operand) if not isinstance(operand, ast.Constant):
            yield "sign flipped", operand
        case ast.Subscript(value, ast.Constant(int() as index)) if index in (0, 1, 2):
            yield "index swapped", ast.Subscript(value, ast.Constant((index + 1) % 3 % 2))
        case ast.Attribute(value, name) if name in SWAPPED:
            yield f"{name} for {SWAPPED[name]}", ast.Attribute(value, SWAPPED[name], ast.Load())


def _is_text(*sides: ast.expr) -> bool:
    """Whether something is plainly a text or a tuple that is put together."""
    plain = (ast.JoinedStr, ast.Tuple, ast.List)
    return any(
        isinstance(x, plain) or (isinstance(x, ast.Constant) and isinstance(x.value, str))
        for x in sides
    )


def _replace(tree: ast.AST, old: ast.AST, new: ast.expr) -> None:
    for parent in ast.walk(tree):
        for name, value in ast.iter_fields(parent):
            if value is old:
                setattr(parent, name, new)
                return
            if isinstance(value, list) and any(item is old for item in value):
                value[next(i for i, item in enumerate(value) if item is old)] = new
                return


def in_order(tests: list[str], path: Path) -> list[str]:
    """The same files, those first that have a word of the module's path in their names."""
    words = set(re.split(r"[/_.]", str(path.relative_to(ROOT / "eomgen")))) - {"py"}
    return sorted(tests, key=lambda test: words.isdisjoint(re.split(r"[/_.]", test)))


def judged(path: Path, text: str, tests: list[str], folder: Path) -> tuple[str, float]:
    """The first test that fails where a module is another text, or "", and the seconds it took."""
    copy = folder / "copy"
    shutil.rmtree(copy, ignore_errors=True)
    ignored = shutil.ignore_patterns("__pycache__", ".git", ".venv", "out")
    shutil.copytree(ROOT, copy, ignore=ignored)
    (copy / path.relative_to(ROOT)).write_text(text, encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(copy), "EOMGEN_CACHE": str(copy / "store")}
    began = time.monotonic()
    asked = [sys.executable, "-m", "pytest", "-x", "-q", "-n0", "-p", "no:cacheprovider"]
    asked += in_order(tests, path)
    try:
        done = subprocess.run(
            asked, cwd=copy, env=environment, capture_output=True, text=True, timeout=LONGEST
        )
    except subprocess.TimeoutExpired:
        return "hangs", LONGEST
    lines = [x for x in done.stdout.splitlines() if x.startswith(("FAILED", "ERROR"))]
    said = lines[0] if lines else done.stdout[-200:] + done.stderr[-200:]
    return said if done.returncode else "", time.monotonic() - began


def main() -> None:
    """Make faults, try each, and say what caught it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    places = [path for name in TESTS for path in ROOT.glob(f"tests/*/{name}.py")]
    parser.add_argument("tests", nargs="*", default=[str(p.relative_to(ROOT)) for p in places])
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="modules with this in their path")
    given = parser.parse_args()
    package = ROOT / "eomgen"
    paths = sorted(
        path
        for room in ROOMS
        for path in ([package / room] if room.endswith(".py") else (package / room).rglob("*.py"))
        if given.only in str(path.relative_to(ROOT))
    )
    every = [fault for path in paths for fault in faults(path)]
    chosen = random.Random(given.seed).sample(every, min(given.count, len(every)))
    print(f"{len(chosen)} of {len(every)} faults", flush=True)
    survivors = 0
    with tempfile.TemporaryDirectory() as folder:
        for fault in chosen:
            words, line, text = fault.made()
            caught, seconds = judged(fault.path, text, given.tests, Path(folder))
            survivors += not caught
            shown = fault.path.read_text(encoding="utf-8").splitlines()[line - 1].strip()
            print(f"{fault.path.relative_to(ROOT)}:{line}: {words}: {shown}")
            print(f"    {caught or 'SURVIVED'} ({seconds:.0f} s)", flush=True)
    print(f"{len(chosen) - survivors} of {len(chosen)} caught")
    sys.exit(survivors > 0)


if __name__ == "__main__":
    main()
