"""A hundred faults all over the program, and which test catches each.

    python tests/campaigns/seeded_faults.py [--list] [--first N] [--last N] [--log FILE]
        [--near | --before REV] [--count N] [--seed N] [--only WORD]

A fault is one change in one place: a sign, a dropped term, < for <=, a condition turned round, a
constant or an index that is off by one, sin for cos. The packages and the folders of templates get
as many as they have lines. Each is made in a copy of the project. There run the tests that
`tools/touched.py` names for the changed file, then the others, until one fails; a run that takes
more than LONGEST processor time counts as caught, too. What is not caught is shown with its line:
the tests have a hole there, or the change means nothing.

`--only`: faults in files that have this in their path, such as `eomgen/d` for the derivation and
what it derives from. `--near`: only the tests of the changed package run; what they miss is left
for another call. `--before`: where the tests as they stand catch nothing, the cases run that this
revision's tests have and they have not. A log has a line of JSON for each fault; faults that have
theirs are not tried again, so a campaign can be stopped and continued.
"""

import argparse
import ast
import json
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent.parent
sys.path.insert(0, str(ROOT / "tools"))

from touched import tests_of  # noqa: E402

LONGEST, SLOWEST = 900, 3600.0
"""Seconds of processor time, and of time, for one run of tests: beyond them it hangs."""
COMPARED = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
CALLED = {"sin": "cos", "cos": "sin", "min": "max", "max": "min", "any": "all", "all": "any"}
IN_TEMPLATES = (
    (r" < ", " <= "),
    (r" <= ", " < "),
    (r" > ", " >= "),
    (r" >= ", " > "),
    (r" \+ ", " - "),
    (r" - ", " + "),
    (r" && ", " || "),
    (r" \|\| ", " && "),
    (r" === ", " !== "),
    (r" == ", " != "),
    (r"(?<=[\[( ])0(?=[\]);, ])", "1"),
    (r"(?<=[\[( ])1(?=[\]);, ])", "2"),
    (r"\bsin\(", "cos("),
    (r"\bcos\(", "sin("),
    (r"(?<== )-(?=\w)", ""),
)
"""What is found in a line of a template, and what is put there."""


@dataclass(frozen=True)
class Fault:
    """Some characters of a file, from one place to another, that become others."""

    path: Path
    start: int
    end: int
    new: str
    what: str

    @property
    def line(self) -> int:
        return self.path.read_text("utf-8").count("\n", 0, self.start) + 1

    def made(self) -> str:
        """The text of the changed file."""
        text = self.path.read_text("utf-8")
        return text[: self.start] + self.new + text[self.end :]

    def told(self) -> str:
        """Where it is, what it is, and the line before and after."""
        k = self.line - 1
        old, new = self.path.read_text("utf-8").splitlines(), self.made().splitlines()
        where = f"{self.path.relative_to(ROOT)}:{self.line}"
        return f"{where}: {self.what}: {old[k].strip()}  ->  {new[k].strip()}"


# In Python.


def faults_of_python(path: Path) -> Iterator[Fault]:
    """All faults of a module: not in texts, docstrings, annotations and imports."""
    text = path.read_text("utf-8")
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))

    def place(row: int, column: int) -> int:
        line = text[starts[row - 1] : starts[row]]
        return starts[row - 1] + len(line.encode()[:column].decode())

    for node in _code(ast.parse(text)):
        for what, new in _changes(node):
            start = place(node.lineno, node.col_offset)
            end = place(node.end_lineno or 0, node.end_col_offset or 0)
            # Brackets keep what is around the node as it was.
            yield Fault(path, start, end, f"({ast.unparse(new)})", what)


def _code(node: ast.AST) -> Iterator[ast.expr]:
    """The expressions that are computed, from the outside inwards."""
    if isinstance(node, ast.expr):
        yield node
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "bases") or (
            isinstance(node, ast.JoinedStr)
            or (isinstance(node, ast.Subscript) and _is_type(node))
            or (isinstance(node, ast.Assign) and _is_name_list(node))
        ):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from _code(child)


def _is_type(node: ast.Subscript) -> bool:
    return isinstance(node.value, ast.Name) and node.value.id[:1].isupper()


def _is_name_list(node: ast.Assign) -> bool:
    return any(isinstance(x, ast.Name) and x.id == "__all__" for x in node.targets)


def _changes(node: ast.expr) -> Iterator[tuple[str, ast.expr]]:
    match node:
        case ast.BinOp(left, ast.Add() | ast.Sub() as op, right) if not _is_text(left, right):
            other: ast.operator = ast.Sub() if isinstance(op, ast.Add) else ast.Add()
            yield "sign flipped", ast.BinOp(left, other, right)
            yield "term dropped", left
        case ast.BinOp(left, ast.Mult(), right) if not _is_text(left, right):
            yield "factor dropped", left
        case ast.UnaryOp(ast.USub(), operand) if not isinstance(operand, ast.Constant):
            yield "sign flipped", operand
        case ast.UnaryOp(ast.Not(), operand):
            yield "not dropped", operand
        case ast.Compare(left, [op], [right]) if type(op) in COMPARED:
            new = ast.Compare(left, [COMPARED[type(op)]()], [right])
            yield "comparison changed", new
        case ast.BoolOp(op, values):
            swapped: ast.boolop = ast.Or() if isinstance(op, ast.And) else ast.And()
            yield "and for or", ast.BoolOp(swapped, values)
            yield "condition dropped", ast.BoolOp(op, values[:-1]) if values[2:] else values[0]
        case ast.IfExp(test, body, orelse):
            yield "branches swapped", ast.IfExp(test, orelse, body)
        case ast.Constant(bool() as value):
            yield "truth turned round", ast.Constant(not value)
        case ast.Constant(int() as value):
            yield "off by one", ast.Constant(value + 1)
        case ast.Constant(float() as value) if value == value:
            yield "constant changed", ast.Constant(2.0 * value if value else 1.0)
        case ast.Call(ast.Name(name), args, keywords) if name in CALLED:
            yield "function swapped", ast.Call(ast.Name(CALLED[name]), args, keywords)
        case ast.Call(ast.Attribute(value, name), args, keywords) if name in CALLED:
            called = ast.Attribute(value, CALLED[name], ast.Load())
            yield "function swapped", ast.Call(called, args, keywords)


def _is_text(*sides: ast.expr) -> bool:
    """Whether something is plainly a text or a list that is put together."""
    plain = (ast.JoinedStr, ast.Tuple, ast.List, ast.ListComp)
    return any(
        isinstance(x, plain) or (isinstance(x, ast.Constant) and isinstance(x.value, str))
        for x in sides
    )


# In templates.


def faults_of_template(path: Path) -> Iterator[Fault]:
    """Those of its lines that are no comment."""
    start, within = 0, False
    for line in path.read_text("utf-8").splitlines(keepends=True):
        code = line.strip()
        within = within or code.startswith(("/*", "{#", '"""'))
        if not within and not code.startswith(("//", "*", "#", "%", "<")):
            ends = min((line.find(x) for x in ("//", "/*", "{#") if x in line), default=len(line))
            for pattern, new in IN_TEMPLATES:
                for found in re.finditer(pattern, line[:ends]):
                    what = f"{found[0].strip() or found[0]} becomes {new.strip() or 'nothing'}"
                    yield Fault(path, start + found.start(), start + found.end(), new, what)
        within = within and not code.endswith(("*/", "#}", '"""'))
        start += len(line)


# Which of them.


def chosen(count: int, seed: int, only: str = "") -> list[Fault]:
    """Faults at random, of each package and folder of templates by the number of its lines, of
    files with a word in their path; in an order that mixes the packages.
    """
    rooms: dict[str, list[Path]] = {}
    for pattern in ("eomgen/**/*.py", "templates/**/*.j*"):
        for path in sorted(ROOT.glob(pattern)):
            parts = path.relative_to(ROOT).parts
            if "vendor" not in parts and only in "/".join(parts):
                rooms.setdefault("/".join(parts[:2]) if parts[2:] else parts[0], []).append(path)
    every = {room: [f for path in paths for f in faults_of(path)] for room, paths in rooms.items()}
    lines = {r: sum(len(p.read_text("utf-8").splitlines()) for p in ps) for r, ps in rooms.items()}
    shares = {room: count * lines[room] / sum(lines.values()) for room in rooms}
    taken = {room: int(share) for room, share in shares.items()}
    largest = sorted(rooms, key=lambda room: taken[room] - shares[room])
    for room in largest[: count - sum(taken.values())]:
        taken[room] += 1
    rng = random.Random(seed)
    found = [f for room in sorted(rooms) for f in rng.sample(every[room], taken[room])]
    rng.shuffle(found)
    return found


def faults_of(path: Path) -> Iterable[Fault]:
    return faults_of_python(path) if path.suffix == ".py" else faults_of_template(path)


# Trying one.


@dataclass(frozen=True)
class Copy:
    """A copy of the project, and of tests of before if any, in a folder of its own."""

    folder: Path
    before: str

    @property
    def root(self) -> Path:
        return self.folder / "copy"

    @property
    def old(self) -> Path:
        """The copy with the tests of before."""
        return self.folder / "old"

    def make(self) -> None:
        """All files that git knows, in repositories of their own: some tests ask for these."""
        names = _output("git", "ls-files", "-co", "--exclude-standard").splitlines()
        for place in (self.root, self.old) if self.before else (self.root,):
            for name in names:
                if (ROOT / name).is_file():
                    (place / name).parent.mkdir(parents=True, exist_ok=True)
                    shutil.copy(ROOT / name, place / name)
        if self.before:
            shutil.rmtree(self.old / "tests")
            packed = subprocess.Popen(
                ["git", "archive", self.before, "tests", "pyproject.toml"],
                cwd=ROOT,
                stdout=subprocess.PIPE,
            )
            subprocess.run(["tar", "x"], cwd=self.old, stdin=packed.stdout, check=True)
        for place in (self.root, self.old) if self.before else (self.root,):
            _output("git", "init", "-q", cwd=place)
            _output("git", "add", "-A", cwd=place)

    def put(self, fault: Fault, text: str) -> None:
        """Write a text in place of the changed file, and forget what was compiled of it."""
        for place in (self.root, self.old) if self.before else (self.root,):
            path = place / fault.path.relative_to(ROOT)
            path.write_text(text, "utf-8")
            for made in (path.parent / "__pycache__").glob(f"{path.stem}.*"):
                made.unlink()

    def caught(self, root: Path, tests: list[str]) -> tuple[str, float]:
        """The first test that fails, or "", and the seconds of processor time that it took."""
        asked = [sys.executable, "-m", "pytest", "-x", "-n0", "-p", "no:cacheprovider"]
        asked += [f"--basetemp={self.folder / 'temp'}", "--tb=no", "-rfE", *tests]
        began, code = sum(os.times()[2:4]), -1
        with (self.folder / "said").open("w+") as said:
            process = subprocess.Popen(
                asked,
                cwd=root,
                env=_environment(root),
                stdout=said,
                stderr=said,
                start_new_session=True,
                preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (LONGEST, LONGEST)),
            )
            with suppress(subprocess.TimeoutExpired):
                code = process.wait(SLOWEST)
            with suppress(ProcessLookupError):  # what it has started and left
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            said.seek(0)
            text = said.read()
        seconds = sum(os.times()[2:4]) - began
        if code in (0, 5):  # 5: nothing was collected
            return "", seconds
        if code == 4:
            raise SystemExit(f"pytest does not know these tests: {text[-300:]}")
        lines = [x for x in text.splitlines() if x.startswith(("FAILED", "ERROR"))]
        if lines:
            return lines[0].split(" - ")[0], seconds
        return ("hangs" if code < 0 else text[-300:].strip()), seconds

    def removed(self) -> list[str]:
        """The cases of the tests of before that those of now have not, or try in another way."""
        (had, old), (have, new) = ((_collected(r), _written(r)) for r in (self.old, self.root))
        same = set(have)

        def is_gone(name: str) -> bool:
            test = name.partition("[")[0]
            return name not in same or old[test] != new[test]

        return list(filter(is_gone, had))


def _output(*words: str, cwd: Path = ROOT) -> str:
    return subprocess.run(words, cwd=cwd, capture_output=True, text=True, check=True).stdout


def _collected(root: Path) -> list[str]:
    words = [sys.executable, "-m", "pytest", "--collect-only", "-n0", "-p", "no:cacheprovider"]
    found = subprocess.run(words, cwd=root, env=_environment(root), capture_output=True, text=True)
    return [line for line in found.stdout.splitlines() if "::" in line]


def _written(root: Path) -> dict[str, str]:
    """Each test as it is written, without its decorators."""
    found = {}
    for path in sorted((root / "tests").glob("*/test_*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
                node.decorator_list.clear()
                found[f"{path.relative_to(root)}::{node.name}"] = ast.dump(node)
    return found


def _environment(root: Path) -> dict[str, str]:
    """That of a process that runs the copy, all of whose byte code is kept."""
    left = ("FULL", "PYTHONDONTWRITEBYTECODE")
    env = {k: v for k, v in os.environ.items() if not k.startswith("PYTEST") and k not in left}
    return {**env, "PYTHONPATH": str(root), "EOMGEN_CACHE": str(root.parent / "store")}


def judged(fault: Fault, made: Copy, gone: list[str], near_only: bool) -> dict[str, object]:
    """What catches a fault: of the tests that are named for it, of all others, of those of before
    that are left out now.
    """
    known = (ROOT / "tests" / "project", *tests_of(str(fault.path.relative_to(ROOT))))
    near = sorted(str(p.relative_to(ROOT)) for p in known)
    folders = sorted(str(p.relative_to(ROOT)) for p in {f.parent for f in _files()})
    far = [folder for folder in folders if folder not in near]
    said = {"stage": "no", "by": "", "seconds": 0.0}
    made.put(fault, fault.made())
    try:
        # The smaller folder comes first: that of a package is seldom larger than all others.
        stages = [("touched", made.root, [name]) for name in sorted(near, key=_project_last)]
        if near_only:
            stages = stages[: len(near) - 1]
        else:
            stages += [("others", made.root, [name]) for name in far]
            stages += [("before", made.old, gone)] if gone else []
        for stage, root, tests in stages:
            by, seconds = made.caught(root, tests)
            said["seconds"] = round(float(str(said["seconds"])) + seconds, 1)
            if by:
                return {**said, "stage": stage, "by": by}
    finally:
        made.put(fault, fault.path.read_text("utf-8"))
    return said


def _project_last(name: str) -> tuple[bool, str]:
    return name.endswith("project"), name


def _files() -> list[Path]:
    return sorted((ROOT / "tests").glob("*/test_*.py"))


def main() -> int:
    """Make faults, try each, and say what caught it; 1 if one is not caught."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--list", action="store_true", help="show them, and try none")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--last", type=int, default=10**9)
    parser.add_argument("--log", type=Path, default=Path("seeded_faults.jsonl"))
    parser.add_argument("--near", action="store_true")
    parser.add_argument("--before", default="", metavar="REV")
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", metavar="WORD")
    given = parser.parse_args()
    faults = chosen(given.count, given.seed, given.only)
    if given.list:
        for k, fault in enumerate(faults):
            print(f"{k}: {fault.told()}")
        return 0
    done = {}
    if given.log.exists():
        done = {x["fault"]: x for x in map(json.loads, given.log.read_text().splitlines())}
    with tempfile.TemporaryDirectory() as folder:
        made = Copy(Path(folder).resolve(), given.before)
        made.make()
        gone = made.removed() if given.before else []
        print(f"{len(gone)} cases of before are left out now", flush=True)
        for k, fault in list(enumerate(faults))[given.first : given.last + 1]:
            if k in done:
                continue
            done[k] = {"fault": k, "what": fault.told(), **judged(fault, made, gone, given.near)}
            if str(done[k]["by"]).startswith(("FAILED", "ERROR")):
                root = made.old if done[k]["stage"] == "before" else made.root
                if made.caught(root, [str(done[k]["by"]).split(" ", 1)[1]])[0]:
                    raise SystemExit(f"without a fault as well: {done[k]['by']}")
            if given.near and done[k]["stage"] == "no":
                print(f"{k}: {fault.told()}\n    not near", flush=True)
                del done[k]
                continue
            with given.log.open("a") as log:
                print(json.dumps(done[k]), file=log)
            print(f"{k}: {fault.told()}\n    {done[k]['stage']}: {done[k]['by']}", flush=True)
    stages = [x["stage"] for x in done.values()]
    now, before = (sum(map(stages.count, names)) for names in (["touched", "others"], ["before"]))
    print(f"of {len(stages)} faults: caught {now}; by tests of before as well {now + before}")
    return int(now < len(stages))


if __name__ == "__main__":
    sys.exit(main())
