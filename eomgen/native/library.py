"""The shared library of a program's C kernels, from the store or compiled now."""

import ctypes
import hashlib
import tempfile
from collections.abc import Mapping
from pathlib import Path

from eomgen.codegen.backends.c import MAIN
from eomgen.entries import Entries
from eomgen.errors import RunError
from eomgen.native.compiler import FLAGS, find_compiler, suffix
from eomgen.store import folder

LEVELS = ("-O2", "-O1")
"""Optimisation level, and that for large sources."""
LARGE = 300_000
"""Characters of source above which the lower level is used: compilation takes long, and the
higher one gains little.
"""


def built(sources: Mapping[str, str]) -> ctypes.CDLL:
    """Compile and load the library of C sources (name to text).

    The library is stored under a digest of the sources, the compiler's version and the flags.
    Raises `RunError` if there is no compiler, or if it fails.
    """
    compiler = find_compiler()
    level = LEVELS[sum(map(len, sources.values())) > LARGE]
    known = repr((sorted(sources.items()), compiler, FLAGS, level))
    key = hashlib.sha256(known.encode()).hexdigest()[:32]
    place = folder("native")
    content = Entries(place).get(key) if place else None
    if content is None:
        content = compiler.shared_library(sources, MAIN, level)
        if place:
            Entries(place).put(key, content)
    return _loaded(content)


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
