"""What compiled steps are given of rigid contacts; their functions lie in other libraries."""

import ctypes
from collections.abc import Mapping
from typing import Any

from eomgen.codegen.interface import Interface
from eomgen.engine import contact_runs
from eomgen.engine.contact_times import SHARE
from eomgen.engine.structures import filled, take
from eomgen.run.compiled import Touched

ROOTS: list[tuple[str, Mapping[str, Any]]] = [("taken", {}), ("strike", {})]
"""What is called of the engine."""
WHOLE_RUNS: list[tuple[str, Mapping[str, Any]]] = [("begins_anew", {}), ("goes_on", {})]
"""The same for runs from start to end by methods with tolerances, then with events of contacts."""
THROUGH_EVENTS: list[tuple[str, Mapping[str, Any]]] = [*WHOLE_RUNS, ("through_events", {})]
FUNCTIONS = ("gaps", "gap_rates", "held", "impact")
_POINTER, _REAL, _WHOLE = ctypes.c_void_p, ctypes.c_double, ctypes.c_int64


class Events(ctypes.Structure):
    """`Events` of `templates/c/contact_runs.c.jinja`."""

    _fields_ = (
        *((name, _POINTER) for name in ("of", "sizes", "now", "at", "slack")),
        *((name, _REAL) for name in ("t", "end")),
        *(("calls", _POINTER), ("called", _WHOLE * 3), ("made", _WHOLE), ("sound", _WHOLE)),
        *((name, _POINTER) for name in ("y", "last", "method", "checks")),
    )
    kept: Any


def sizes(interface: Interface) -> dict[str, int]:
    """The number of contacts, and that of the results of `held`."""
    shapes = {function.name: function.shape for function in interface.functions}
    many = len(interface.contacts)
    return {"contacts": many, "pressed": shapes["held"][0] if many else 0}


def values(contacts: int, pressed: int) -> dict[str, Any]:
    """The values of the template, for so many contacts and results of `held`."""
    codes = {"whole": contact_runs.WHOLE, "opened": contact_runs.OPENED}
    return {"contacts": contacts, "pressed": pressed, **codes, "share": repr(SHARE)}


def events(of: ctypes.Structure, touched: Touched) -> Events:
    """What C is given of the contacts of a `native.mechanism.Mechanism`."""
    now, at = filled(touched.now), filled(touched.at)
    made = Events(
        *(ctypes.addressof(of), touched.sizes.ctypes.data),
        *(ctypes.addressof(record) for record in (now, at)),
        touched.slack.ctypes.data,
        calls=touched.calls.ctypes.data,
        sound=1,
    )
    made.kept = now, at
    return made


def taken(touched: Touched, made: Events) -> None:
    """Give it the numbers that C has computed."""
    now, at = made.kept
    take(touched.now, now)
    take(touched.at, at)


def strikes(call: Any, of: ctypes.Structure, touched: Touched) -> int | None:
    """Let contacts strike at the place of `touched`, see `engine.contacts.strike`; None if Python
    must.
    """
    call.restype, call.argtypes = _WHOLE, [_POINTER]
    made = events(of, touched)
    answer: int = call(ctypes.byref(made))
    taken(touched, made)
    return None if answer < 0 else answer
