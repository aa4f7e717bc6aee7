"""A language in one file and one folder of templates: `derivative` in AWK, a state a line."""

from collections.abc import Mapping
from pathlib import Path

from eomgen.base.templating import render
from eomgen.codegen.interface import Interface
from eomgen.codegen.kernels import kernels_of
from eomgen.program.printing import Dialect
from eomgen.program.program import Program

ABOUT = "an AWK program: states in, derivatives out, a line each"
TEMPLATES = str(Path(__file__).parent / "awk")
SUFFIXES: tuple[str, ...] = (".awk",)
KNOWN = ("sin", "cos", "sqrt", "exp", "log", "atan2")
"""The functions that AWK has; a scene that calls others is refused by AWK."""
DIALECT = Dialect(
    {name: name for name in KNOWN}, frozenset("print function in getline y p".split())
)


def files(program: Program, interface: Interface) -> Mapping[str, str]:
    """The program, in one file; time is 0, parameters are those of the scene, inputs 0."""
    kernels, constants = kernels_of(program, interface, DIALECT)
    derivative = next(k for k in kernels if k.function.name == "derivative")
    given = [
        *((name, f"${i + 1}") for i, name in enumerate(derivative.state) if name),
        *((name, "0") for name in derivative.inputs if name),
        *(("t", "0") for _ in range(derivative.time)),
    ]
    defaults = zip(constants.parameters, (p.default for p in interface.parameters), strict=True)
    context = {
        "scene": interface.name,
        "fixed": [
            *((name, repr(value)) for name, value in defaults),
            *constants.checked,
            *constants.lines,
        ],
        "lines": [*given, *derivative.block.lines],
        "results": derivative.block.results,
        "formats": " ".join("%.17g" for _ in derivative.block.results),
    }
    return {f"{interface.name}.awk": render(TEMPLATES, "program.awk.jinja", context)}
