"""Languages that programs are written in: one module and one template folder each.

To add one, write its module, which is a `Backend`, and its templates, and name it in `BACKENDS`.
"""

from collections.abc import Mapping
from typing import Protocol

from eomgen.codegen.backends import c, javascript, python
from eomgen.codegen.interface import Interface
from eomgen.errors import RunError, nearest
from eomgen.program.program import Program


class Backend(Protocol):
    """What a module of a language provides.

    ABOUT      what its files are, in a few words
    TEMPLATES  its folder of templates, in `templates/` or as a path
    SUFFIXES   of its files, in order
    files      the files of a program, in that order, by name: that of the scene and the suffix;
               same program and interface, same bytes
    """

    ABOUT: str
    TEMPLATES: str
    SUFFIXES: tuple[str, ...]

    def files(self, program: Program, interface: Interface) -> Mapping[str, str]:
        """The files of a program, by name."""


BACKENDS: dict[str, Backend] = {"numpy": python, "c": c, "javascript": javascript}


def find_backend(name: str) -> Backend:
    """The backend of a name. Raises `RunError` if there is none."""
    if name not in BACKENDS:
        known = ", ".join(BACKENDS)
        raise RunError(f"backend: unknown name '{name}'{nearest(name, BACKENDS)}; known: {known}")
    return BACKENDS[name]
