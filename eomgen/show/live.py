"""What the page of a run knows of its mechanism, as a table for JSON: names, units, values."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any, Protocol

import numpy as np

from eomgen.codegen.sampling import clock_values, sampling_labels
from eomgen.model.interactive import interactive, switches_of
from eomgen.model.model import Model
from eomgen.model.states import velocity_states
from eomgen.run.integrators import FixedStep, find_integrator
from eomgen.run.problem import FloatArray
from eomgen.run.sizes import mechanism_size
from eomgen.scene.schema import Simulation
from eomgen.show.balance import keeps_energy
from eomgen.show.notation import parsed

LETTERS = {"angle": "θ", "slide": "s", "x": "x", "y": "y", "z": "z"}
"""Letters of the coordinates of a joint that have no name in the scene, by the end of the name."""


class Code(Protocol):
    """What the page computes with: see `store.LiveCode`."""

    @property
    def loads(self) -> tuple[tuple[str, str], ...]:
        """The names of effect and body of each load."""

    @property
    def operations(self) -> int:
        """Operations of one call of `derivative`."""

    @property
    def saved(self) -> Mapping[str, int]:
        """Operations that leaving out each effect saves."""


def live_table(
    model: Model,
    code: Code,
    simulation: Simulation,
    *,
    inputs: Mapping[str, float] | None = None,
    mean_step: float | None = None,
) -> dict[str, Any]:
    """The entries of the page's data that describe the mechanism, in the order of the functions'
    arguments and results.

    inputs     values of inputs that are not their defaults
    mean_step  the mean step of a run of the scene by an adaptive method, s, which shows how fast
               the motion is; None if there was none
    """
    live, switches = interactive(model), switches_of(model)
    parameters = [p.name for p in live.parameters]
    given = inputs or {}
    states = velocity_states(live)
    values = (*live.initial_q, *live.initial_v, *(x.initial for x in live.extra))
    units = {s.name: s.unit for s in states} | {p.name: p.unit for p in live.parameters}
    start = dict(zip((s.name for s in states), values, strict=True))
    moving = len(live.coordinates) + len(live.velocities)
    return {
        "name": model.name,
        "dimensions": model.dimensions,
        "form": live.form,
        "states": [
            {"name": s.name, "unit": s.unit, "kind": _kind(s.position, i < moving)}
            for i, s in enumerate(states)
        ],
        "quaternions": [list(four) for four in live.quaternions],
        "parameters": set_by_hand(live.parameters),
        "inputs": set_by_hand(live.inputs, given),
        "bodies": [body.name for body in live.bodies],
        "joints": list(live.force_joints),
        "effects": [
            {
                "name": e.name,
                "type": e.type,
                "switch": parameters.index(switches[e.name]) if e.name in switches else None,
                "operations": code.saved.get(e.name, 0),
            }
            for e in model.effects
        ],
        "loads": [{"effect": effect, "body": body} for effect, body in code.loads],
        "operations": code.operations,
        "rates": [_rate(c.acceleration) for c in live.velocities],
        "constraints": [name for name, _ in live.rows],
        "pointer": {"first": len(model.inputs), "perBody": 3 if model.dimensions == 2 else 6},
        "initial": list(values),
        "size": float(mechanism_size(units, live.defaults, start)),
        "mass": sum(model.value(body.mass) for body in model.bodies),
        "span": simulation.t_end,
        "restSpeed": simulation.rest_speed,
        "keepsEnergy": keeps_energy(model, given),
        "integrator": _integrator(simulation),
        "clocks": _clocks(live),
        "meanStep": mean_step,
    }


def _clocks(model: Model) -> dict[str, Any] | None:
    """The clocks of what samples, see `engine.sampling.Clocks`; None if nothing does."""
    labels = sampling_labels(model, [s.name for s in velocity_states(model)])
    return asdict(clock_values(labels)) if labels else None


class Settable(Protocol):
    """A parameter or an input."""

    @property
    def name(self) -> str: ...
    @property
    def default(self) -> float: ...
    @property
    def unit(self) -> str: ...
    @property
    def about(self) -> str: ...


def set_by_hand(
    every: Iterable[Settable], given: Mapping[str, float] | None = None
) -> list[dict[str, Any]]:
    """The entries of parameters or inputs, whose values may be `given`."""
    return [
        {
            "name": each.name,
            "value": (given or {}).get(each.name, each.default),
            "unit": each.unit,
            "about": each.about,
        }
        for each in every
    ]


def velocity_rows(
    model: Model, states: Sequence[str], y: FloatArray, rates: FloatArray
) -> FloatArray:
    """The states [q, v] (n, ny) of rows `y` (n, …) of a form of momenta, whose time derivatives are
    `rates`; the rows themselves if the form is [q, v].

    The coordinates are states or differences of angles of bodies: v is the same of `rates`.
    """
    if model.form == "velocity":
        return y
    place = {name: i for i, name in enumerate(states)}
    angles = [
        place[b.positions[-1].name if b.parent < 0 else f"angle_{b.name}"] for b in model.bodies
    ]

    def coordinates(rows: FloatArray) -> list[FloatArray]:
        columns = []
        for k, body in enumerate(model.bodies):
            columns += [rows[:, place[c.name]] for c in body.positions[:-1]]
            above = rows[:, angles[body.parent]] if body.parent >= 0 else 0.0
            columns.append(rows[:, angles[k]] - above)
        return columns

    return np.column_stack([*coordinates(y), *coordinates(rates)])


def _rate(name: str) -> dict[str, Any]:
    """How the time derivative of a velocity is written: a letter, its dots, and a subscript.

    A name without a letter of its own is written as it is, but for those that joints give.
    """
    stem = name.removesuffix("_ddot").removesuffix("_dot")
    dots = 2 if name.endswith("_ddot") else 1
    written = parsed(stem)
    if written.single:
        return {"letter": written.letter, "dots": dots, "below": ",".join(written.below)}
    joint, _, last = stem.rpartition("_")
    if joint and last in LETTERS:
        return {"letter": LETTERS[last], "dots": dots, "below": joint}
    if joint and last in ("wx", "wy", "wz") and dots == 1:
        return {"letter": "ω", "dots": dots, "below": f"{joint},{last[1]}"}
    return {"letter": stem, "dots": dots, "below": ""}


def _integrator(simulation: Simulation) -> dict[str, Any]:
    """The method that the scene names, and its step, s; None if it chooses its steps."""
    fixed = isinstance(find_integrator(simulation.integrator), FixedStep)
    return {"name": simulation.integrator, "step": simulation.dt if fixed else None}


def _kind(position: bool, moving: bool) -> str:
    if position:
        return "position"
    return "velocity" if moving else "other"
