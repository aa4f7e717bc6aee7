"""Files are written whole or not at all, and never over something this program did not write."""

import os
import tempfile
from pathlib import Path

from eomgen.errors import RunError

MARK = b"eomgen"
"""Every file this program writes has this word within its first `MARK_WITHIN` bytes."""
MARK_WITHIN = 2048


def check_writable(path: Path, *, force: bool = False) -> None:
    """Raise `RunError` if `path` may not be written: a folder, or a file that is not ours."""
    if path.is_dir():
        raise RunError(f"{path}: is a folder; give the name of a file")
    if force or not path.exists():
        return
    try:
        with path.open("rb") as file:
            ours = MARK in file.read(MARK_WITHIN)
    except OSError as error:
        raise RunError(f"{path}: cannot be read: {error.strerror}") from None
    if not ours:
        raise RunError(
            f"{path}: exists and was not written by eomgen; "
            "move it away, choose another name, or give --force"
        )


def check_folder(path: Path) -> None:
    """Make a folder for output. Raises `RunError` if it cannot be, or cannot be written to."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunError(f"{path}: cannot be made a folder: {error.strerror}") from None
    if not os.access(path, os.W_OK | os.X_OK):
        raise RunError(f"{path}: cannot be written to; choose another folder with -o")


def write_whole(path: Path, data: bytes | str, *, force: bool = False) -> None:
    """Write `data` to a temporary file beside `path`, then rename it into place.

    Missing folders are made. Raises `RunError` if `path` exists and is not ours (see
    `check_writable`) or cannot be written; then nothing is left behind.
    """
    check_writable(path, force=force)
    content = data.encode("utf-8") if isinstance(data, str) else data
    temporary: str | None = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        Path(temporary).chmod(0o666 & ~_umask())
        Path(temporary).replace(path)
    except OSError as error:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)
        raise RunError(f"{path}: cannot be written: {error.strerror}") from None


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
