"""A folder of entries under keys, which only this user can write.

Entries are executed later, so one is read only if it is a regular file that this user owns and
nobody else can write, of bounded size, in folders with the same properties, and if its digest
matches key and content. The digest detects damage and entries under a wrong key. It is not a
signature: whoever can write entries as this user could read the signing key, and could change this
program too.
"""

import hashlib
import os
import re
import secrets
import stat
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

LARGEST = 100_000_000
"""Size in bytes of the largest entry; a thousand links with every output take 72 million."""
MOST_BYTES = 500_000_000
"""Size in bytes of all entries; the least recently used are removed first."""
LONGEST_UNUSED = 90 * 86400.0
"""Time in seconds after which an unused entry is removed."""
LONGEST_WRITING = 3600.0
"""Time in seconds after which an unfinished file is considered abandoned."""

_MARK = b"eomgen entry 1 "
_NAME = re.compile(r"([0-9a-f]{32})\.entry")
_BEGUN = re.compile(r"[0-9a-f]{32}\.[0-9a-f]{16}\.begun")
_FLAGS = sum(getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY"))


@dataclass(frozen=True)
class Entries:
    """The entries of a folder: bytes under keys of 32 hexadecimal digits.

    within  a folder that holds this one, and must be the user's own as well: whoever can write to
            it can put another one in the place of this
    """

    folder: Path
    within: Path | None = None

    def trouble(self) -> str:
        """Why the folder cannot be trusted, and what to do; "" if it can, or does not exist."""
        above = self.within is not None and _trouble(self.within)
        return above or _trouble(self.folder)

    def get(self, key: str) -> bytes | None:
        """The content under a key; None if there is none, or none that `put` wrote."""
        if self.trouble():
            return None
        with suppress(OSError, ValueError):
            handle = os.open(self._path(key), os.O_RDONLY | _FLAGS)
            with os.fdopen(handle, "rb") as file:
                about = os.fstat(handle)
                if not (_is_trusted(about) and about.st_size <= LARGEST):
                    return None
                head, content = file.readline(len(_head(key, b""))), file.read(about.st_size)
                if head != _head(key, content):
                    return None
                with suppress(OSError):  # on a read-only file system
                    os.utime(handle if os.utime in os.supports_fd else self._path(key))
            return content
        return None

    def put(self, key: str, content: bytes) -> str:
        """Write `content` under a key, atomically, and remove old entries.

        Content that is too large is not written. Returns why writing failed, and what to do, or "".
        """
        entry = _head(key, content) + content
        if len(entry) > LARGEST:
            return ""
        begun = self.folder / f"{key}.{secrets.token_hex(8)}.begun"
        try:
            if trouble := self.trouble() or self._create():
                return trouble
            handle = os.open(begun, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _FLAGS, 0o600)
            with os.fdopen(handle, "wb") as file:
                file.write(entry)
            begun.replace(self._path(key))
            self._clean(time.time())
        except (OSError, ValueError) as error:
            return f"it cannot be written: {_why(error)}"
        finally:
            with suppress(OSError, ValueError):
                begun.unlink(missing_ok=True)
        return ""

    def _create(self) -> str:
        """Create the folder if it does not exist. Returns `trouble` of it, since another process
        may have created it meanwhile.
        """
        for path in (self.within, self.folder):
            if path is not None:
                path.mkdir(mode=0o700, parents=True, exist_ok=True)
        return self.trouble()

    def _path(self, key: str) -> Path:
        path = self.folder / f"{key}.entry"
        assert _NAME.fullmatch(path.name), key
        return path

    def _clean(self, now: float) -> None:
        """Remove entries that are too old or too many, and abandoned files.

        Another process may do the same, or use an entry meanwhile: then it has the file open, or
        does not find the entry.
        """
        size = 0
        for about, path in sorted(self._ours(), key=lambda entry: -entry[0].st_mtime):
            size += about.st_size
            if size > MOST_BYTES or now - about.st_mtime > LONGEST_UNUSED:
                with suppress(OSError):
                    path.unlink()
        for path in self.folder.iterdir():
            with suppress(OSError):
                if _BEGUN.fullmatch(path.name) and _is_abandoned(path.lstat(), now):
                    path.unlink()

    def _ours(self) -> Iterator[tuple[os.stat_result, Path]]:
        """The files that `put` wrote, judged by name, owner and first line, with their status."""
        for path in self.folder.iterdir():
            name = _NAME.fullmatch(path.name)
            if not name:
                continue
            with suppress(OSError):
                handle = os.open(path, os.O_RDONLY | _FLAGS)
                with os.fdopen(handle, "rb") as file:
                    about = os.fstat(handle)
                    if _is_trusted(about) and file.read(len(_MARK)) == _MARK:
                        yield about, path


def _trouble(folder: Path) -> str:
    """Why a folder cannot be trusted, and what to do; "" if it can, or does not exist."""
    try:
        about = folder.lstat()
    except FileNotFoundError:
        return ""
    except (OSError, ValueError) as error:
        return f"it cannot be read: {_why(error)}"
    if stat.S_ISLNK(about.st_mode):
        return "it is a symbolic link; name the folder itself in EOMGEN_CACHE"
    if not stat.S_ISDIR(about.st_mode):
        return "it is not a folder; name one in EOMGEN_CACHE"
    if not _is_own(about):
        return "it belongs to another user; name a folder of your own in EOMGEN_CACHE"
    if not _is_private(about):
        return f"others can write to it; run: chmod go-w {folder}"
    return ""


def _head(key: str, content: bytes) -> bytes:
    """The first line of an entry."""
    digest = hashlib.sha256(key.encode() + b"\n" + content).hexdigest()
    return _MARK + f"{key} {digest}\n".encode()


def _is_own(about: os.stat_result) -> bool:
    return not hasattr(os, "geteuid") or about.st_uid == os.geteuid()


def _is_private(about: os.stat_result) -> bool:
    """Whether nobody else may write. Without POSIX modes, a folder in the user's profile is."""
    return os.name != "posix" or not about.st_mode & 0o022


def _is_trusted(about: os.stat_result) -> bool:
    return stat.S_ISREG(about.st_mode) and _is_own(about) and _is_private(about)


def _is_abandoned(about: os.stat_result, now: float) -> bool:
    return stat.S_ISREG(about.st_mode) and _is_own(about) and now - about.st_mtime > LONGEST_WRITING


def _why(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)
