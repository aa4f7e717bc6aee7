"""Hostile files, any number of them, and what becomes of each.

A scene's file comes from a built-in scene by changes of its tree (types, keys, numbers, nesting),
of its text (`fuzzing`) or of its bytes; an archive comes from one that a run wrote, by changes of
its bytes or of its members. A file's number determines all of it.
"""

import io
import json
import random
import re
import tempfile
import tomllib
import traceback
import warnings
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from functools import cache
from pathlib import Path
from typing import Any

import fuzzing
import numpy as np
from campaign import Failure
from fuzzing import no_hang

from eomgen.base.errors import EomgenError, RunError
from eomgen.base.text import LONGEST_LINE
from eomgen.commands.main import main
from eomgen.run.trajectory import load_npz

MOST_MEMORY = 300_000
"""Thousands of bytes by which one file may let the process grow."""
ODD_TEXTS = (
    *("", " ", "\x1b[2J", "a\neomgen: forged", "\u202egnp\u2028", "\x9b2J\x07", "k" * 50_000),
    *("world", "input", "t", "A", "1/0", "x" * 41, "__class__", "9" * 5000, "(" * 500, "é", "\0"),
)
ODD_NUMBERS = (
    *(0, -1, 10**400, -(10**30), 2**1023, 10**4299, 1e308, -1e-320, 5e-324, -0.0, 1e16, 3),
    *(float("inf"), float("-inf"), float("nan")),
)
SCENES, ARCHIVES = "scene", "archive"


# Scenes.


def scene_file(number: int) -> bytes:
    """The bytes of the scene's file of a number."""
    r = random.Random(f"scene {number}")
    text = fuzzing.scene(number) if r.random() < 0.3 else _changed_tree(r)
    data = text.encode("utf-8", "surrogatepass")
    return _changed_bytes(data, r) if r.random() < 0.3 else data


def _changed_tree(r: random.Random) -> str:
    tree = tomllib.loads(r.choice(fuzzing.texts()))
    for _ in range(r.choice((1, 1, 2, 5))):
        places = list(_places(tree))
        parent, key = r.choice(places)
        match r.randrange(5):
            case 0:
                del parent[key]
            case 1 if isinstance(parent, dict):
                parent[r.choice(ODD_TEXTS)] = parent.pop(key)
            case 2 if isinstance(parent, list):
                parent += [parent[key]] * r.choice((1, 2, 3, 50))
            case 3:
                other, at = r.choice(places)
                parent[key] = json.loads(json.dumps(other[at])) if at in other else {}
            case _:
                parent[key] = _odd(r)
    return "".join(f"{_toml(key)} = {_toml(value)}\n" for key, value in tree.items())


def _places(tree: Any) -> Any:
    """Every table or list of a tree with each of its keys."""
    entries = tree.items() if isinstance(tree, dict) else enumerate(tree)
    for key, value in list(entries):
        yield tree, key
        if isinstance(value, dict | list):
            yield from _places(value)


def _odd(r: random.Random) -> Any:
    value: Any = r.choice((r.choice(ODD_TEXTS), r.choice(ODD_NUMBERS), True, [], {}))
    for _ in range(r.choice((0, 0, 0, 1, 2, 10, 60))):
        value = [value] if r.random() < 0.5 else {r.choice(("a", "type", "name", "\x1b")): value}
    return [value] * r.choice((1, 2, 3, 5, 50, 5000)) if r.random() < 0.1 else value


def _toml(value: Any) -> str:
    """A value in TOML, all in one line."""
    match value:
        case dict():
            entries = (f"{_toml(str(key))} = {_toml(entry)}" for key, entry in value.items())
            return "{" + ", ".join(entries) + "}"
        case list():
            return "[" + ", ".join(map(_toml, value)) + "]"
        case str():
            text = json.dumps(value, ensure_ascii=not value.isprintable())
            return text.replace("\x7f", "\\u007f")
        case bool():
            return str(value).lower()
        case _:
            return repr(value)


def _changed_bytes(data: bytes, r: random.Random) -> bytes:
    for _ in range(r.choice((1, 1, 3, 20))):
        at = r.randrange(len(data) + 1)
        match r.randrange(6):
            case 0:
                data = data[:at]
            case 1:
                data = data[:at] + r.randbytes(r.choice((1, 2, 50))) + data[at:]
            case 2:
                data = (
                    data[:at] + bytes([data[at] ^ 1 << r.randrange(8)]) + data[at + 1 :]
                    if (at < len(data))
                    else data
                )
            case 3:
                data = data[at:] + data[:at]
            case 4:
                data = data.replace(b"\n", r.choice((b"\r\n", b"\r", b"\0\n")))
            case _:
                piece = data[at : at + r.randrange(1, 80)] or r.choice((b"[", b"{a=", b"a.", b'"'))
                data = data[:at] + piece * r.choice((2, 10, 2000)) + data[at:]
    return data


# Archives.


def archive_file(number: int, whole: bytes) -> bytes:
    """The bytes of an archive of a number, made of one that a run wrote."""
    r = random.Random(f"archive {number}")
    data = whole
    if r.random() < 0.5:
        with np.load(io.BytesIO(whole)) as archive:
            members: dict[str, Any] = dict(archive)
        for _ in range(r.choice((1, 1, 3))):
            _change_member(members, r)
        data = _archive(members, r)
        if r.random() < 0.7:
            return data
    flips = bytearray(data)
    for _ in range(r.choice((1, 1, 1, 8, 100))):
        near_the_end = r.random() < 0.5  # where the members are listed, without a checksum
        at = r.randrange(max(0, len(flips) - 1500) if near_the_end else 0, len(flips))
        flips[at] ^= 1 << r.randrange(8)
    return bytes(flips if r.random() < 0.9 else flips[: r.randrange(len(flips))])


def _change_member(members: dict[str, Any], r: random.Random) -> None:
    name = r.choice([*members, "t", "y", "resume_t", "resume_y", "resume_x"])
    array = members.get(name, np.zeros(2))
    odd = ("text", "\x1b[2J", "k" * 999, 1j, np.nan, np.inf, -1, True)
    shapes = ((), (0,), (2,), (3, 3), (1001, 2), (1, 1, 1))
    kinds = [
        *(np.array(value) for value in odd),
        *(np.zeros(shape) for shape in shapes),
        array.astype(object) if array.size < 9 else array[..., :1],
        array.astype("S5") if array.dtype.kind == "U" else array.astype(complex),
        array[::-1] if array.ndim else array.reshape(-1),
        array != array,
    ]
    match r.randrange(4):
        case 0:
            members.pop(name, None)
        case 1:
            members[r.choice(("resume_", "../x", "\x1b", "digest", "eomgen2", "resume_a"))] = array
        case _:
            members[name] = kinds[r.randrange(len(kinds))]


def _archive(members: dict[str, Any], r: random.Random) -> bytes:
    """An archive, sometimes packed, and sometimes with a header that is not the content's."""
    buffer = io.BytesIO()
    packed = zipfile.ZIP_DEFLATED if r.random() < 0.1 else zipfile.ZIP_STORED
    lie = r.choice([*members]) if r.random() < 0.2 else None
    with zipfile.ZipFile(buffer, "w", packed) as archive:
        for name, array in members.items():
            file = io.BytesIO()
            np.lib.format.write_array(file, np.asanyarray(array), allow_pickle=True)
            content = file.getvalue()
            if name == lie:
                begin = content.index(b"'shape': ")
                end = content.index(b"}", begin)
                shape = r.choice((b"(1000000000,)", b"(-1,)", b"(10**9,)", b"()", b"(0, 9**9)"))
                header = (b"'shape': " + shape).ljust(end - begin)
                content = content[:begin] + header + content[end:]
            archive.writestr(f"{name}.npy", content)
    return buffer.getvalue()


# What comes of them.


@cache
def _base() -> bytes:
    """The archive of a run."""
    with tempfile.TemporaryDirectory() as folder:
        code, said = _reported(["simulate", "pendulum", "--t-end", "0.1", "-o", folder])
        if code:
            raise Failure(said)
        return (Path(folder) / "pendulum.npz").read_bytes()


def outcome(kind: str, folder: Path, number: int) -> str:
    """'refused' or 'taken'. Raises `Failure` for anything else."""
    path = folder / f"hostile.{'toml' if kind == SCENES else 'npz'}"
    path.write_bytes(scene_file(number) if kind == SCENES else archive_file(number, _base()))
    before = _peak(anew=True)
    code = _reported(["check", str(path)])[0] if kind == SCENES else _loaded(path)
    grown = _peak() - before
    if grown > MOST_MEMORY:
        raise Failure(f"takes {grown} kB")
    if code not in (0, 1):
        raise Failure(f"exit code {code}")
    return "taken" if code == 0 else "refused"


def _peak(*, anew: bool = False) -> int:
    """The most memory that this process had, kB; `anew` counts from now on."""
    if anew:
        Path("/proc/self/clear_refs").write_text("5")
    status = Path("/proc/self/status").read_text()
    return int(re.search(r"VmHWM:\s*(\d+)", status)[1])  # type: ignore[index]


def _loaded(path: Path) -> int:
    """0 if an archive is read, or 1. Raises `Failure` for all but one line of a message."""
    try:
        with _watched():
            load_npz(path)
    except RunError as error:
        if not (str(error).isprintable() and str(error).startswith(f"{path}: is ")):
            raise Failure(f"a message that is none: {str(error)[:200]!r}") from None
        return 1
    return 0


@contextmanager
def _watched() -> Iterator[None]:
    """Raises `Failure` for what is no message, a warning too, and for what hangs."""
    try:
        with no_hang(), warnings.catch_warnings(record=True, action="always") as warned:
            yield
        if warned:
            raise Failure(f"warns: {warned[0].message}")
    except (Failure, EomgenError):
        raise
    except BaseException as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        text = f"{type(error).__name__} at {where.filename}:{where.lineno}: {error}"
        raise Failure(text[:300]) from error


def _reported(command: list[str]) -> tuple[int, str]:
    """The exit code of a command and its messages. Raises `Failure` for what it must not print."""
    # Of an encoding that has every letter: others are spelled, which may take more room.
    out, err = (io.TextIOWrapper(io.BytesIO(), "utf-8", newline="\n") for _ in range(2))
    with _watched(), redirect_stdout(out), redirect_stderr(err):
        code = main(command)
    for stream in (out, err):
        stream.seek(0)
    output, said = out.read(), err.read()
    for line in (output + "\n" + said).split("\n"):
        if not line.isprintable():
            raise Failure(f"a terminal would obey {line[:200]!r}")
    lines = said.splitlines()
    for line in lines:
        if not line.startswith("eomgen: ") or len(line) > LONGEST_LINE + 40:
            raise Failure(f"a message that is none: {line[:200]!r}")
    faults = [line for line in lines if not line.startswith("eomgen: note: ")]
    if bool(code) != bool(faults) or len(faults) > 12:
        raise Failure(f"exit code {code} with {len(faults)} messages")
    return code, said
