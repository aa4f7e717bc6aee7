"""How much is tried: the ordinary run takes a part, `FULL=1 python -m pytest` takes everything."""

import os
from typing import TypeVar

T = TypeVar("T")
FULL = "FULL" in os.environ


def some(part: T, whole: T) -> T:
    """The part, or the whole in a full run."""
    return whole if FULL else part
