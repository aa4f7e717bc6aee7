"""The shared library of a program's C kernels, from the store or compiled now."""

import ctypes
import hashlib
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

from eomgen.base.errors import RunError
from eomgen.codegen.backends.c import MAIN
from eomgen.native.compiler import FLAGS, find_compiler, suffix
from eomgen.store import entries_of

LEVELS = ("-O2", "-O1")
"""Optimisation level, and that for large sources."""
LARGE = 300_000
"""Characters of source above which the lower level is used: compilation takes long, and the
higher one gains little.
"""


def built(sources: Mapping[str, str]) -> ctypes.CDLL:
    """The library of C sources, name to text, from the store or compiled now.

    Raises `RunError` if there is no compiler, or if it fails.
    """
    return compiled_library(repr(sorted(sources.items())), lambda: sources, MAIN)


def compiled_library(
    about: str, sources: Callable[[], Mapping[str, str]], main: str, *flags: str
) -> ctypes.CDLL:
    """The library of C sources, of which `main` includes the others. Without `flags` it is compiled
    for this processor.

    It is stored under a digest of `about`, which must determine the sources and `flags`, of the
    compiler's version, the processor, and the flags of all libraries. Raises `RunError` if there is
    no compiler, or if it fails.
    """
    kept = kept_library(about)
    if kept is not None:
        return kept
    texts = sources()
    level = LEVELS[sum(map(len, texts.values())) > LARGE]
    compiler = find_compiler()
    content = compiler.shared_library(texts, main, level, *(flags or compiler.tuning))
    if entries := entries_of("native"):
        entries.put(_key(about), content)
    return _loaded(content)


def kept_library(about: str) -> ctypes.CDLL | None:
    """The same if it is in the store, or None. Raises `RunError` if there is no compiler."""
    entries = entries_of("native")
    content = entries.get(_key(about)) if entries else None
    return None if content is None else _loaded(content)


def _key(about: str) -> str:
    known = repr((about, find_compiler(), FLAGS, LEVELS))
    return hashlib.sha256(known.encode()).hexdigest()[:32]


def _loaded(content: bytes) -> ctypes.CDLL:
    """Load a library from its bytes, by a temporary file that is removed at once where the system
    allows that.
    """
    try:
        with tempfile.TemporaryDirectory(prefix="eomgen-", ignore_cleanup_errors=True) as place:
            path = Path(place) / f"loaded{suffix()}"
            path.write_bytes(content)
            return ctypes.CDLL(str(path))
    except OSError as error:
        raise RunError(f"the compiled module cannot be loaded: {error}") from None
