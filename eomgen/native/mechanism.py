"""What compiled steps are given of a mechanism: functions, which lie in libraries of their own,
constraints, and rigid contacts.
"""

import ctypes
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from eomgen.engine.projection import PROJECTED
from eomgen.native import contact_runs
from eomgen.native.functions import constants_of
from eomgen.native.module import Kernels, outputs_of
from eomgen.run import margins
from eomgen.run.compiled import Array, Constrained, Touched
from eomgen.run.integrators.strides import OF_STATE
from eomgen.run.projection import PROJECTS

KERNELS = ("derivative", "jacobian")
"""The functions that are called as kernels."""
FUNCTIONS = (
    *KERNELS,
    *PROJECTS,
    *("constraint_rates", "constraint_jacobian", "mass_matrix", "kinetic_slopes"),
    "implicit_step",
    *OF_STATE,
    *contact_runs.FUNCTIONS,
)
"""The functions that steps call."""
ROOM = ("rates", "nominal", "stages", "room")
"""What steps of some methods work with."""
_POINTER, _WHOLE, _REAL = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double


class Function(ctypes.Structure):
    """`function` of `templates/c/mechanism.c.jinja`."""

    _fields_ = (("value", _POINTER), ("k", _POINTER), ("count", _WHOLE))


class Mechanism(ctypes.Structure):
    """`Mechanism` of `templates/c/mechanism.c.jinja`; `kept` lives as long."""

    _fields_ = (
        *((name, Function) for name in FUNCTIONS),
        *((name, _POINTER) for name in ("inputs", "onto", "events")),
        ("many", _WHOLE),
        *((name, _POINTER) for name in ("quaternions", *ROOM)),
    )
    kept: tuple[Any, ...]

    def having(self, *kept: Any, **pointers: int) -> "Mechanism":
        """A copy with pointers to what is to be kept."""
        made = type(self).from_buffer_copy(self)
        for name, pointer in pointers.items():
            setattr(made, name, pointer)
        made.kept = (self, *kept)
        return made

    def holding(
        self, states: int, constrained: Constrained | None, touched: Touched | None
    ) -> "Mechanism":
        """The same for steps of so many states, with their constraints and rigid contacts."""
        if constrained is None and touched is None:
            return self
        made = self.having(constrained, touched)
        if constrained is not None:
            onto = _constraints(made, states, constrained)
            made.onto, made.kept = ctypes.addressof(onto), (*made.kept, onto)
        if touched is not None:
            events = contact_runs.events(made, touched)
            made.events, made.kept = ctypes.addressof(events), (*made.kept, events)
        return made


class Given(NamedTuple):
    """A module at given parameters and inputs, and the libraries of its functions, by name.

    origin  the module that had the constants of its parameters, if this one has perturbed ones
    """

    module: Any
    libraries: Mapping[str, ctypes.CDLL]
    values: tuple[Any, Any]
    origin: Any = None


def mechanism(given: Given) -> Mechanism | None:
    """What steps are given; None if kernels cannot compute with the parameters or inputs. The
    constants are those that the module computes, also where it is a perturbed one.
    """
    module, libraries, (p, u), origin = given
    quaternions = np.array(sum(module.QUATERNIONS, ()), np.int64)
    made, kept = Mechanism(), list[Any]([given, quaternions])
    made.many, made.quaternions = len(quaternions) // 4, quaternions.ctypes.data
    for name in filter(FUNCTIONS.__contains__, libraries):
        library = libraries[name]
        kernels = Kernels(module, library)
        constants, inputs = constants_of(kernels, name, p, origin), kernels.given(u)
        if constants is None or inputs is None:
            return None
        place = library[f"{module.NAME if name in KERNELS else 'checked'}_{name}"]
        value, k = (ctypes.cast(each, _POINTER) for each in (place, constants))
        setattr(made, name, Function(value, k, math.prod(outputs_of(library)[name])))
        made.inputs = inputs.ctypes.data
        kept += [constants, inputs]
    made.kept = tuple(kept)
    return made


def unconstrained(quaternions: Sequence[tuple[int, ...]], stages: Array) -> Mechanism:
    """What steps are given that call no function of a mechanism, but take the numbers `stages`."""
    each = np.array(sum(quaternions, ()), np.int64)
    made = Mechanism(many=len(quaternions), quaternions=each.ctypes.data, stages=stages.ctypes.data)
    made.kept = each, stages
    return made


class Constraints(ctypes.Structure):
    """`constraints` of `templates/c/projection.c.jinja`."""

    _fields_ = (
        *((name, _POINTER) for name in ("of", "sizes")),
        *((name, _WHOLE) for name in ("states", "rows")),
        *((name, _REAL) for name in ("start", "earlier", "t", "here")),
        *((name, _POINTER) for name in ("before", "after", "in_step", "room")),
    )
    kept: Any


def _constraints(of: Mechanism, states: int, given: Constrained) -> Constraints:
    rows = of.constraint_residuals.count
    sizes = np.ascontiguousarray(given.sizes)
    in_step, room = np.zeros(2 * rows), np.empty(3 * rows + states)
    made = Constraints(
        ctypes.addressof(of),
        *(sizes.ctypes.data, states, rows),
        *(x for pair in given.margins for x in pair),
        *(array.ctypes.data for array in (given.before, given.after, in_step, room)),
    )
    made.kept = given, sizes, in_step, room
    return made


def context() -> dict[str, Any]:
    """The values of the templates."""
    # Imported here because runs whose library is in the store do without the printer.
    from eomgen.engine.printed import c_source

    return {
        "functions": FUNCTIONS,
        "projection": c_source([("moved_onto", {})]),
        "on_constraints": PROJECTED,
        "near": repr(margins.NEAR),
        "singular": repr(margins.SINGULAR),
    }


def made_margins(constrained: Constrained | None, most: int) -> Array:
    """Space for the least margins at the start of `most` steps, which is known, and at their ends;
    (0,) without constraints.
    """
    if constrained is None:
        return np.empty(0)
    return np.full(most + 1, constrained.margins[1][1])
