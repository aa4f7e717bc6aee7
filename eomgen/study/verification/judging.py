"""A generated module judged at one state, against free bodies and virtual work in 60 digits.

Everything is counted in ulps of its own terms: the distance of doubles at the sum of the sizes of
what is added up. Beside each error stands what one ulp in the data does to the same quantity:
every number of the state, of the parameters and of the inputs is changed by one ulp up or down,
at random, and the quantity is computed anew in 60 digits. No algorithm can be asked for much less
than that, since the data are rounded themselves; one that loses much more loses digits of its own.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from gmpy2 import mpfr

from eomgen.model.model import Model
from eomgen.precision.longs import Array, doubles, long, long_digits, solved
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import Floats
from eomgen.scene.effects import Gravity
from eomgen.study.verification.hard_states import State
from eomgen.study.verification.truth import Truth
from eomgen.study.verification.ulps import HARDLY
from eomgen.study.verification.virtual_work import FreeBodies

ULP = 2.0**-52
"""Of 1."""
NEAR = 4
"""How many times the data are changed."""


@dataclass(frozen=True)
class Loss:
    """The error of a quantity, and what one ulp in the data does to it, both in ulps of its terms;
    the error is infinite where the module gave no finite number.
    """

    error: float
    data: float


@dataclass(frozen=True, eq=False)
class Judged:
    """What was found at a state.

    vd         v̇ (nv,), as exactly as doubles hold it
    off        for each route what its v̇ is off (nv,), nan where it gave no finite number
    data       what one ulp in the data does to v̇ (nv,)
    agreed     digits to which articulated bodies and virtual work agree, in 60 digits
    condition  number of the mass matrix scaled to a diagonal of ones, 2-norm
    pivot      smallest pivot of that matrix, eliminated from its last row on as LᵀDL does
    residuals  of M v̇ + h - F at the v̇ of each route
    losses     of everything else that the module computes
    """

    state: State
    vd: Floats
    off: Mapping[str, Floats]
    data: Floats
    agreed: float
    condition: float
    pivot: float
    residuals: Mapping[str, Loss]
    losses: Mapping[str, Loss]


def judged(
    model: Model,
    truth: Truth,
    taken: str,
    modules: Mapping[str, GeneratedModule],
    full: GeneratedModule,
    state: State,
) -> Judged | None:
    """Judge the modules of all routes at a state, all outputs of that of the route `taken`; those
    that it lacks of one that has them all, `full`.

    None if there is no finite acceleration in 60 digits.
    """
    rng = np.random.default_rng(len(state.label))
    with long_digits():
        exact = _vd(truth, state, {})
        whole = long(state.y)
        for indices in map(list, model.quaternions):
            # Off unit length, by rounding, a quaternion means this in one form and that in another.
            whole[indices] = whole[indices] / _root(whole[indices] @ whole[indices])
        free = FreeBodies(model, state.t, whole, state.u)
        numbers = whole, state.u, dict(model.defaults)
        changed = [[_changed(x, rng) for x in numbers] for _ in range(NEAR)]
        near = [FreeBodies(model, state.t, *given) for given in changed]
        try:
            other, *moved = (f.vd for f in (free, *near))
        except ZeroDivisionError:
            return None
        if not all(_finite(vd) for vd in (exact, other, *moved)):
            return None
        recorded = truth.long(mpfr(state.t), whole, state.u, {})
        agreed = _agreed(free, recorded)
        data = np.max([abs(vd - other) for vd in moved], axis=0)
        found = {route: _derivative(module, state) for route, module in modules.items()}
        nq, nv = len(model.coordinates), len(model.velocities)
        vd = {route: ydot[nq : nq + nv] for route, ydot in found.items()}
        off = {route: doubles(long(x) - exact) for route, x in vd.items()}
        residuals = _residuals(free, near, vd, model)
        losses = _outputs(free, near, (modules[taken], full), found[taken], state)
        return Judged(
            state,
            doubles(exact),
            off,
            doubles(data),
            agreed,
            *_condition(free.mass_matrix),
            residuals,
            losses,
        )


def _vd(truth: Truth, state: State, parameters: Mapping[str, Any]) -> Array:
    return truth.long(mpfr(state.t), state.y, state.u, parameters)


def _changed(values: Any, rng: np.random.Generator) -> Any:
    """Numbers, in order or by name, each changed by up to one ulp, up or down."""
    if isinstance(values, dict):
        made = _changed(long(list(values.values())), rng)
        return dict(zip(values, made, strict=True))
    signs = rng.choice((-ULP, ULP), size=len(values))
    # Of different sizes, lest two numbers that nearly cancel change alike.
    return values * (1 + long(signs * rng.uniform(0.25, 1.0, size=len(values))))


def _agreed(free: FreeBodies, vd: Array) -> float:
    """Digits to which v̇ of another solver, in 60 digits, solves M v̇ + h - F = 0, of the terms of
    each row: where these cancel, v̇ itself is but what rounding leaves. A row in which nothing acts
    is measured by a part of the greatest, in units of its own inertia.
    """
    root = long([_root(x) for x in np.diag(free.mass_matrix)])
    off = abs(_needed(free, vd)) / root
    terms = (abs(free.mass_matrix) @ abs(vd) + free.bias_sizes + free.applied_sizes) / root
    terms = np.maximum(terms, HARDLY * np.max(terms))
    worst = max((a / b for a, b in zip(off, terms, strict=True) if a), default=0)
    return -_log10(worst) if worst else 60.0


def _derivative(module: Any, state: State) -> Floats:
    """ẏ of generated code, nan where it has none."""
    try:
        return np.asarray(module.derivative(state.t, state.y, None, state.u or None))
    except (ArithmeticError, ValueError):
        return np.full(len(state.y), np.nan)


def _residuals(
    free: FreeBodies, near: Sequence[FreeBodies], vd: Mapping[str, Floats], model: Model
) -> dict[str, Loss]:
    """Of M v̇ + h - F at the v̇ of each route, by route, in 60 digits."""
    found = {}
    units = [c.unit for c in model.velocities]
    for route, given in vd.items():
        if not np.isfinite(given).all():
            found[route] = Loss(np.inf, 0.0)
            continue
        largest = {
            u: max(abs(x) for x, w in zip(given, units, strict=True) if w == u) for u in units
        }
        sizes = long([largest[u] for u in units])
        v = long(given)
        scale = abs(free.mass_matrix) @ sizes + free.bias_sizes + free.applied_sizes
        true, *changed = (_needed(f, v) for f in (free, *near))
        found[route] = _loss(0.0 * given, true, changed, scale)
    return found


def _needed(free: FreeBodies, vd: Array) -> Array:
    """M v̇ + h - F."""
    return free.mass_matrix @ vd + free.bias_force - free.applied_force


def _outputs(
    free: FreeBodies, near: Sequence[FreeBodies], modules: Sequence[Any], ydot: Floats, state: State
) -> dict[str, Loss]:
    """Of all that the module computes beside v̇."""
    nq, nv = len(free.model.coordinates), free.nv
    q, v, x = np.split(state.y, [nq, nq + nv])
    more = {"x": x} if len(x) else {}
    u = state.u or None

    def asked(name: str, *extra: Any) -> Any:
        function = next(getattr(m, name) for m in modules if hasattr(m, name))
        try:
            if extra:
                return function(q, v, *extra, t=state.t, u=u, **more)
            return function(state.t, state.y, None, u)
        except (ArithmeticError, ValueError):
            return np.nan

    found = {}
    for name, (true, changes, scale) in _quantities(free, near).items():
        given = asked(name) if name != "body_poses" else _matrices(asked(name), free.dimensions)
        found[name] = _loss(given, true, changes, scale)
    at = doubles(free.vd)
    true, *changes = (_needed(f, long(at)) for f in (free, *near))
    scale = abs(free.mass_matrix) @ abs(long(at)) + free.bias_sizes + free.applied_sizes
    found["inverse_dynamics"] = _loss(asked("inverse_dynamics", at), true, changes, scale)
    rest = [*range(nq), *range(nq + nv, len(state.y))]
    true, *changes = (f.state_rates[rest] for f in (free, *near))
    sizes = abs(true) + np.max(abs(true), initial=mpfr(0))
    found["other rates"] = _loss(ydot[rest], true, changes, sizes)
    return found


def _quantities(
    free: FreeBodies, near: Sequence[FreeBodies]
) -> dict[str, tuple[Array, list[Array], Array]]:
    """Outputs: what they are, what they are where the data are changed, and the scale of each."""
    root = long([_root(x) for x in np.diag(free.mass_matrix)])
    mass = sum((free.mass(name) for name in free.bodies), mpfr(0))
    potential = np.sum(abs(free.potential_energies), initial=mpfr(0))
    for effect in free.model.effects:
        if isinstance(effect, Gravity):
            potential += mass * max(map(abs, effect.acceleration(free))) * free.reach
    speeds = abs(free.rates[: free.nv])
    one = np.ones((len(free.bodies), 3, 3))
    scales = {
        "mass_matrix": np.outer(root, root),
        "bias_force": free.bias_sizes,
        "applied_force": free.applied_sizes,
        "kinetic_energy": speeds @ abs(free.mass_matrix) @ speeds / 2 + free.kinetic_energy,
        "potential_energy": potential,
        "momentum": free.momentum_sizes,
        "effect_powers": free.effect_powers[1],
        "body_poses": np.concatenate([long(one), free.reach * long(one[:, :, :1])], axis=2),
    }
    if not free.model.effects:
        del scales["effect_powers"]
    found = {}
    for name, scale in scales.items():
        values = []
        for f in (free, *near):
            if name == "body_poses":
                places = [np.column_stack([pose.turn, pose.place]) for pose in f.poses]
                values.append(np.array(places).reshape(-1, 3, 4))
            else:
                value = getattr(f, name)
                values.append(long(value[0] if name == "effect_powers" else value))
        if name == "momentum" and free.dimensions == 2:
            values, scale = [x[[0, 1, 5]] for x in values], scale[[0, 1, 5]]
        found[name] = (values[0], values[1:], long(scale))
    return found


def _matrices(poses: Any, dimensions: int) -> Any:
    """Poses as the plane has them, x, y and angle, as (nb, 3, 4)."""
    if dimensions == 3 or np.ndim(poses) < 2:
        return poses
    made = np.zeros((len(poses), 3, 4))
    made[:, 2, 2] = 1.0
    made[:, :2, 3] = poses[:, :2]
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    made[:, 0, 0], made[:, 0, 1], made[:, 1, 0], made[:, 1, 1] = c, -s, s, c
    return made


def _loss(given: Any, true: Array, changes: Sequence[Array], scale: Array) -> Loss:
    if not np.isfinite(given).all():
        return Loss(np.inf, 0.0)
    data = max(ulps(changed - true, scale) for changed in changes)
    return Loss(ulps(long(given) - true, scale), data)


def ulps(off: Array, scale: Array) -> float:
    """The greatest of differences, each in ulps of its scale, but of a thousandth of the greatest
    scale at least (see `ulps`); where all are 0 it must be exact. nan if any of them is.
    """
    off, scale = np.broadcast_arrays(off, np.maximum(scale, HARDLY * np.max(scale)))
    parts = [
        float(abs(x) / s / ULP) if s else np.inf
        for x, s in zip(off.flat, scale.flat, strict=True)
        if x
    ]
    return float(np.max(parts, initial=0.0))  # unlike Python's own, no nan is lost


def _condition(matrix: Array) -> tuple[float, float]:
    """Condition number and smallest pivot of a matrix scaled to a diagonal of ones."""
    root = long([_root(x) for x in np.diag(matrix)])
    scaled = matrix / np.outer(root, root)
    n = len(scaled)
    inverse = solved(scaled, long(np.eye(n)))
    # Each from the largest eigenvalue of a matrix, which doubles tell well; the smallest they lose.
    condition = np.linalg.eigvalsh(doubles(scaled))[-1] * np.linalg.eigvalsh(doubles(inverse))[-1]
    rest, pivots = scaled.copy(), []
    for k in reversed(range(n)):
        pivots.append(rest[k, k])
        rest[:k, :k] = rest[:k, :k] - np.outer(rest[:k, k], rest[k, :k]) / rest[k, k]
    return float(condition), float(min(pivots))


def _root(x: Any) -> Any:
    return x ** mpfr(0.5)


def _log10(x: Any) -> float:
    return float(np.log10(float(x))) if float(x) else -60.0


def _finite(values: Array) -> bool:
    return bool(np.isfinite(doubles(values)).all())
