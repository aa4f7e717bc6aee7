"""Compiled steps of equal length for columns of states, one in each lane of vector registers.

They have the bits of `eomgen.run.columns`, whatever the number of lanes and their neighbours. What
raises a flag of the floating-point unit is left to that.
"""

import ctypes
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eomgen.base.templating import render
from eomgen.codegen.backends import c, c_lanes
from eomgen.codegen.interface import Interface
from eomgen.engine.contacts import TOLERANCE
from eomgen.engine.printed import CONTACT_STEPS, c_source
from eomgen.engine.structures import address
from eomgen.model.model import Model
from eomgen.native import contact_runs, equal_steps, functions
from eomgen.native.accelerator import library_key
from eomgen.native.compiler import NOT_JOINED, find_compiler
from eomgen.native.implicit import OWN_STEPS
from eomgen.native.lanes import FLAGS, Columns, Lanes, columns_of, width
from eomgen.native.library import compiled_library
from eomgen.native.mechanism import Given, Mechanism, mechanism
from eomgen.native.mechanism import context as of_mechanism
from eomgen.program.ordering import ordered
from eomgen.program.program import Program
from eomgen.program.tape import TIME
from eomgen.run.compiled import Constrained
from eomgen.run.problem import USUAL_LENGTH, FloatArray
from eomgen.run.projection import PROJECTS, Projection
from eomgen.store import interfaced_program_of
from eomgen.subset.languages import VECTORS, C

MAIN = "stepper.c"
METHODS = ("rk4", *(name for name in equal_steps.METHODS if name != "rk4"), OWN_STEPS)
_POINTER, _LONG, _REAL, _WHOLE = ctypes.c_void_p, ctypes.c_long, ctypes.c_double, ctypes.c_int64


Limits = tuple[Sequence[float], Sequence[float]]
"""Of rigid contacts: the sizes of their gaps, and the speeds below which they do not bounce, in
these; negative if not given."""
FEW = 16
"""Below this number of states, two vectors of each are stepped together."""


def sources(
    program: Program, interface: Interface, method: str, limits: Limits = ((), ())
) -> Mapping[str, str]:
    """The C sources of the derivative and of a method of `METHODS` for columns, name to text."""
    law = contact_runs.FUNCTIONS if interface.contacts else ()
    resisted = ("implicit_step",) if method == OWN_STEPS else ()
    kept = ("derivative", "initial_state", *law, *resisted)
    of_contacts = contact_runs.sizes(interface)
    program, interface = functions.restricted(program, interface, kept)
    program = ordered(program)
    context = c.context(program, interface)
    states = len(interface.states)
    own = equal_steps.context(interface)
    timed = any(step.value == TIME for step in program.steps if step.operation == "input")
    alone = method in equal_steps.LEAPFROGS or timed or interface.contacts
    together = 2 if states < FEW and not alone else 1
    parts = method in ("leapfrog_4", "leapfrog_6")
    call = f"composed_{method}(m, t, y, h, step)" if parts else equal_steps.CALLS.get(method, "")
    contact_steps = (*CONTACT_STEPS, ("add_compensated", {}))
    values: dict[str, Any] = {
        **c_lanes.columns(
            program, interface, context, c.VECTORS, ("derivative", *law, *resisted), USUAL_LENGTH
        ),
        **of_mechanism(),
        **of_contacts,
        "gap_sizes": list(map(repr, limits[0])),
        "rest": list(map(repr, limits[1])),
        "tolerance": repr(TOLERANCE),
        "of_numbers": C.prelude + c_source([("normalised", {}), *(contact_steps if law else ())]),
        "engine": c_source(equal_steps.roots_of(method), VECTORS),
        "positions": [i + n * states for n in range(together) for i in own["positions"]],
        "others": [i + n * states for n in range(together) for i in own["others"]],
        "together": together,
        "resisted": bool(resisted),
        "call": call,
        "part": equal_steps.CALLS["leapfrog"] if parts else "",
    }
    return {**c.files_of(context, interface), MAIN: render(c.TEMPLATES, "stepper.c.jinja", values)}


class _Call(ctypes.Structure):
    """`call` of `templates/c/stepper.c.jinja`."""

    _fields_ = (
        ("dt", _REAL),
        ("steps", _WHOLE),
        ("more", _POINTER),
        ("held", _POINTER),
        *((name, Columns) for name in ("t", "y", "k", "u", "first")),
        *((name, _POINTER) for name in ("again", "out", "lost", "sound")),
    )


class Beside(NamedTuple):
    """What is given beside states, each in columns or in one for all: times (1, n), constants of
    parameters (nk, n), inputs (nu, n), and states (ny, n) to begin with again.
    """

    t: Columns
    k: Columns
    u: Columns
    first: Columns | None = None


class CompiledSteps(Lanes):
    """The compiled steps of a model's module by a method of `METHODS`.

    rates  the matrix by which velocities give the rates of positions, which leapfrog needs
    projection  of the module, or None
    limits of its rigid contacts

    It has no state beside the library, so that threads may share it. Raises `RunError` if there is
    no compiler, or if it fails.
    """

    main = MAIN

    def __init__(
        self,
        model: Model,
        module: Any,
        method: str,
        dt: float,
        rates: FloatArray | None,
        projection: Projection | None,
        limits: Limits,
    ) -> None:
        compiler, lanes = find_compiler(), width()
        joined = tuple(flag for flag in compiler.tuning if flag == NOT_JOINED)
        flags = (f"-DWIDTH={lanes}", *FLAGS[lanes], *compiler.ordering, *joined)
        about = f"{library_key(model, 'stepper')} {method} {flags} {limits}"

        def texts() -> Mapping[str, str]:
            return sources(*interfaced_program_of(model), method, limits)

        self.library = compiled_library(about, texts, MAIN, *flags)
        sizes = (_LONG * 5).in_dll(self.library, "sizes")
        self.states, self.inputs, self.parameters, self.constants, self.lanes = sizes
        self._call = self.library.steps
        self._call.argtypes, self._call.restype = [_POINTER, _LONG], None
        self._module, self._dt, self._rates, self._projection = module, dt, rates, projection
        self._beside = {
            name: compiled_library(
                library_key(model, name), partial(_function, model, name), c.MAIN
            )
            for name in (PROJECTS if projection else ())
        }
        self._own = mechanism(Given(module, self._beside, (None, None)))

    def __call__(
        self,
        y: FloatArray,
        out: FloatArray,
        given: Beside,
        *,
        p: FloatArray | None,
        steps: int,
        lost: FloatArray | None = None,
        again: NDArray[np.bool_] | None = None,
    ) -> NDArray[np.int8]:
        """Make steps from states y (ny, n) into `out`, and update `lost`. Returns which columns are
        made, (n,); others are not written.

        p      parameters of which the constants are, (np,); None for the scene's own
        again  columns that become a column of `given.first` instead
        """
        n = y.shape[1]
        sound = np.zeros(n, dtype=np.int8)
        keeps = self._constraints(p)
        if self._projection and keeps is None:
            return sound
        (states,) = columns_of(y)
        call = _Call(
            self._dt,
            steps,
            None if self._rates is None else self._rates.ctypes.data,
            keeps and keeps.onto,
            *(given.t, states, given.k, given.u, given.first or states),
            None if again is None else address(again),
            address(out),
            None if lost is None else address(lost),
            address(sound),
        )
        self._call(ctypes.byref(call), n)
        return sound

    def _constraints(self, p: FloatArray | None) -> Mechanism | None:
        """What C is given of the constraints; None if there are none, or no kernels for them."""
        if self._projection is None or (p is not None and p.ndim == 2):
            return None
        found = self._own if p is None else mechanism(Given(self._module, self._beside, (p, None)))
        if found is None:
            return None
        of, rows = self._projection, len(self._projection.names)
        none = (np.zeros(rows), np.zeros(rows), ((0.0, 0.0), (0.0, 0.0)))
        given = Constrained(of.sizes, *none)
        return found.holding(self.states, given, None)


def _function(model: Model, name: str) -> Mapping[str, str]:
    return functions.sources(*interfaced_program_of(model), name)
