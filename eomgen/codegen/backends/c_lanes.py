"""C for several states at once, one in each lane of vector registers.

The vector extensions of GCC and clang compute all lanes by the operations of single numbers, so the
results do not depend on the number of lanes, or on what other lanes hold. They differ from those of
the C backend, and of the Python module, by the roundings of sine and cosine, which are computed by
polynomials here.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from eomgen.codegen.backends import c
from eomgen.codegen.interface import Interface
from eomgen.codegen.kernels import kernels_of
from eomgen.program.printing import Dialect
from eomgen.program.program import Program
from eomgen.scalars.functions import FUNCTIONS
from eomgen.templating import render

MAIN = "lanes.c"
"""The source of a shared library to compile; it includes the others."""
EACH = ("tan", "asin", "acos", "atan", "exp", "log", "tanh")
"""Functions of one number that the mathematical library computes for each lane."""
OURS = (
    "V I N EACH LANES INLINE STATES INPUTS CONSTANTS WIDTH RAISED either size_of any root columns "
    "times reduced bits_from sine_and_cosine put taken lanes_of beside begin unit suspicious l i"
)
DIALECT = Dialect(
    {name: f"{name}_v" for name in FUNCTIONS},
    c.RESERVED | {*OURS.split(), *(f"{name}_v" for name in FUNCTIONS)},
    number="N({})",
    assigned=frozenset({"sin", "cos"}),
)
SINE_OR_COSINE = re.compile(r"(sin|cos)_v\((\w+)\)")
LIMIT = 2.78
"""Greatest h|λ| at which the classical Runge-Kutta method is stable, for real λ; 2.83 if λ is
imaginary."""
STREAK, NOISE = 4.0, 1e-9
"""Number of steps in a row that look unstable before a run is given up, and the least change of
slopes times h, relative to the state, that counts."""


def files(
    program: Program, interface: Interface, usual_length: tuple[float, float]
) -> Mapping[str, str]:
    """The sources of a shared library, name to text; `MAIN` includes the others.

    For each output: `columns_NAME`, for columns of states; `prepare` for constants and initial
    states of many sets of parameters; `rk4` for whole runs. The program must have the outputs
    `derivative` and `initial_state`, and none that takes further arguments.

    usual_length  lengths of quaternions between which squares neither overflow nor underflow
    """
    scalar = c.files(program, interface)
    context = c.context(program, interface)
    kernels, _ = kernels_of(program, interface, DIALECT)
    # The constants are those of the scalar kernels, in their order; only names may differ.
    held = dict.fromkeys(name for kernel in kernels for name in kernel.constants)
    place = {name: i for i, name in enumerate(held)}
    assert len(place) == len(context["held"])
    vectors = [
        {**c.written(kernel, place), "lines": _paired(kernel.block.lines)}
        for kernel in kernels
        if kernel.function.name != "initial_state"
    ]
    values: dict[str, Any] = {
        "prefix": interface.name,
        "states": len(interface.states),
        "inputs": len(interface.inputs),
        "parameters": len(interface.parameters),
        "held": len(place),
        "vectors": vectors,
        "each": [(name, c.C_NAMES.get(name, name)) for name in EACH],
        "quaternions": interface.quaternions,
        "shortest": repr(usual_length[0]),
        "longest": repr(usual_length[1]),
        "positions": [int(state.position) for state in interface.states],
        "limit": LIMIT,
        "streak": STREAK,
        "noise": NOISE,
    }
    return {**scalar, MAIN: render(c.TEMPLATES, "lanes.c.jinja", values)}


def _paired(lines: Sequence[tuple[str, str]]) -> list[tuple[str, str]]:
    """Lines in which a sine and a cosine of one angle are computed together; they are statements
    with an empty name.
    """
    found: dict[str, dict[str, str]] = {}
    for name, source in lines:
        if match := SINE_OR_COSINE.fullmatch(source):
            found.setdefault(match[2], {})[match[1]] = name
    pairs = {angle: both for angle, both in found.items() if len(both) == 2}
    made: list[tuple[str, str]] = []
    for name, source in lines:
        match = SINE_OR_COSINE.fullmatch(source)
        both = pairs.get(match[2]) if match else None
        if match is None or both is None:
            made.append((name, source))
        elif name == min(both.values(), key=[line[0] for line in lines].index):
            sine, cosine = both["sin"], both["cos"]
            made.append(("", f"V {sine}, {cosine}"))
            made.append(("", f"sine_and_cosine({match[2]}, &{sine}, &{cosine})"))
    return made
