"""The options of `reference`."""

from dataclasses import KW_ONLY, dataclass, field
from pathlib import Path
from typing import Any

from eomgen.base.options import about, option
from eomgen.model.model import Model
from eomgen.run.module import GeneratedModule
from eomgen.run.progress import Progress

SECONDS = 300.0
"""Processor time that a reference in extended precision may take, s; one in doubles is extra."""


@dataclass(frozen=True)
class ReferenceOptions:
    """The options of `reference`."""

    model: Model | None = field(metadata=about("what the module was made of", none="unknown"))
    module: GeneratedModule = field(metadata=about("what is run"))
    parameters: Any = option(None, "values, by name or in order", none="its own")
    inputs: Any = option(None, "constants, by name or in order", none="its own")
    t_end: float = option(10.0, "end time", "s")
    _: KW_ONLY
    progress: Progress | None = option(None, "called with the fraction done")
    seconds: float = option(
        SECONDS, "processor time allowed in extended precision, s; 0 to use doubles at once"
    )
    folder: Path | None = option(
        None,
        "where references are stored, so that none is computed twice. One that is not trusted or "
        "cannot be read or written (`eomgen.base.entries`) is ignored",
    )
    doubles: bool = option(True, "whether doubles may be used if extended precision cannot")
    rest_speed: float | None = option(
        None, "speed below which rigid contacts do not bounce", none="see `integrate`"
    )

    def report(self, done: float) -> None:
        """Report the fraction done."""
        if self.progress:
            self.progress(done)
