"""A sweep on disk: a folder with a description, and an archive for each chunk of members.

A chunk is written when its members have run. A sweep that was stopped goes on with the chunks that
are missing, and then has the same bytes as if it had not been stopped.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from eomgen.errors import RunError
from eomgen.files import check_folder, read_plain, write_whole
from eomgen.run.archive import checked, packed, unpacked
from eomgen.store import key_of
from eomgen.sweep.design import Design
from eomgen.sweep.members import Arrays, Task

ABOUT = "sweep.json"
MARK = "eomgen"
LARGEST = 2**31
"""Greatest size of a chunk, bytes."""


@dataclass(frozen=True)
class Storage:
    """The chunks of one sweep; `digest` is that of all that determines its results."""

    folder: Path
    digest: str

    def put(self, number: int, arrays: Arrays) -> None:
        """Write a chunk."""
        marked = {MARK: np.array(f"chunk {number} of the sweep {self.digest}"), **arrays}
        write_whole(self._path(number), packed(marked))

    def get(self, number: int) -> Arrays | None:
        """A chunk; None if it is missing, damaged, or of another sweep."""
        path = self._path(number)
        if not path.is_file():
            return None
        try:
            arrays = checked(unpacked(read_plain(path, LARGEST)))
        except Exception:  # a damaged archive may raise any error of zipfile and NumPy
            return None
        if str(arrays.pop(MARK, "")) != f"chunk {number} of the sweep {self.digest}":
            return None
        return arrays

    def _path(self, number: int) -> Path:
        return self.folder / f"chunk_{number:06d}.npz"


def opened(folder: Path, task: Task, design: Design, size: int) -> Storage:
    """The storage of a sweep with chunks of `size` members, which is begun or goes on.

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
            raise RunError(f"{folder}: holds another sweep; choose another folder with -o")
    else:
        if any(folder.iterdir()):
            raise RunError(f"{folder}: is no empty folder; choose another one with -o")
        write_whole(path, text)
    return Storage(folder, str(about["digest"]))


def digest_of(task: Task, design: Design, size: int) -> str:
    """A digest of all that determines the results."""
    parts: tuple[Any, ...] = (
        *(key_of(task.model), task.source, design.names, design.values.tobytes(), size),
        *(task.kinds, _sorted(task.parameters), _sorted(task.inputs), task.outputs, task.t_end),
        *(task.times, _sorted(task.settings), bool(task.vectors)),
    )
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:32]


def _sorted(values: Mapping[str, Any]) -> list[tuple[str, Any]]:
    return sorted(values.items())


def _digest(path: Path) -> str:
    try:
        about = json.loads(read_plain(path, 2**20))
        return str(about["digest"]) if isinstance(about, dict) else ""
    except (ValueError, KeyError, RecursionError):
        return ""
