"""A program's C kernels as a shared library, from the store or compiled now."""

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
"""How much a compiler optimises: usually, and what is large."""
LARGE = 300_000
"""Characters of source from which on a compiler optimises less: it takes long, and gains little."""


def built(sources: Mapping[str, str]) -> ctypes.CDLL:
    """The library of C sources, by name, loaded. It is kept under what it is made of: sources,
    compiler with its version, and flags.

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
    """A library from its bytes. Its file is in a folder of this process alone, which is removed
    once it is loaded, where files in use can be.
    """
    try:
        with tempfile.TemporaryDirectory(prefix="eomgen-", ignore_cleanup_errors=True) as place:
            path = Path(place) / f"loaded{suffix()}"
            path.write_bytes(content)
            return ctypes.CDLL(str(path))
    except OSError as error:
        raise RunError(f"the compiled module cannot be loaded: {error}") from None
