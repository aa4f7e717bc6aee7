"""A backend."""

from collections.abc import Mapping

from eomgen.codegen.interface import Interface
from eomgen.program.program import Program

ABOUT = "a list of the states of a scene"
TEMPLATES = ""
SUFFIXES = (".txt",)


def files(program: Program, interface: Interface) -> Mapping[str, str]:
    """A line for each state, with its unit."""
    lines = [f"{state.name} {state.unit}\n" for state in interface.states]
    return {f"{interface.name}.txt": "".join(lines)}
