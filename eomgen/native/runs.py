"""Whole steps of a method in compiled code, with the bits of the same steps made in Python."""

import ctypes
import math
from collections.abc import Mapping
from functools import partial
from typing import NamedTuple

import numpy as np

from eomgen.base.templating import render
from eomgen.codegen.backends import c
from eomgen.codegen.interface import Interface
from eomgen.engine.adaptive import UNUSUAL, Bounds, Progress, Records, Start
from eomgen.engine.branches import Switches
from eomgen.engine.crossings import Watch
from eomgen.engine.embedded import DOP853
from eomgen.engine.methods import Root
from eomgen.native import contact_runs, equal_steps
from eomgen.native.functions import restricted
from eomgen.native.mechanism import Mechanism, made_margins
from eomgen.native.mechanism import context as of_mechanism
from eomgen.native.strides import records_of, stride
from eomgen.program.program import Program
from eomgen.run import branches
from eomgen.run.compiled import Array, Stretch, Stride, Watched
from eomgen.run.integrators.dormand_prince_8 import interpolated
from eomgen.subset.structures import address, filled

MAIN = "runs.c"
CHECKS: list[Root] = [(name, {}) for name in ("passed_over", "end_at")]
_POINTER, _WHOLE, _REAL = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double


def sources(program: Program, interface: Interface) -> Mapping[str, str]:
    """The C sources of the derivative and of the methods that step with it."""
    # Imported here because runs whose library is in the store do without the printer.
    from eomgen.engine.printed import c_source
    from eomgen.subset.languages import C

    of_contacts = contact_runs.context(interface)
    program, interface = restricted(program, interface, ("derivative",))
    roots = [*equal_steps.roots_of(*equal_steps.METHODS), ("equal_steps", {})]
    roots += [("made_many", {"method": DOP853}), *CHECKS]
    roots += contact_runs.ROOTS if of_contacts["contacts"] else []
    context = {
        "prefix": interface.name,
        "main": c.MAIN,
        "states": len(interface.states),
        "quaternions": interface.quaternions,
        "engine": C.prelude + c_source(roots),
        **of_contacts,
        **of_mechanism(),
        **equal_steps.context(interface),
    }
    main = render(c.TEMPLATES, "runs.c.jinja", context)
    return {**c.library(program, interface), MAIN: main}


class _Checks(ctypes.Structure):
    """`Checks` of `templates/c/checks.c.jinja`, without what C begins with."""

    _fields_ = (
        *((name, _POINTER) for name in ("system", "run", "watch", "found")),
        ("clear", _REAL),
        *((name, _POINTER) for name in ("margins", "switched", "values", "switches")),
        ("switching_calls", _WHOLE),
        *((name, _POINTER) for name in ("at", "y", "raw", "last", "k", "terms")),
        ("sound", _WHOLE),
    )


def dop853(of: Mechanism, library: ctypes.CDLL, stretch: Stretch) -> Stride:
    """Steps of DOP853."""
    watched, solver, most = stretch.watched, stretch.solver, stretch.most
    ny = len(solver.y)
    seen = _Checked.of(watched, ny)
    kept, records = records_of(
        stretch, most, **({} if stretch.dense else {"terms": np.empty((0, ny))})
    )
    switched, values = np.empty(most), np.empty((most, seen.watch.many))
    switches, touched = np.zeros(most, np.int64), stretch.touched
    margins = made_margins(stretch.constrained, most)
    system = of.holding(ny, stretch.constrained, touched)
    bounds = stretch.atol, stretch.rtol, stretch.longest, stretch.until
    run = filled(Bounds(*bounds, stretch.dense, stretch.reaches))
    at = filled(Progress(solver.t, length=float(solver.h_abs)))
    checks = _Checks(
        *map(ctypes.addressof, (system, run, *seen[2:])),
        watched.clear if watched else math.inf,
        *map(address, (margins[1:], switched, values, switches)),
    )
    begun = Start(*map(np.ascontiguousarray, (solver.y, solver.f, solver.lost)))
    start = filled(begun)
    call = library.dop853
    call.restype, call.argtypes = _WHOLE, [_POINTER] * 4
    why = call(*map(ctypes.addressof, (checks, at, start, records)))
    counts, n = {"switches": switches}, records.made
    counts |= touched.called_by(most) if touched else {}
    return stride(
        *(kept, records, ("h_abs", "f", "lost"), why != UNUSUAL, counts),
        switched=switched[:n],
        values=values[:n],
        within=partial(_within, (solver.t, solver.y), kept) if stretch.dense else None,
        margins=margins[: n + 1] if stretch.constrained else None,
    )


class _Checked(NamedTuple):
    """Room for the switching functions along steps and for the switches found, and both as C has
    them.
    """

    watch: Watch
    found: Switches
    of_watch: ctypes.Structure
    of_found: ctypes.Structure

    @staticmethod
    def of(watched: Watched | None, states: int) -> "_Checked":
        """The room, with what is known of the functions."""
        watch = _watch(watched, states)
        found = branches.switches(states, last=watched.switched if watched else -math.inf)
        return _Checked(watch, found, filled(watch), filled(found))


def _watch(watched: Watched | None, states: int) -> Watch:
    """Room for the switching functions along steps, and what is known of them."""
    if not (watched and watched.ends):
        return branches.watch(0, states)
    (earlier, before), (here, first) = watched.ends
    made = branches.watch(len(first), states, watched.angles, watched.timed)
    made.earlier, made.before[:], made.here, made.first[:] = earlier, before, here, first
    return made


def _within(begun: tuple[float, Array], kept: Records, i: int, time: float) -> Array:
    """The state at a time in step number i of those that begin at a time and a state."""
    start, first = (float(kept.ends[i - 1]), kept.states[i - 1]) if i else begun
    terms = kept.terms[7 * i : 7 * i + 7]
    return interpolated(start, float(kept.ends[i]) - start, first, terms, time)
