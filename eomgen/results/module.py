"""A generated module, with how it was made."""

import html
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from eomgen.base.displays import Displayed
from eomgen.base.files import check_writable, write_whole
from eomgen.base.frozen import Frozen
from eomgen.program.passes import PassReport


@dataclass(frozen=True, repr=False)
class Module(Frozen, Displayed):
    """A generated module.

    name         name of the scene
    source       source code
    explanation  a line for each route, with its operations and which was chosen
    notices      notices for the user
    reports      steps and operations of the program after each optimisation pass
    derived      whether it was derived now; else it comes from the store
    backend      name of the backend that wrote it
    others       contents of further files of the backend, by name
    library      sources of its shared library by name, if it is to be compiled and loaded
    reference    source of the Python module that a compiled one falls back on; "" without one
    digits       how many of 16 digits of accelerations are right at the worst of some states; None
                 if at least ten
    """

    shown = ("backend", "explanation", "notices", "digits")

    name: str
    source: str
    explanation: tuple[str, ...]
    notices: tuple[str, ...]
    reports: tuple[PassReport, ...] = ()
    derived: bool = field(default=True, compare=False)
    backend: str = "numpy"
    others: Mapping[str, str] = field(default_factory=dict)
    library: Mapping[str, str] = field(default_factory=dict, compare=False)
    reference: str = field(default="", compare=False)
    digits: int | None = None

    def save(self, path: str | Path, *, force: bool = False) -> None:
        """Write the file, and further files beside it, each atomically.

        Raises `RunError` if a file exists that this program did not write, unless `force`.
        """
        for name in self.others:
            check_writable(Path(path).with_name(name), force=force)
        write_whole(Path(path), self.source, force=force)
        for name, text in self.others.items():
            write_whole(Path(path).with_name(name), text, force=force)

    def _repr_html_(self) -> str:
        lines = "\n".join(self.explanation)
        return f"<b>{html.escape(self.name)}.py</b><pre>{html.escape(lines)}</pre>"
