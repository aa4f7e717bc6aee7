"""What the page of a run computes with: the functions of its mechanism, in JavaScript."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from eomgen.base.errors import EomgenError
from eomgen.codegen.backends.javascript import mechanism
from eomgen.language.formula import Formula
from eomgen.model.model import Model
from eomgen.results.simulated import Simulated
from eomgen.run.module import load_module
from eomgen.scene.effects.elements import AtJoint
from eomgen.scene.look import number
from eomgen.show.drawing_data import drawing_data
from eomgen.show.live import live_table, set_by_hand, velocity_rows
from eomgen.show.motion import Array, Motion
from eomgen.show.page import PageCode
from eomgen.store import LiveCode, interfaced_program_of, live_code
from eomgen.study.recording import FOLLOWING
from eomgen.study.whole import names_of

LONGEST = 1_500_000
"""A page with longer functions than these characters is live only on request."""


def page_code(run: Simulated, motion: Motion, *, live: bool | None = None) -> PageCode:
    """The mechanism of the page of a run and its motion.

    A live one has functions for everything that the page can change. Otherwise they are those of
    the generated module; Taylor series, about as long as all the rest, are in the page of a run by
    them. With `live` None it is live unless that fails or would be too large; with
    true the errors of the derivation are raised.
    """
    events = tuple(
        {"t": event.t, "contact": event.contact, "kind": event.kind}
        for event in run.trajectory.events
        if event.kind != "impact"
    )
    geometry = drawing_data(motion)[1]
    series = run.simulation.integrator == "taylor"
    found, why = _live(run.model, geometry, live, series)
    code = _recorded(run, why) if found is None else _going_on(run, motion, found)
    return replace(code, smooth=not run.varying, events=events)


def _live(
    model: Model, geometry: Sequence[Formula], live: bool | None, series: bool
) -> tuple[LiveCode | None, str]:
    """The functions of a live page; None and why there are none."""
    if live is False:
        return None, ""
    try:
        code = live_code(model, geometry, series=series)
    except EomgenError as error:
        if live:
            raise
        return None, str(error)
    if live or len(code.source) <= LONGEST:
        return code, ""
    return None, f"its functions would take {len(code.source) / 1e6:.1f} MB"


def _limits(model: Model, motion: Motion) -> dict[str, list[float | None]]:
    """The lower and the upper limit of coordinates that have stops, at the scene's parameters."""
    found = {}
    for stop in motion.drawn.elements if motion.drawn else ():
        if isinstance(stop, AtJoint) and stop.kind == "stop":
            coordinate = model.bodies[stop.joint].positions[stop.coordinate]
            ends = (stop.low, stop.high)
            found[coordinate.name] = [None if end is None else number(end) for end in ends]
    return found


def _going_on(run: Simulated, motion: Motion, code: LiveCode) -> PageCode:
    """A mechanism that goes on from a run."""
    t, steps = run.trajectory.t, run.trajectory.counts["steps"]
    table = live_table(
        run.model,
        code,
        run.simulation,
        inputs=run.inputs,
        mean_step=float(t[-1] - t[0]) / steps if steps else None,
    )
    table["limits"] = _limits(run.model, motion)
    rows = _all_coordinates(run) if run.model.form == "velocity" else _velocity_rows(run)
    return PageCode(code.source, table, live=True, y=rows)


def _all_coordinates(run: Simulated) -> Array | None:
    """The rows of a run with what follows from its states; None if nothing does."""
    ran = run.trajectory
    following = ran.saved.get(FOLLOWING)
    if following is None:
        return None
    columns = dict(zip(ran.states, ran.y.T, strict=True))
    columns |= dict(zip(following.columns, following.values.T, strict=True))
    return np.column_stack([columns[name] for name in names_of(run.model)])


def _velocity_rows(run: Simulated) -> Array:
    """The rows of a run in momenta as [q, v]."""
    ran = run.trajectory
    module = load_module(run.module.reference or run.module.source)
    rates = module.derivative(ran.t, ran.y.T, run.model.defaults, run.inputs or None).T
    return velocity_rows(run.model, ran.states, ran.y, rates)


def _recorded(run: Simulated, why: str) -> PageCode:
    """The functions of the generated module: enough to show a run."""
    program, interface = interfaced_program_of(run.model)
    table = {
        "states": [{"name": s.name, "unit": s.unit, "kind": "other"} for s in interface.states],
        "quaternions": [],
        "parameters": set_by_hand(interface.parameters),
        "inputs": set_by_hand(interface.inputs, run.inputs),
        "effects": [],
        "loads": [],
        "operations": 0,
        "joints": list(run.model.force_joints),
    }
    return PageCode(mechanism(program, interface), table, live=False, why=why)
