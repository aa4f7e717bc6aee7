"""Whole steps of a method in compiled code, with the bits of the same steps made in Python."""

import ctypes
from collections.abc import Iterable, Mapping
from typing import Any

from eomgen.base.templating import render
from eomgen.codegen.backends import c
from eomgen.codegen.interface import Interface
from eomgen.engine.adaptive import within
from eomgen.engine.embedded import DOP853
from eomgen.native import contact_runs, equal_steps, strides
from eomgen.native.functions import restricted
from eomgen.native.mechanism import Mechanism
from eomgen.native.mechanism import context as of_mechanism
from eomgen.program.program import Program
from eomgen.run.compiled import Array, Stretch, Stride, WholeRun
from eomgen.run.integrators.strides import OF_STATE

MAIN = "runs.c"


def sources(
    program: Program, interface: Interface, beside: Iterable[str] = (), *, equal: bool = True
) -> Mapping[str, str]:
    """The C sources of the derivative, of outputs `beside` it, and of the methods that step with
    it: DOP853 and, if wanted, those with equal steps.
    """
    # Imported here because runs whose library is in the store do without the printer.
    from eomgen.engine.printed import c_source
    from eomgen.subset.languages import C

    of_contacts = contact_runs.values(**contact_runs.sizes(interface))
    switches = any(function.name in OF_STATE for function in interface.functions)
    program, interface = restricted(program, interface, ("derivative", *beside))
    own = [*equal_steps.roots_of(*equal_steps.METHODS), ("equal_steps", {})]
    roots = [*(own if equal else ())]
    roots += [(name, {"method": DOP853}) for name in ("explicit_step", "interpolate")]
    roots += [("within", {}), *strides.ROOTS]
    if of_contacts["contacts"]:
        roots += [*contact_runs.ROOTS, *contact_runs.THROUGH_EVENTS]
    elif switches:
        roots += contact_runs.WHOLE_RUNS
    context = {
        "prefix": interface.name,
        "main": c.MAIN,
        "states": len(interface.states),
        "last": DOP853.last,
        "equal": equal,
        "adaptive": True,
        "whole_runs": switches or of_contacts["contacts"],
        "engine": C.prelude + c_source(roots),
        **of_contacts,
        **of_mechanism(),
        **equal_steps.context(interface),
    }
    main = render(c.TEMPLATES, "runs.c.jinja", context)
    return {**c.library(program, interface), MAIN: main}


def method(call: Any, *memory: str) -> strides.Method:
    """DOP853, by a function that makes its steps."""
    return strides.Method(call, memory or ("h_abs", "f", "lost"), (), 7, within)


def dop853(of: Mechanism, library: ctypes.CDLL, stretch: Stretch) -> Stride:
    """Steps of DOP853."""
    return strides.steps(method(library.adaptive), of, stretch)


def held(of: Mechanism, library: ctypes.CDLL, stretch: Stretch) -> Stride:
    """Those by which contacts are held between steps by Taylor series."""
    return strides.steps(method(library.held_steps, "h_abs", "lost"), of, stretch)


def through(of: Mechanism, library: ctypes.CDLL, run: WholeRun) -> Array | None:
    """The rows of a run by DOP853, see `run.compiled.Compiled`."""
    return strides.rows_of(method(library.through), of, run)
