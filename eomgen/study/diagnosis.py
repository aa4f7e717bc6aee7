"""Explanations of a run from its model: why it cannot start or continue, where it came near gimbal
lock, and what its motion depends on. `run` knows only the module and receives these as functions.
"""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from eomgen.dynamics.start.diagnostics import (
    constraint_trouble,
    effect_sizes,
    is_singular,
    values_at,
)
from eomgen.dynamics.start.singularity import relative_pivots, why_unresisted
from eomgen.model.bodies import dofs_of
from eomgen.model.model import Model
from eomgen.run.module import GeneratedModule, as_problem, given_values
from eomgen.run.origin import START, UNITS, Origin
from eomgen.run.problem import Explain, Explanation, FloatArray, Problem, unexplained
from eomgen.run.trajectory import Trajectory
from eomgen.scene.joints.base import Geared
from eomgen.study.constrained_start import on_constraints
from eomgen.study.whole import has_all, initial_of, names_of, on_branch, whole_of

GROWN = 1e9
"""Growth of an effect, relative to its size at the start, that is reported."""
GONE = 1e-9
"""Inertia of a velocity, relative to that at other states, below which it counts as none."""
NEAR = 1e-4
"""Inertia, relative to that at other states, below which a joint is near gimbal lock: its axes are
within a hundredth of a radian of it, and rounding errors grow by the inverse.
"""
REMEDY = "soften it, keep its formula finite there, or keep away"


def problem_of(
    module: GeneratedModule,
    parameters: Any = None,
    inputs: Any = None,
    model: Model | None = None,
    start: Callable[[FloatArray], FloatArray] | None = None,
    note: Callable[[str], None] = lambda text: None,
) -> Problem:
    """The initial-value problem of a module, as from `as_problem`. With the `model` of the module,
    its messages name the part of the model that has no finite value, and its initial state meets
    the constraints at these parameters; `note` is told of values of the scene that could not be
    kept. `start` is as there, of all coordinates of the model.

    Raises `RunError` if the module refuses parameters or inputs, or has no derivative at its
    initial state.
    """
    if model is None:
        return as_problem(module, parameters, inputs, start=start)
    given = given_values(module, parameters, inputs)

    def started(_: FloatArray) -> FloatArray:
        y = initial_of(module, model, parameters)
        whole, notices = on_constraints(model, given[0], start(y) if start else y)
        for notice in notices:
            note(notice)
        return on_branch(module, model, whole, *given)

    return as_problem(
        module,
        parameters,
        inputs,
        explain=explained(model, *given, module),
        origin=origin_of(model, *given),
        start=started,
    )


def origin_of(model: Model, parameters: Mapping[str, float], inputs: Mapping[str, float]) -> Origin:
    """What the motion of a model depends on, with the given values instead of its defaults."""
    parts: dict[str, object] = {
        "dimensions": model.dimensions,
        "form": model.form,
        "locked coordinates": model.locked,
        "effects left out": model.leave_out,
        UNITS: tuple((p.name, p.unit) for p in model.parameters),
        START: (model.initial_q, model.initial_v, model.extra),
    }
    for body in model.bodies:
        parts[f"body '{body.name}'"] = body
    for point in model.points:
        parts[f"point '{point.name}'"] = point
    for effect in model.effects:
        parts[f"effect '{effect.name}'"] = effect
    return Origin(
        {name: hashlib.sha256(repr(part).encode()).hexdigest() for name, part in parts.items()},
        {**model.defaults, **parameters},
        {**{i.name: i.default for i in model.inputs}, **inputs},
    )


def joint_limits(model: Model) -> dict[str, tuple[float, float]]:
    """The limits of each coordinate that has some which no stop enforces, by name."""
    joints = dofs_of(model.bodies, model.dimensions)
    stopped = {joint for effect in model.effects for joint in effect.limited(joints)}
    return {
        body.positions[0].name: body.joint.limits
        for body in model.bodies
        if body.joint.name not in stopped
        and isinstance(body.joint, Geared)
        and body.joint.limits is not None
    }


def locks(model: Model, trajectory: Trajectory) -> list[str]:
    """Where the rows of a spatial mechanism come near gimbal lock: a line for each velocity that
    has almost no inertia there.
    """
    known = model.form == "velocity" and not (model.driven or model.locked)
    if not known or model.dimensions != 3 or len(trajectory.states) < len(names_of(model)):
        return []
    whole = trajectory.y.T
    felt = relative_pivots(model, whole[: len(model.coordinates)].T)
    lines = []
    for i in sorted(felt):
        row = int(np.argmin(felt[i]))
        if felt[i][row] < NEAR:
            why = Explanation(*why_unresisted(model, i))
            lines.append(f"at t = {trajectory.t[row]:.4g} s {why}")
    return lines


def explained(
    model: Model, parameters: Mapping[str, float], inputs: Mapping[str, float], module: Any
) -> Explain:
    """`Problem.explain` for a model of form 'velocity'; for other forms it explains nothing."""
    if model.form != "velocity":
        return unexplained
    given = parameters, inputs

    def explain(t: float, y: FloatArray, initial: FloatArray) -> Explanation | None:
        if not np.isfinite(y).all():
            return None
        try:
            states = (whole_of(module, model, at, x, *given) for at, x in ((t, y), (0.0, initial)))
            return of_whole(t, *states)
        except (ArithmeticError, ValueError):
            if has_all(module):
                raise
            return None

    def of_whole(t: float, y: FloatArray, initial: FloatArray) -> Explanation | None:
        values = values_at(model, t, y.tolist(), parameters, inputs)
        sizes = effect_sizes(model, values)
        endless = [name for name, size in sizes.items() if size == float("inf")]
        if endless:
            return Explanation(f"{_effects(endless)} no finite value", REMEDY)
        if not (model.driven or model.locked):
            felt = relative_pivots(model.with_parameters(parameters), np.array([values.q]))
            for i in sorted(felt):
                if felt[i][0] < GONE:
                    return Explanation(*why_unresisted(model, i))
        if why := constraint_trouble(model, values):
            return Explanation(why, "take another start, or lengths that do not line up")
        if is_singular(model, values):
            return Explanation(
                "the mass matrix is singular", "change lengths, masses or inertias, or keep away"
            )
        first = effect_sizes(model, values_at(model, 0.0, initial.tolist(), parameters, inputs))
        grown = [name for name, size in sizes.items() if size > GROWN * max(first[name], 1e-9)]
        if grown:
            worst = max(grown, key=lambda name: sizes[name])
            growth = f"from {first[worst]:.3g} to {sizes[worst]:.3g}"
            return Explanation(f"effect '{worst}' has grown {growth}", REMEDY)
        return None

    return explain


def _effects(names: Sequence[str]) -> str:
    listed = ", ".join(f"'{name}'" for name in names)
    return f"effects {listed} have" if len(names) > 1 else f"effect {listed} has"
