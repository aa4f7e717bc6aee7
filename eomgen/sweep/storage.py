"""A sweep on disk: a folder with a description, and a file for each array of all members.

A chunk of members is written into these when it has run, and then a small file that says so, with a
digest of its numbers. A sweep that was stopped goes on with the chunks that lack such a file, or
whose numbers it does not fit, and then has the same bytes as if it had not been stopped.
"""

import hashlib
import io
import json
import math
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy

from eomgen.errors import RunError
from eomgen.files import check_folder, read_plain, write_whole
from eomgen.sweep.design import Design
from eomgen.sweep.layout import Column, Layout, said
from eomgen.sweep.members import Arrays, Task

ABOUT, FORMAT = "sweep.json", 2
GOES_ON = "other chunks are kept, and the same sweep goes on with them"
LARGEST = 2**26
"""Greatest size of the file of a chunk, bytes."""


@dataclass(frozen=True)
class Storage:
    """The results of one sweep on disk.

    digest   of all that determines them
    members  their number, `size` of which are a chunk
    """

    folder: Path
    digest: str
    layout: Layout
    members: int
    size: int

    def has(self, number: int) -> bool:
        """Whether a chunk is there and undamaged."""
        about = self._about(number)
        try:
            return bool(about) and about["sha256"] == self._sum(number)
        except OSError:
            return False

    def put(self, number: int, arrays: Arrays) -> None:
        """Write a chunk. Raises `RunError` if that fails."""
        found = hashlib.sha256()
        for name, column in self.layout.items():
            data = np.ascontiguousarray(arrays[name], column.type).tobytes()
            found.update(data)
            path = self._path(name)
            try:
                with path.open("r+b") as file:
                    file.seek(self._place(column, number))
                    file.write(data)
            except OSError as error:
                text = f"{path}: cannot be written: {error.strerror}; {GOES_ON}"
                raise RunError(text) from None
        about = {
            "eomgen": self._name(number),
            "sha256": found.hexdigest(),
            "messages": {str(i): text for i, text in sorted(said(arrays).items())},
        }
        try:
            write_whole(self._chunk(number), json.dumps(about) + "\n", force=True)
        except RunError as error:
            raise RunError(f"{error}; {GOES_ON}") from None

    def results(self) -> tuple[Arrays, dict[int, str]]:
        """The arrays of all members, which stay on disk, and messages by number of the member."""
        arrays: Arrays = {name: np.load(self._path(name), mmap_mode="r") for name in self.layout}
        messages: dict[int, str] = {}
        for number in range(math.ceil(self.members / self.size)):
            for i, text in self._about(number).get("messages", {}).items():
                messages[number * self.size + int(i)] = str(text)
        return arrays, messages

    def prepare(self) -> None:
        """Make the files of all arrays that are missing or have another size, and reserve the space
        that they need. Raises `RunError` if the disk has less.
        """
        for name, column in self.layout.items():
            path, whole = self._path(name), self._place(column, None)
            try:
                if path.is_file() and path.stat().st_size == whole:
                    continue
                with path.open("wb") as file:
                    npy.write_array_header_1_0(file, self._header(column))
                    file.flush()
                    _reserve(file.fileno(), whole)
            except OSError as error:
                path.unlink(missing_ok=True)
                needed = f"{_words(whole)} are needed"
                raise RunError(f"{path}: cannot be written: {error.strerror}; {needed}") from None

    def _sum(self, number: int) -> str:
        """The digest of a chunk's numbers."""
        found = hashlib.sha256()
        for name, column in self.layout.items():
            path = self._path(name)
            start, end = (self._place(column, n) for n in (number, number + 1))
            with path.open("rb") as file:
                file.seek(start)
                found.update(file.read(end - start))
        return found.hexdigest()

    def _place(self, column: Column, number: int | None) -> int:
        """Where a chunk begins in a file, in bytes; None: the size of the file."""
        first = self.members if number is None else min(number * self.size, self.members)
        return _header_size(self._header(column)) + first * _size(column)

    def _header(self, column: Column) -> dict[str, Any]:
        shape = (self.members, *column.shape)
        return {"descr": column.type, "fortran_order": False, "shape": shape}

    def _about(self, number: int) -> dict[str, Any]:
        """What is written of a chunk; empty if it is missing, or of another sweep."""
        path = self._chunk(number)
        if not path.is_file():
            return {}
        try:
            about = json.loads(read_plain(path, LARGEST))
        except (ValueError, RecursionError, RunError):
            return {}
        known = isinstance(about, dict) and {"eomgen", "sha256", "messages"} <= about.keys()
        return about if known and about["eomgen"] == self._name(number) else {}

    def _name(self, number: int) -> str:
        return f"chunk {number} of the sweep {self.digest}"

    def _chunk(self, number: int) -> Path:
        return self.folder / f"chunk_{number:06d}.json"

    def _path(self, name: str) -> Path:
        return self.folder / f"{name}.npy"


def kept_members(folder: Path) -> int:
    """The number of members in the chunks that a folder holds."""
    try:
        about = json.loads(read_plain(folder / ABOUT, 2**20))
        count = len(list(folder.glob("chunk_*.json")))
        return min(int(about["members"]), count * int(about["chunk"]))
    except (OSError, RunError, ValueError, TypeError, KeyError, RecursionError):
        return 0


@contextmanager
def opened(
    folder: Path, task: Task, design: Design, layout: Layout, size: int
) -> Iterator[Storage]:
    """The storage of a sweep with chunks of `size` members, which is begun or goes on. While it is
    open, no other process can open it.

    Raises `RunError` if the folder cannot be written to, or holds something else.
    """
    about = {
        "eomgen": "sweep",
        "scene": task.model.name,
        "varied": list(design.names),
        "members": len(design.values),
        "chunk": size,
        "t_end": task.t_end,
        "settings": dict(sorted(task.settings.items())),
        "digest": digest_of(task, design, size),
    }
    text = json.dumps(about, indent=1) + "\n"
    path = folder / ABOUT
    check_folder(folder)
    if path.exists():
        if _digest(path) != about["digest"]:
            raise RunError(
                f"{folder}: holds another sweep; remove it, or choose another folder with -o"
            )
    else:
        if any(folder.iterdir()):
            raise RunError(f"{folder}: is not an empty folder; choose another one with -o")
        write_whole(path, text)
    with _alone(path):
        storage = Storage(folder, str(about["digest"]), layout, len(design.values), size)
        storage.prepare()
        yield storage


@contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Hold a lock on a file, where the system has locks, which end with the process."""
    try:
        locks: Any = import_module("fcntl")
    except ImportError:
        yield
        return
    with path.open("rb") as file:
        try:
            locks.flock(file, locks.LOCK_EX | locks.LOCK_NB)
        except BlockingIOError:
            raise RunError(
                f"{path.parent}: another process runs this sweep; wait until it ends, or choose "
                "another folder with -o"
            ) from None
        except OSError:  # a file system without locks
            pass
        yield


def _reserve(handle: int, size: int) -> None:
    """Make a file so long, with space on the disk for it where the system can reserve some."""
    reserve = getattr(os, "posix_fallocate", None)
    if reserve is not None and size:
        reserve(handle, 0, size)
    else:
        os.truncate(handle, size)


def _words(size: int) -> str:
    """A number of bytes in words: "14.4 TB"."""
    power = min(4, int(math.log10(max(1, size)) / 3))
    return f"{size / 1000**power:.3g} {('bytes', 'kB', 'MB', 'GB', 'TB')[power]}"


def _size(column: Column) -> int:
    return np.dtype(column.type).itemsize * math.prod(column.shape)


def _header_size(header: Mapping[str, Any]) -> int:
    """Bytes before the numbers in a file of NumPy's."""
    stream = io.BytesIO()
    npy.write_array_header_1_0(stream, dict(header))
    return len(stream.getvalue())


def digest_of(task: Task, design: Design, size: int) -> str:
    """A digest of all that determines the results."""
    values = hashlib.sha256(np.ascontiguousarray(design.values).tobytes()).hexdigest()
    parts = (FORMAT, task.digest, design.names, values, size)
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:32]


def _digest(path: Path) -> str:
    try:
        about = json.loads(read_plain(path, 2**20))
        return str(about["digest"]) if isinstance(about, dict) else ""
    except (ValueError, KeyError, RecursionError):
        return ""
