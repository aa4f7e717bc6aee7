"""C for several states at once, one in each lane of vector registers.

The vector extensions of GCC and clang compute all lanes by the operations of single numbers, so the
results do not depend on the number of lanes, or on what other lanes hold. They differ from those of
the C backend, and of the Python module, by the roundings of sine and cosine, which are computed by
polynomials here, and by those of sums with a product, which are rounded once.
"""

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

from eomgen.base.templating import render
from eomgen.codegen.backends import c
from eomgen.codegen.interface import Interface
from eomgen.engine.explicit import RUNGE_KUTTA_4
from eomgen.engine.methods import Roots
from eomgen.program.ordering import ordered
from eomgen.program.printing import Dialect
from eomgen.program.program import Program

MAIN = "lanes.c"
"""The source of a shared library to compile; it includes the others."""
DIALECT = replace(c.VECTORS, fused=("plus_product", "product_minus", "minus_product"))
LIMIT = 2.78
"""Greatest h|λ| at which the classical Runge-Kutta method is stable, for real λ; 2.83 if λ is
imaginary."""
NOISE = 1e-9
"""The least change of slopes times h, relative to the state, by which a step looks unstable."""


def files(
    program: Program, interface: Interface, usual_length: tuple[float, float]
) -> Mapping[str, str]:
    """The sources of a shared library, name to text; `MAIN` includes the others.

    For each output: `columns_NAME`, for columns of states; `prepare` for constants and initial
    states of many sets of parameters; `rk4` for whole runs. The program must have the outputs
    `derivative` and `initial_state`, and none that takes further arguments.

    usual_length  lengths of quaternions between which squares neither overflow nor underflow
    """
    # Imported here because backends without lanes do without the printer.
    from eomgen.engine.printed import c_source
    from eomgen.subset.languages import VECTORS

    steps: Roots = [("by_slopes", {"method": RUNGE_KUTTA_4}), ("add_compensated", {})]
    program = ordered(program)
    context = c.context(program, interface)
    wanted = [f.name for f in interface.functions if f.name != "initial_state"]
    values: dict[str, Any] = {
        **columns(program, interface, context, DIALECT, wanted, usual_length),
        "positions": [int(state.position) for state in interface.states],
        "limit": LIMIT,
        "noise": NOISE,
        "engine": VECTORS.prelude + c_source(steps, VECTORS),
    }
    return {**c.files_of(context, interface), MAIN: render(c.TEMPLATES, "lanes.c.jinja", values)}


def columns(
    program: Program,
    interface: Interface,
    context: Mapping[str, Any],
    dialect: Dialect,
    wanted: Collection[str],
    usual_length: tuple[float, float],
) -> dict[str, Any]:
    """Values for templates with kernels of these outputs for columns; `context` is that of `c`."""
    return {
        **c.sizes(context, interface),
        "vectors": c.in_vectors(program, interface, dialect, wanted),
        "quaternions": interface.quaternions,
        "shortest": repr(usual_length[0]),
        "longest": repr(usual_length[1]),
    }
