"""Backends: the languages in which programs are written, each a module and a template folder.

To add a language, write a module that is a `Backend` and its templates, and enter it in `BACKENDS`.
"""

from collections.abc import Mapping
from typing import Protocol

from eomgen.base.errors import RunError, nearest
from eomgen.base.plugins import added
from eomgen.codegen.backends import c, javascript, jax, matlab, python
from eomgen.codegen.interface import Interface
from eomgen.program.program import Program


class Backend(Protocol):
    """What the module of a language provides.

    ABOUT      a few words on its files
    TEMPLATES  its folder of templates, in `templates/` or as a path
    SUFFIXES   the suffixes of its files, in order
    files      the contents of the files in that order, by name: the name of the scene and a suffix;
               equal programs and interfaces give equal bytes
    """

    ABOUT: str
    TEMPLATES: str
    SUFFIXES: tuple[str, ...]

    def files(self, program: Program, interface: Interface) -> Mapping[str, str]:
        """The contents of a program's files, by name."""


BACKENDS: dict[str, Backend] = {
    "numpy": python,
    "c": c,
    "javascript": javascript,
    "jax": jax,
    "matlab": matlab,
}
BACKENDS |= added("backends", BACKENDS)


def find_backend(name: str) -> Backend:
    """The backend of that name. Raises `RunError` if there is none."""
    if name not in BACKENDS:
        known = ", ".join(BACKENDS)
        raise RunError(f"backend: unknown name '{name}'{nearest(name, BACKENDS)}; known: {known}")
    return BACKENDS[name]
