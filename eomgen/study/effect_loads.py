"""The forces of an effect along a run, on bodies and on coordinates."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from eomgen.base.errors import RunError
from eomgen.dynamics.dynamics import Dynamics
from eomgen.dynamics.start.diagnostics import values_at
from eomgen.model.effects import sliding_in
from eomgen.run.problem import FloatArray
from eomgen.scalars.floats import ArrayScalars
from eomgen.scene.effects import Effect
from eomgen.scene.effects.base import JointLoad, Load
from eomgen.scene.joints.base import WORLD
from eomgen.study.observed import Observed
from eomgen.study.whole import whole_of

PARTS = {2: ("fx", "fy", "mz"), 3: ("fx", "fy", "fz", "mx", "my", "mz")}
"""Of a force and a moment; moments that are 0 throughout are left out."""
Component = tuple[tuple[str, ...], str, FloatArray]
"""The names of a component, its unit, and its values (n,)."""


def components_of(
    effect: Effect, run: Observed, t: FloatArray, y: FloatArray, argument: str
) -> list[Component]:
    """The components of an effect's forces at states (n, ny).

    (body, "fx") …   force and moment on a body about its centre of mass, N and N m, world axes
    (coordinate,)    torque or force on a joint's coordinate, N m or N

    Raises `RunError` if it exerts none that the states determine.
    """
    model = run.model
    if model.form != "velocity":
        raise RunError(f"{argument}: forces of effects are known for form = 'velocity' only")
    parameters, inputs = run.values(t)
    whole = whole_of(run.functions, model, t, y.T, parameters, inputs)
    varying = isinstance(inputs, np.ndarray)
    given = dict(zip(run.functions.INPUTS, inputs, strict=True)) if varying else inputs or {}
    values: Any = values_at(model, t, whole, run.parameters, given)  # type: ignore[arg-type]
    with np.errstate(all="ignore"):
        d = Dynamics(model, values, ArrayScalars())
        loads = list(effect.loads(d))
        found = [*_on_bodies(d, loads), *_on_coordinates(run, loads)]
    if not found:
        hint = "it is a constraint or a rigid contact"
        raise RunError(f"{argument}: {effect.name} has no forces that follow from states: {hint}")
    return [(name, unit, np.broadcast_to(x, t.shape)) for name, unit, x in found]


def _on_bodies(d: Dynamics, loads: Sequence[Any]) -> Iterator[Component]:
    sums: dict[str, list[Any]] = {}
    for load in loads:
        if isinstance(load, Load) and load.body != WORLD:
            parts = _about_centre(d, load)
            before = sums.get(load.body, [0.0] * len(parts))
            sums[load.body] = [a + b for a, b in zip(before, parts, strict=True)]
    for body, parts in sums.items():
        for name, value in zip(PARTS[d.model.dimensions], parts, strict=True):
            if name[0] == "f" or np.any(value):
                yield (body, name), "N" if name[0] == "f" else "N m", value


def _about_centre(d: Dynamics, load: Load) -> list[Any]:
    """The force of a load, and its moment about the centre of mass of its body."""
    n = d.model.dimensions
    zero = (0.0,) * n
    at, centre = (d.position(load.body, x) for x in (load.at, zero))
    arm = [a - b for a, b in zip(at, centre, strict=True)]
    x, y, *z = arm
    fx, fy, *fz = load.force
    moment = [x * fy - y * fx]
    if n == 3:
        moment = [y * fz[0] - z[0] * fy, z[0] * fx - x * fz[0], *moment]
    turning = load.torque or (0.0,) * len(moment)
    return [*load.force, *(a + b for a, b in zip(moment, turning, strict=True))]


def _on_coordinates(run: Observed, loads: Sequence[Any]) -> Iterator[Component]:
    model = run.model
    sliding = sliding_in(model.bodies, model.dimensions)
    sums: dict[str, Any] = {}
    for load in loads:
        if isinstance(load, JointLoad):
            body = next(body for body in model.bodies if body.joint.name == load.joint)
            name = body.velocities[load.coordinate].name.removesuffix("_dot")
            sums[name] = sums.get(name, 0.0) + load.force
    for name, value in sums.items():
        yield (name,), "N" if name in sliding else "N m", value
