"""How long work without a known length took before, for the time that it may take again."""

import json
import math
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from eomgen.base.errors import EomgenError
from eomgen.base.files import read_plain, write_whole
from eomgen.run.progress import terminal_notice
from eomgen.store import entries_of

LARGEST, MOST = 2**20, 500
"""Largest size of the file, bytes, and greatest number of its entries."""
SHORTEST = 1.0
"""Shorter work is not remembered, s."""


@contextmanager
def timed_notice(label: str) -> Iterator[None]:
    """Show on a terminal what is done, for how long already, and about how long it will still take
    if it took long before. Remember how long it took.
    """
    entries = entries_of()
    file = entries.folder / "durations.json" if entries and not entries.trouble() else None
    known = _read(file) if file else {}
    began = time.monotonic()
    with terminal_notice(label, known.get(label)):
        yield
    spent = time.monotonic() - began
    if file and spent > SHORTEST:
        known = {**{name: known[name] for name in known if name != label}, label: spent}
        kept = dict(list(known.items())[-MOST:])
        with suppress(EomgenError, OSError):  # the next time will only be unknown
            write_whole(file, json.dumps(kept), force=True)


def _read(file: Path) -> dict[str, float]:
    """The times by label; none if the file is missing or damaged."""
    try:
        known = json.loads(read_plain(file, LARGEST)) if file.exists() else {}
    except (EomgenError, OSError, ValueError, RecursionError):
        return {}
    if not isinstance(known, dict):
        return {}
    return {
        label: seconds
        for label, seconds in known.items()
        if isinstance(seconds, float) and 0 < seconds < math.inf
    }
