"""Attacks on the folder of a sweep, any number of them, and what becomes of each.

A flip, a cut, a link, a pipe, an edit, what a killed process leaves: an attack's number determines
it. The sweep then ends with the bytes of one that was left in peace, or is refused in a line; no
file outside its folder changes.
"""

import io
import json
import os
import random
import shutil
import signal
import traceback
import warnings
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

from campaign import Failure

import eomgen.commands.main
import eomgen.run.module
from eomgen.base.text import LONGEST_LINE
from eomgen.commands.main import main

COMMAND = (
    "sweep pendulum --vary theta=0.1:1:3 --vary bob_mass=-1,1 --t-end 0.1 --samples 3 "
    "--outputs kinetic_energy --backend numpy --workers 1"
)
"""Half of the members are refused, so that there are messages."""
NAME = "pendulum_sweep"
LONGEST = 20
"""Time after which an attack counts as a hang, s."""
NOTES = b"precious notes\n" * 9
ODD: tuple[Any, ...] = (
    *(None, True, -1, 1e400, [], {}, "", "0" * 32, "\x1b[31mforged", "\u202e", "a\nb", "x" * 5000),
    *({"0": "\x1b[31mforged"}, {"0": ["forged"]}, {"7": "no such member"}, {"-1": "last"}),
    *({"0": None}, {"a": "b"}, {"0": "forged"}, {"١": "another digit"}, int("9" * 400)),
)
HEADERS = (
    *((b"<f8", b">f8"), (b"<f8", b"<i8"), (b"<f8", b"|O8"), (b"<f8", b"<c8"), (b"|i1", b"|u1")),
    *((b"False", b"True "), (b"(6,", b"(3,"), (b"(6,", b"(9,"), (b"NUMPY", b"numpy")),
    *((b"\x01\x00v", b"\x02\x00v"), (b"'descr'", b"'dexxr'"), (b"{", b"["), (b"shape",
     b"\xff\xfe\xfd\xfc\xfb")),
)  # fmt: skip


def _flip(path: Path, r: random.Random) -> None:
    data = bytearray(path.read_bytes())
    for _ in range(r.choice((1, 1, 1, 3))):
        at = r.randrange(len(data) if r.random() < 0.7 else min(128, len(data)))
        data[at] ^= 1 << r.randrange(8)
    path.write_bytes(data)


def _cut(path: Path, r: random.Random) -> None:
    os.truncate(path, r.randrange(path.stat().st_size))


def _longer(path: Path, r: random.Random) -> None:
    with path.open("ab") as file:
        file.write(r.randbytes(r.choice((1, 8, 4096))))


def _gone(path: Path, r: random.Random) -> None:
    path.unlink()


def _another(path: Path, r: random.Random) -> None:
    others = [other for other in sorted(path.parent.iterdir()) if other.suffix == path.suffix]
    path.write_bytes(r.choice(others).read_bytes())


def _link(path: Path, r: random.Random) -> None:
    path.unlink()
    notes, aside = path.parent.parent / "notes.txt", path.parent.parent / "aside"
    aside.write_bytes(NOTES)
    to = r.choice((notes, aside, path, Path("/dev/zero"), Path("/dev/null"), Path("nowhere")))
    path.symlink_to(to)


def _second_link(path: Path, r: random.Random) -> None:
    """A link to the file itself, which has only moved."""
    moved = path.rename(path.parent.parent / "moved")
    path.symlink_to(moved) if r.random() < 0.5 else os.link(moved, path)


def _hard_link(path: Path, r: random.Random) -> None:
    path.unlink()
    os.link(path.parent.parent / "notes.txt", path)


def _pipe(path: Path, r: random.Random) -> None:
    path.unlink()
    r.choice((os.mkfifo, os.mkdir))(path)


def _edit(path: Path, r: random.Random) -> None:
    """Other values in a description; other words in a header."""
    data = path.read_bytes()
    if path.suffix == ".npy":
        old, new = r.choice(HEADERS)
        path.write_bytes(data.replace(old, new))
        return
    try:
        about = json.loads(data)
        key = r.choice(sorted(about))
    except ValueError:  # an attack before this one has damaged it
        return
    about[key] = r.choice(ODD)
    if r.random() < 0.2:
        about[r.choice(("more", "digest", "messages"))] = r.choice(ODD)
    if r.random() < 0.1:
        about = r.choice(ODD)
    text = json.dumps(about).replace("Infinity", r.choice(("1e999", "NaN", "9" * 5000)))
    path.write_text("[" * 100_000 if r.random() < 0.03 else text)


def _left_over(path: Path, r: random.Random) -> None:
    """What a process that is killed at the start, or later, leaves."""
    if r.random() < 0.5:
        shutil.rmtree(path.parent)
        path.parent.mkdir()
    (path.parent / f".{path.name}.{r.randbytes(6).hex()}").write_bytes(b"half a li")


def _whole_folder(path: Path, r: random.Random) -> None:
    moved = path.parent.rename(path.parent.with_name("moved"))
    kinds: list[Callable[[], object]] = [
        lambda: path.parent.symlink_to(moved),
        lambda: path.parent.symlink_to("nowhere"),
        lambda: path.parent.write_bytes(NOTES),
        lambda: os.mkfifo(path.parent),
        lambda: (path.parent / "inside").mkdir(parents=True),
    ]
    r.choice(kinds)()


ATTACKS = (
    *(_flip, _flip, _flip, _cut, _longer, _gone, _another, _link, _second_link, _hard_link, _pipe),
    *(_edit, _edit, _left_over, _whole_folder),
)


def kept(place: Path) -> bytes:
    """Run the sweep in a new folder, and return its table."""
    assert _run(place) == (0, "")
    return (place / f"{NAME}.csv").read_bytes()


def outcome(place: Path, number: int) -> str:
    """Attack the folder of a sweep, in a folder for all attacks: the first of them and what came of
    it, 'mended' or 'refused'. Raises `Failure` for anything else.
    """
    if not (place / "whole").exists():
        kept(place / "whole")
    table = (place / "whole" / f"{NAME}.csv").read_bytes()
    r = random.Random(number)
    out = place / "attacked"
    shutil.rmtree(out, ignore_errors=True)
    shutil.copytree(place / "whole", out)
    (out / f"{NAME}.csv").unlink()
    (out / "notes.txt").write_bytes(NOTES)
    attacks = []
    for _ in range(r.choice((1, 1, 1, 2))):
        folder = out / NAME
        files = [] if folder.is_symlink() else sorted(p for p in folder.glob("*"))
        files = [p for p in files if p.is_file() and p.stat().st_size]
        if all(not p.is_symlink() and p.stat().st_nlink == 1 for p in files) and files:
            attack = r.choice(ATTACKS)
            attack(r.choice(files), r)
            attacks.append(attack.__name__.strip("_"))
    outside = _outside(out)
    try:
        code, said = _run(out)
    except BaseException:
        raise Failure(f"{attacks}: {traceback.format_exc()}") from None
    lines = said.splitlines()
    made = out / f"{NAME}.csv"
    refused = code == 1 and len(lines) == 1 and lines[0].startswith("eomgen: ")
    same = code == 0 and not lines and made.read_bytes() == table and _sound(out / NAME, place)
    plain = said.replace("\n", "").isprintable() and len(said) < 2 * LONGEST_LINE
    if not ((refused or same) and plain and _outside(out) == outside):
        raise Failure(f"{attacks}: {code} {said!r}")
    return f"{attacks[0]} {'refused' if refused else 'mended'}"


def _sound(folder: Path, place: Path) -> bool:
    """Whether arrays and chunks have the bytes of the sweep that was left in peace."""
    whole = place / "whole" / NAME
    names = [path.name for path in whole.iterdir() if path.name != "sweep.json"]
    return all((folder / name).read_bytes() == (whole / name).read_bytes() for name in names)


def _outside(out: Path) -> dict[str, bytes]:
    """What must not change: files beside the folder of the sweep."""
    names = ("notes.txt", "aside", "moved")
    return {name: (out / name).read_bytes() for name in names if (out / name).is_file()}


def _run(out: Path) -> tuple[int, str]:
    """The exit code of the sweep without its figure, and what it says as an error."""
    stderr = io.StringIO()
    with (
        redirect_stderr(stderr),
        redirect_stdout(io.StringIO()),
        warnings.catch_warnings(),
        patch("eomgen.show.sweep.save_sweep_figure"),
        patch("eomgen.commands.main.parsers", _parsers),  # these two take most of the time
        patch("eomgen.run.module.load_source", _load_source),
    ):
        warnings.simplefilter("error")
        signal.signal(signal.SIGALRM, _hangs)
        signal.alarm(LONGEST)
        try:
            code = main([*COMMAND.split(), "-o", str(out)])
        finally:
            signal.alarm(0)
    return code, stderr.getvalue()


_parsers, _load_source = cache(eomgen.commands.main.parsers), cache(eomgen.run.module.load_source)


def _hangs(*_: object) -> None:
    raise AssertionError("it hangs")
