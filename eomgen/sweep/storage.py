"""A sweep on disk: a folder with a description, and a file for each array of all members.

A chunk of members is written into these when it has run, and then a small file that says so, with
its messages and a digest of these and its numbers. A sweep that was stopped goes on with the chunks
that lack such a file, or that it does not fit, and then has the same bytes as if it had not been
stopped. Nothing in the folder is taken at its word: numbers are read by the layout of this sweep
whatever the files say of themselves, and only from plain files.
"""

import hashlib
import io
import json
import math
import os
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.lib import format as npy

from eomgen.base.errors import RunError
from eomgen.base.files import UNFINISHED, check_folder, is_kept, open_kept, write_whole
from eomgen.base.text import LONGEST_LINE, brief
from eomgen.results.design import Design
from eomgen.results.ensemble import WORDS
from eomgen.sweep.layout import Column, Layout, said
from eomgen.sweep.members import Arrays, Task

ABOUT, FORMAT = "sweep.json", 3
CHUNK = re.compile(r"chunk_\d{6,}\.json")
GOES_ON = "other chunks are kept, and the same sweep goes on with them"
LARGEST = 2**26
"""Greatest size of the file of a chunk, bytes."""


@dataclass(frozen=True)
class Storage:
    """The results of one sweep on disk.

    digest    of all that determines them
    members   their number, `size` of which are a chunk
    messages  of the chunks that are known to be there, by number of the member
    """

    folder: Path
    digest: str
    layout: Layout
    members: int
    size: int
    messages: dict[int, str] = field(init=False, default_factory=dict)

    def has(self, number: int) -> bool:
        """Whether a chunk is there and undamaged."""
        try:
            data = [self._numbers(name, number) for name in self.layout]
            text = _read(self._chunk(number), LARGEST)
            messages = _messages(text)
        except (OSError, RunError, ValueError, RecursionError):
            return False
        members = min(self.size, self.members - number * self.size)
        status = data[list(self.layout).index("status")]
        if text != self._description(number, data, messages) or (
            not (all(0 <= i < members for i in messages) and set(status) <= set(range(len(WORDS))))
        ):
            return False
        self._take(number, messages)
        return True

    def put(self, number: int, arrays: Arrays) -> None:
        """Write a chunk. Raises `RunError` if that fails."""
        data, messages = [], said(arrays)
        for name, column in self.layout.items():
            data.append(np.ascontiguousarray(arrays[name], column.type).tobytes())
            path = self._path(name)
            try:
                with open_kept(path, os.O_RDWR) as file:
                    file.seek(self._place(column, number))
                    file.write(data[-1])
            except OSError as error:
                text = f"{path}: cannot be written: {error.strerror}; {GOES_ON}"
                raise RunError(text) from None
        try:
            description = self._description(number, data, messages)
            write_whole(self._chunk(number), description, force=True)
        except RunError as error:
            raise RunError(f"{error}; {GOES_ON}") from None
        self._take(number, messages)

    def results(self) -> tuple[Arrays, dict[int, str]]:
        """The arrays of all members, which stay on disk, and messages by number of the member."""
        arrays: Arrays = {}
        for name, column in self.layout.items():
            shape, start = (self.members, *column.shape), self._place(column, 0)
            with open_kept(self._path(name)) as file:
                arrays[name] = np.memmap(file, column.type, "r", start, shape)
        return arrays, self.messages

    def prepare(self) -> None:
        """Make the files of all arrays as long as they must be, with their headers, and reserve the
        space that they need. Raises `RunError` if the disk has less.
        """
        for name, column in self.layout.items():
            path, whole, header = self._path(name), self._place(column, None), self._header(column)
            there = is_kept(path)
            try:
                with open_kept(path, os.O_RDWR | os.O_CREAT) as file:
                    _resize(file.fileno(), whole)
                    if file.read(len(header)) != header:
                        file.seek(0)
                        file.write(header)
            except OSError as error:
                if not there:
                    path.unlink(missing_ok=True)
                needed = f"{_words(whole)} are needed"
                raise RunError(f"{path}: cannot be written: {error.strerror}; {needed}") from None

    def check(self) -> None:
        """Raise `RunError` if something of the sweep is not a plain file."""
        names = {path.name for path in map(self._path, self.layout)}
        for path in sorted(self.folder.iterdir()):
            if path.name in names or CHUNK.fullmatch(path.name):
                is_kept(path)

    def clear(self) -> None:
        """Remove files that a killed process had begun."""
        for path in self.folder.iterdir():
            if UNFINISHED.fullmatch(path.name):
                with suppress(OSError):
                    path.unlink()

    def _numbers(self, name: str, number: int) -> bytes:
        """The numbers of a chunk in a file."""
        start, end = (self._place(self.layout[name], n) for n in (number, number + 1))
        with open_kept(self._path(name)) as file:
            file.seek(start)
            return file.read(end - start)

    def _description(self, number: int, data: list[bytes], messages: Mapping[int, str]) -> str:
        """The file of a chunk."""
        written = {str(i): text for i, text in sorted(messages.items())}
        found = hashlib.sha256()
        for part in (*data, json.dumps(written).encode()):
            found.update(part)
        name = f"chunk {number} of the sweep {self.digest}"
        about = {"eomgen": name, "sha256": found.hexdigest(), "messages": written}
        return json.dumps(about) + "\n"

    def _take(self, number: int, messages: Mapping[int, str]) -> None:
        self.messages.update({number * self.size + i: text for i, text in messages.items()})

    def _place(self, column: Column, number: int | None) -> int:
        """Where a chunk begins in a file, in bytes; None: the size of the file."""
        first = self.members if number is None else min(number * self.size, self.members)
        return len(self._header(column)) + first * _size(column)

    def _header(self, column: Column) -> bytes:
        """What is before the numbers in a file of NumPy's."""
        shape = (self.members, *column.shape)
        stream = io.BytesIO()
        header = {"descr": column.type, "fortran_order": False, "shape": shape}
        npy.write_array_header_1_0(stream, header)
        return stream.getvalue()

    def _chunk(self, number: int) -> Path:
        return self.folder / f"chunk_{number:06d}.json"

    def _path(self, name: str) -> Path:
        return self.folder / f"{name}.npy"


def _messages(text: str) -> dict[int, str]:
    """The messages in the file of a chunk. Raises `ValueError` if it was not written by `put`."""
    try:
        written = json.loads(text)["messages"]
        found = {int(i): said for i, said in written.items()}
    except (TypeError, KeyError, AttributeError):
        raise ValueError(text) from None
    for message in found.values():
        if not (
            isinstance(message, str) and message.isprintable() and len(message) <= LONGEST_LINE
        ):
            raise ValueError(text)
    return found


def _read(path: Path, most: int) -> str:
    """The text of a file in the folder. Raises `OSError`, `RunError` or `ValueError`."""
    with open_kept(path) as file:
        data = file.read(most + 1)
    if len(data) > most:
        raise ValueError(path)
    return data.decode("utf-8")


def kept_members(folder: Path) -> int:
    """The number of members in the chunks that a folder holds."""
    about = _about(folder / ABOUT)
    try:
        count = len(list(folder.glob("chunk_*.json")))
        return min(int(about["members"]), count * int(about["chunk"]))
    except (OSError, ValueError, TypeError, KeyError, OverflowError):
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
        "program": task.by,
        "digest": digest_of(task, design, size),
    }
    path = folder / ABOUT
    check_folder(folder)
    if is_kept(path):
        _check_same(folder, about)
    else:
        if not all(UNFINISHED.fullmatch(other.name) for other in folder.iterdir()):
            raise RunError(f"{folder}: is not an empty folder; choose another one with -o")
        write_whole(path, json.dumps(about, indent=1) + "\n")
    with _alone(path):
        storage = Storage(folder, str(about["digest"]), layout, len(design.values), size)
        storage.check()
        storage.clear()
        storage.prepare()
        yield storage


def _check_same(folder: Path, about: Mapping[str, Any]) -> None:
    """Raise `RunError` unless a folder holds this sweep."""
    held = _about(folder / ABOUT)
    if held.get("digest") == about["digest"] and held.get("program") == about["program"]:
        return
    what = "another sweep"
    if "digest" not in held:
        what = f"a damaged {ABOUT}"
    elif (by := held.get("program")) != about["program"]:
        what = f"a sweep of another version, {brief(str(by))}, and this is {about['program']}"
    raise RunError(f"{folder}: holds {what}; remove it, or choose another folder with -o")


@contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Hold a lock on a file, where the system has locks, which end with the process."""
    take = _lock()
    if take is None:
        yield
        return
    with open_kept(path) as file:
        try:
            take(file)
        except (BlockingIOError, PermissionError):  # of POSIX, of Windows
            raise RunError(
                f"{path.parent}: another process runs this sweep; wait until it ends, or choose "
                "another folder with -o"
            ) from None
        except OSError:  # a file system without locks
            pass
        yield


def _lock() -> Callable[[BinaryIO], object] | None:
    """What locks an open file or raises at once; None if this system has no locks."""
    with suppress(ImportError):
        posix: Any = import_module("fcntl")
        return lambda file: posix.flock(file, posix.LOCK_EX | posix.LOCK_NB)
    with suppress(ImportError):
        windows: Any = import_module("msvcrt")

        def beyond_the_end(file: BinaryIO) -> None:  # others could not read a byte that is locked
            file.seek(LARGEST)
            windows.locking(file.fileno(), windows.LK_NBLCK, 1)

        return beyond_the_end
    return None


def _resize(handle: int, size: int) -> None:
    """Make a file so long, with space on the disk for it where the system can reserve some."""
    now = os.fstat(handle).st_size
    reserve = getattr(os, "posix_fallocate", None)
    if now < size and reserve is not None:
        reserve(handle, 0, size)
    elif now != size:
        os.ftruncate(handle, size)


def _words(size: int) -> str:
    """A number of bytes in words: "14.4 TB"."""
    power = min(4, int(math.log10(max(1, size)) / 3))
    return f"{size / 1000**power:.3g} {('bytes', 'kB', 'MB', 'GB', 'TB')[power]}"


def _size(column: Column) -> int:
    return np.dtype(column.type).itemsize * math.prod(column.shape)


def digest_of(task: Task, design: Design, size: int) -> str:
    """A digest of all that determines the results."""
    values = hashlib.sha256(np.ascontiguousarray(design.values).tobytes()).hexdigest()
    parts = (FORMAT, task.digest, design.names, values, size)
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:32]


def _about(path: Path) -> dict[str, Any]:
    """What a folder says of its sweep; empty if that cannot be read."""
    with suppress(OSError, RunError, ValueError, RecursionError):
        about = json.loads(_read(path, 2**20))
        return about if isinstance(about, dict) else {}
    return {}
