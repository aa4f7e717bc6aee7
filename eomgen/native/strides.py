"""Steps of adaptive methods in compiled code, with the bits of the same steps made in Python."""

import ctypes
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eomgen.engine.adaptive import EVENT, UNUSUAL, Bounds, Progress
from eomgen.engine.adaptive_steps import Records, Start
from eomgen.engine.branches import Switches
from eomgen.engine.crossings import MOST_PARTS, Watch
from eomgen.engine.methods import Root
from eomgen.engine.structures import address, filled, take, with_room
from eomgen.native import contact_runs
from eomgen.native.mechanism import Mechanism, made_margins
from eomgen.run import branches
from eomgen.run.compiled import MEMORY, Array, Stretch, Stride, Watched, WholeRun

ROOTS: list[Root] = [
    (name, {}) for name in ("adaptive_steps", "passed_over", "end_at", "normalised")
]
"""What steps call of the engine, beside the method."""
SOME = ("slopes", "errors", "jacobians", "factorisations", "terms")
"""The records that only some steps need."""
_NONE = np.empty(0)
_POINTER, _WHOLE, _REAL = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double

Between = Callable[[Progress, Array, Array, float, Array], None]
"""The state at a time in a step from a state, by its terms, as `engine.adaptive.within`."""


@dataclass(frozen=True, eq=False)
class Method:
    """The compiled steps of a method.

    call     the function that makes them
    memory   what determines its next step
    counts   what it counts beside derivatives, by the names of records
    wide     the number of terms of a step
    between  the states in it
    follows  whether the length of a step follows from the state where it begins
    """

    call: Any
    memory: tuple[str, ...]
    counts: tuple[str, ...]
    wide: int
    between: Between
    follows: bool = False


class _Checks(ctypes.Structure):
    """`Checks` of `templates/c/checks.c.jinja`, without what C begins with."""

    _fields_ = (
        *((name, _POINTER) for name in ("system", "run", "watch", "found")),
        *(("clear", _REAL), ("only_whole", _WHOLE), ("cuts", _WHOLE)),
        *((name, _POINTER) for name in ("margins", "switched", "values", "switches")),
        ("switching_calls", _WHOLE),
        *((name, _POINTER) for name in ("by", "at", "y", "raw")),
        *((name, _WHOLE) for name in ("sound", "is_event")),
    )


class Given(NamedTuple):
    """What C is given of steps, of which all else lives as long; and what it records of them, of
    branches and of constraints.
    """

    checks: ctypes.Structure
    at: ctypes.Structure
    start: ctypes.Structure
    records: ctypes.Structure
    kept: Records
    begun: Start
    system: Mechanism
    run: ctypes.Structure
    seen: "_Checked"
    switched: Array
    values: Array
    switches: NDArray[np.int64]
    margins: Array

    @property
    def addresses(self) -> tuple[int, ...]:
        """Those of what C is given."""
        return tuple(map(ctypes.addressof, self[:4]))


def prepared(method: Method, of: Mechanism, stretch: Stretch) -> Given:
    """What C is given of steps."""
    solver, most = stretch.solver, stretch.most
    watched, held, ny = stretch.watched, stretch.constrained, len(solver.y)
    seen = _Checked.of(watched, ny) if watched else _unchecked(ny)
    kept, records = _records(method, stretch)
    switched, values = np.empty(most), np.empty((most, seen.watch.many))
    switches, margins = np.zeros(most, np.int64), made_margins(held, most)
    system = of.holding(ny, held, stretch.touched)
    bounds = stretch.atol, stretch.rtol, stretch.longest, stretch.until
    run = filled(Bounds(*bounds, stretch.dense, stretch.reaches, stretch.counts_terms))
    at = filled(Progress(solver.t, length=0.0 if method.follows else float(solver.h_abs)))
    checks = _Checks(
        *map(ctypes.addressof, (system, run, *seen[2:])),
        watched.clear if watched else math.inf,
        *(stretch.only_whole, watched is not None and watched.unseen > 0.0),
        *map(address, (margins[1:], switched, values, switches)),
    )
    slope = getattr(solver, "f", solver.y)
    begun = Start(*map(np.ascontiguousarray, (solver.y, slope, solver.lost)))
    made = filled(begun)
    return Given(
        *(checks, at, made, records, kept, begun, system, run, seen),
        *(switched, values, switches, margins),
    )


def steps(method: Method, of: Mechanism, stretch: Stretch) -> Stride:
    """Steps of a method for a mechanism."""
    solver, most, touched = stretch.solver, stretch.most, stretch.touched
    is_held = touched is not None and touched.now.holds.any()
    given = prepared(method, of, stretch)
    if method.call.argtypes is None:
        method.call.restype, method.call.argtypes = _WHOLE, [_POINTER] * 4
    why = method.call(*given.addresses)
    kept = given.kept
    take(kept, given.records)
    n, switched, values = kept.made, given.switched, given.values
    counts = {name: getattr(kept, name) for name in ("derivatives", *method.counts)}
    counts["switches"] = given.switches
    if touched:
        contact_runs.taken(touched, given.system.kept[-1])
        counts |= touched.called_by(most)
        if is_held:  # then Jacobians are differences of derivatives
            counts["jacobians"] = np.zeros(most, np.int64)
    passed = int(kept.sampled[n - 1]) if n else 0  # not those of a step that was not made
    return Stride(
        kept.ends[:n],
        kept.states[:n],
        {name: getattr(kept, MEMORY[name])[:n] for name in method.memory},
        {name: so_far[:n] for name, so_far in counts.items()},
        kept.sampled[:n],
        kept.rows[:passed].copy(),  # the array for all rows to come is not kept with them
        why != UNUSUAL,
        why == EVENT,
        switched[:n],
        values[:n],
        partial(_within, method.between, (solver.t, given.begun.state), kept)
        if stretch.dense
        else None,
        given.margins[: n + 1] if stretch.constrained else None,
    )


def rows_of(method: Method, of: Mechanism, run: WholeRun) -> Array | None:
    """The rows of a run by a method, see `run.compiled.Compiled`."""
    given = prepared(method, of, run.stretch)
    records: Any = given.records
    given.kept.rows[0], records.passed = run.stretch.solver.y, 1
    if method.call.argtypes is None:
        method.call.restype = _WHOLE
        method.call.argtypes = [*[_POINTER] * 4, _REAL, _WHOLE]
    return given.kept.rows if method.call(*given.addresses, run.near, run.most) else None


def _records(method: Method, stretch: Stretch) -> tuple[Records, ctypes.Structure]:
    """Room for the records of steps and their rows, and what C is given of it."""
    ny, count, most = len(stretch.solver.y), len(stretch.times), stretch.most
    needed = {*(MEMORY[name] for name in method.memory), *method.counts, *["terms"] * stretch.dense}
    kept = with_room(
        Records,
        **{name: _NONE for name in SOME if name not in needed},
        most=most,
        STATES=ny,
        count=count,
        wide=method.wide,
        times=stretch.times,
        rows=np.empty((count, ny)),
    )
    return kept, filled(kept)


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
        watch = _watch(watched, states) if watched and watched.ends else branches.watch(0, states)
        last, unseen = (watched.switched, watched.unseen) if watched else (-math.inf, 0.0)
        found = branches.switches(states, watch.room, last=last, unseen=unseen)
        return _Checked(watch, found, filled(watch), filled(found))


@cache
def _unchecked(states: int) -> _Checked:
    """The same for steps that are not watched, which leave nothing there."""
    return _Checked.of(None, states)


def _watch(watched: Watched, states: int) -> Watch:
    """Room for the switching functions along steps, and what is known of them."""
    (earlier, before), (here, first) = watched.ends
    room = MOST_PARTS * len(first) if watched.unseen else branches.MOST_BRACKETS
    made = branches.watch(len(first), states, watched.angles, watched.timed, room=room)
    made.earlier, made.before[:], made.here, made.first[:] = earlier, before, here, first
    return made


def _within(
    between: Between, begun: tuple[float, Array], kept: Records, i: int, time: float
) -> Array:
    """The state at a time in step number i of those that begin at a time and a state."""
    start, first = (float(kept.ends[i - 1]), kept.states[i - 1]) if i else begun
    terms, place = kept.terms[kept.wide * i : kept.wide * (i + 1)], np.empty(len(first))
    between(Progress(start, float(kept.last_lengths[i])), first, terms, time, place)
    return place
