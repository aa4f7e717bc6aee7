"""The errors of a generated module at one state, against virtual work in 60 digits.

Errors are counted in ulps of the sum of the sizes of their terms. Beside each error stands the
change of the same quantity by one ulp in the data: every number of the state, parameters and inputs
is changed by up to one ulp, up or down at random, and the quantity is computed anew in 60 digits.
As the data are rounded themselves, no algorithm can be expected to do much better; one that does
much worse loses digits of its own.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from gmpy2 import mpfr

from eomgen.model.model import Model
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import FloatArray
from eomgen.study.precision.extended import (
    NOTHING,
    Array,
    doubles,
    extended,
    extended_digits,
    of_unit_length,
    solved,
)
from eomgen.study.verification.hard_states import State
from eomgen.study.verification.roundings import ULP, Roundings, spread, worst_share
from eomgen.study.verification.truth import Truth
from eomgen.study.verification.ulps import LEAST_SCALE
from eomgen.study.verification.virtual_work import FreeBodies
from eomgen.study.whole import Viewed, names_of

DIFFERENCED = 1e-18
"""Error of slopes and rates that are differences of differences, relative to their terms."""
NEAR = 4
"""Number of random changes of the data."""


@dataclass(frozen=True)
class Loss:
    """The error of a quantity, and its change by one ulp in the data, both in ulps of its terms.
    The error is infinite if the module gave no finite number.
    """

    error: float
    data: float


@dataclass(frozen=True, eq=False)
class Judged:
    """The results at a state.

    vd         v̇ (nv,), exact but for rounding to doubles
    terms      sizes (nv,) of the terms of M v̇ = F - h + Jᵀ λ, each row over its own inertia: what
               may cancel in v̇, without the condition of M
    errors     by route, the error of its v̇ (nv,), nan where it is not finite
    data       change of v̇ (nv,) by one ulp in the data
    agreed     digits to which articulated bodies and virtual work agree, in 60 digits
    condition  2-norm condition number of the mass matrix scaled to a diagonal of ones, or that of
               J M⁻¹ Jᵀ of the constraints, if it is greater
    pivot      smallest pivot of these matrices, eliminated from the last row up as in LᵀDL
    residuals  the errors of M v̇ + h - F - Jᵀ λ at the v̇ of each route
    losses     errors of everything else that the module computes
    parts      by output of the route taken, the greatest error of a component in units of what
               rounding makes of it, and the component's index
    """

    state: State
    vd: FloatArray
    terms: FloatArray
    errors: Mapping[str, FloatArray]
    data: FloatArray
    agreed: float
    condition: float
    pivot: float
    residuals: Mapping[str, Loss]
    losses: Mapping[str, Loss]
    parts: Mapping[str, tuple[float, int]]


def judged(
    model: Model,
    truth: Truth,
    taken: str,
    modules: Mapping[str, GeneratedModule],
    full: GeneratedModule,
    roundings: Roundings,
    state: State,
) -> Judged | None:
    """The errors of the modules of all routes at a state, and of all outputs of the route `taken`.
    Outputs that its module lacks are taken from `full`, which has them all; `roundings` are those
    of their programs.

    None if there is no finite acceleration in 60 digits.
    """
    rng = np.random.default_rng(len(state.label))
    with extended_digits():
        exact = _vd(truth, state, {})
        # Formulas of a rotation differ if rounding has changed the length of a quaternion.
        whole = of_unit_length(extended(state.y), model.quaternions)
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
        recorded = truth.extended(mpfr(state.t), whole, state.u, {})
        agreed = _agreed(free, recorded)
        data = np.max([abs(vd - other) for vd in moved], axis=0)
        found = {route: _derivative(module, state) for route, module in modules.items()}
        nq, nv = len(model.coordinates), len(model.velocities)
        vd = {route: ydot[nq : nq + nv] for route, ydot in found.items()}
        errors = {route: doubles(extended(x) - exact) for route, x in vd.items()}
        residuals = _residuals(free, near, vd, model)
        spreads = _Spreads(roundings, modules[taken], free, state)
        losses, parts = _outputs(free, near, (modules[taken], full), found[taken], spreads, state)
        vd_parts = spreads.share("accelerations", errors[taken], exact, abs(exact), data)
        parts = {"v̇": vd_parts, **parts}
        return Judged(
            state,
            doubles(exact),
            doubles(_load_sizes(free) / np.diag(free.mass_matrix)),
            errors,
            doubles(data),
            agreed,
            *_conditions(free),
            residuals,
            losses,
            parts,
        )


def _vd(truth: Truth, state: State, parameters: Mapping[str, Any]) -> Array:
    return truth.extended(mpfr(state.t), state.y, state.u, parameters)


def _changed(values: Any, rng: np.random.Generator) -> Any:
    """Numbers, in a sequence or by name, each changed by up to one ulp, up or down."""
    if isinstance(values, dict):
        made = _changed(extended(list(values.values())), rng)
        return dict(zip(values, made, strict=True))
    signs = rng.choice((-ULP, ULP), size=len(values))
    # The sizes differ, so that two numbers that nearly cancel do not change by the same amount.
    return values * (1 + extended(signs * rng.uniform(0.25, 1.0, size=len(values))))


def _agreed(free: FreeBodies, vd: Array) -> float:
    """Digits to which v̇ of another solver solves M v̇ + h - F = 0 in 60 digits, relative to the
    terms of each row: if these cancel, v̇ is only a rounding error. A row with tiny terms is
    compared with a part of the greatest row, in units of its own inertia.
    """
    root = extended([_root(x) for x in np.diag(free.mass_matrix)])
    errors = abs(_needed(free, vd)) / root
    terms = (abs(free.mass_matrix) @ abs(vd) + _load_sizes(free)) / root
    terms = np.maximum(terms, LEAST_SCALE * np.max(terms, initial=0.0))
    worst = max((a / b for a, b in zip(errors, terms, strict=True) if a), default=0)
    return -_log10(worst) if worst else 60.0


def _derivative(module: Any, state: State) -> FloatArray:
    """ẏ of generated code, nan if it fails."""
    try:
        return np.asarray(module.derivative(state.t, state.y, None, state.u or None))
    except (ArithmeticError, ValueError):
        return np.full(len(state.y), np.nan)


def _residuals(
    free: FreeBodies, near: Sequence[FreeBodies], vd: Mapping[str, FloatArray], model: Model
) -> dict[str, Loss]:
    """The errors of M v̇ + h - F at the v̇ of each route, in 60 digits."""
    found = {}
    units = [c.unit for c in model.velocities]
    for route, given in vd.items():
        if not np.isfinite(given).all():
            found[route] = Loss(np.inf, 0.0)
            continue
        largest = {
            u: max(abs(x) for x, w in zip(given, units, strict=True) if w == u) for u in units
        }
        sizes = extended([largest[u] for u in units])
        v = extended(given)
        scale = abs(free.mass_matrix) @ sizes + _load_sizes(free)
        true, *changed = (_needed(f, v) for f in (free, *near))
        found[route] = _loss(0.0 * given, true, changed, scale)
    return found


def _needed(free: FreeBodies, vd: Array) -> Array:
    """M v̇ + h - F - Jᵀ λ, at the λ of the free bodies."""
    return _on_tree(free, vd) - free.constraint_push[0][: free.nv]


def _on_tree(free: FreeBodies, vd: Array) -> Array:
    """M v̇ + h - F."""
    return free.mass_matrix @ vd + free.bias_force - free.applied_force


def _load_sizes(free: FreeBodies) -> Array:
    """The sizes of the terms of h, F and Jᵀ λ, (nv,)."""
    return free.bias_sizes + free.applied_sizes + free.constraint_push[1][: free.nv]


def _outputs(
    free: FreeBodies,
    near: Sequence[FreeBodies],
    modules: Sequence[Any],
    ydot: FloatArray,
    spreads: "_Spreads",
    state: State,
) -> tuple[dict[str, Loss], dict[str, tuple[float, int]]]:
    """The errors of everything that the module computes besides v̇, as a whole and by component."""
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

    found, parts = {}, {}

    def weigh(
        name: str,
        given: Any,
        values: Sequence[Array],
        scale: Array,
        *extra: Any,
        output: str = "",
        rows: Sequence[int] | None = None,
    ) -> None:
        """`values` are the true one, and those for the changed data."""
        true, *changes = values
        found[name] = _loss(given, true, changes, scale)
        if rows is None or spreads.all_states:
            error, change = extended(given) - true, _change(true, changes)
            given_at = (error, true, scale, change, *extra)
            parts[name] = spreads.share(output or name, *given_at, rows=rows)

    for name, (values, scale) in _quantities(free, near).items():
        given = asked(name) if name != "body_poses" else _matrices(asked(name), free.dimensions)
        weigh(name, given, values, scale)
    # Beside the true accelerations, at which all terms of a row cancel.
    at = doubles(free.vd) * np.random.default_rng(1).uniform(0.5, 0.9, nv)
    needed = [_on_tree(f, extended(at)) for f in (free, *near)]
    scale = abs(free.mass_matrix) @ abs(extended(at)) + free.bias_sizes + free.applied_sizes
    weigh("inverse_dynamics", asked("inverse_dynamics", at), needed, scale, at)
    rest = [*range(nq), *range(nq + nv, len(state.y))]
    rates = [f.state_rates[rest] for f in (free, *near)]
    sizes = abs(rates[0]) + np.max(abs(rates[0]), initial=mpfr(0))
    weigh("other rates", ydot[rest], rates, sizes, output="derivative", rows=rest)
    return found, parts


def _change(true: Array, changes: Sequence[Array]) -> Array:
    return np.max([abs(changed - true) for changed in changes], axis=0)


def rest_of(model: Model) -> float:
    """What 60 digits leave of terms that cancel, relative to these; more where rates and β of
    constraints are differences.
    """
    return DIFFERENCED if model.constraints else NOTHING


class _Spreads:
    """What rounding makes of the components of outputs at a state.

    all_states  whether the module's state has all coordinates. If not, the others follow from it
                only but for rounding, and what that changes is rounding, too
    """

    def __init__(self, roundings: Roundings, module: Any, free: FreeBodies, state: State) -> None:
        self._roundings, self._free, self._state = roundings, free, state
        self.all_states = not isinstance(module, Viewed)
        self._y = dict(zip(names_of(free.model), state.y.tolist(), strict=True))

    def share(
        self,
        name: str,
        error: Any,
        true: Array,
        scale: Array,
        change: Array,
        *extra: Any,
        rows: Sequence[int] | None = None,
    ) -> tuple[float, int]:
        """The greatest error of a component of an output in units of its spread, and its index.

        `scale` is the size of its terms, of which 60 digits leave a rest, `change` that by one ulp
        in the data, `rows` those of ẏ that are meant.
        """
        nq, nv = len(self._free.model.coordinates), self._free.nv
        if name == "accelerations" and self.all_states:
            name, rows = "derivative", range(nq, nq + nv)
        runs = self._roundings.runs(name, self._state.t, self._y, self._state.u, *extra)
        if rows is not None:
            runs = runs[list(rows)]
        if name == "body_poses":
            runs = np.stack(
                [_matrices(runs[..., k], self._free.dimensions) for k in range(runs.shape[-1])], -1
            )
        rest = rest_of(self._free.model) * np.max(abs(doubles(scale)), initial=0.0)
        allowed = spread(runs) + ULP * abs(doubles(true)) + rest
        if not self.all_states:
            allowed = allowed + doubles(change)
        return worst_share(doubles(error), allowed)


def _quantities(
    free: FreeBodies, near: Sequence[FreeBodies]
) -> dict[str, tuple[list[Array], Array]]:
    """Of each output: its value and its values for the changed data, and its scale."""
    root = extended([_root(x) for x in np.diag(free.mass_matrix)])
    mass = sum((free.mass(name) for name in free.bodies), mpfr(0))
    potential = np.sum(abs(free.potential_energies), initial=mpfr(0))
    for effect in free.model.effects:
        fall = effect.acceleration(free)
        potential += mass * max(map(abs, fall), default=mpfr(0)) * free.reach
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
        "body_poses": np.concatenate([extended(one), free.reach * extended(one[:, :, :1])], axis=2),
    }
    if not free.model.effects:
        del scales["effect_powers"]
    scales |= _constraint_scales(free)
    found = {}
    for name, scale in scales.items():
        values = []
        for f in (free, *near):
            if name == "body_poses":
                places = [np.column_stack([pose.rotation, pose.position]) for pose in f.poses]
                values.append(np.array(places).reshape(-1, 3, 4))
            else:
                value = getattr(f, name)
                values.append(extended(value[0] if name == "effect_powers" else value))
        if name == "momentum" and free.dimensions == 2:
            values, scale = [x[[0, 1, 5]] for x in values], scale[[0, 1, 5]]
        found[name] = (values, extended(scale))
    return found


def _constraint_scales(free: FreeBodies) -> dict[str, Array]:
    """The scales of what the module computes of constraints, by row."""
    units = np.array([unit for _, unit in free.model.rows])
    if not len(units):
        return {}
    lengths = np.where(units == "N", free.reach, mpfr(1))
    speeds = abs(free.constraint_jacobian) @ abs(free.rates)
    found = abs(free.constraint_forces)
    sizes = extended([max(found[units == unit]) for unit in units])
    return {
        "constraint_residuals": lengths,
        "constraint_rates": speeds + lengths * max(map(abs, free.rates)),
        "constraint_forces": sizes,
    }


def _matrices(poses: Any, dimensions: int) -> Any:
    """Planar poses, x, y and angle, as matrices (nb, 3, 4)."""
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
    return Loss(ulps(extended(given) - true, scale), data)


def ulps(error: Array, scale: Array) -> float:
    """The greatest of differences, each in ulps of its scale, which counts at least a thousandth of
    the greatest scale (see `ulps`). Where all scales are 0, any difference is infinite. nan if any
    difference is nan.
    """
    error, scale = np.broadcast_arrays(
        error, np.maximum(scale, LEAST_SCALE * np.max(scale, initial=0.0))
    )
    parts = [
        float(abs(x) / s / ULP) if s else np.inf
        for x, s in zip(error.flat, scale.flat, strict=True)
        if x
    ]
    return float(np.max(parts, initial=0.0))  # Python's own max could lose a nan


def _conditions(free: FreeBodies) -> tuple[float, float]:
    """The greater condition number, and the smaller of the smallest pivots, of M and J M⁻¹ Jᵀ."""
    found = [_condition(free.mass_matrix)]
    if free.model.rows:
        J = free.constraint_jacobian[:, : free.nv]
        found.append(_condition(J @ solved(free.mass_matrix, J.T)))
    conditions, pivots = zip(*found, strict=True)
    return max(conditions), min(pivots)


def _condition(matrix: Array) -> tuple[float, float]:
    """Condition number and smallest pivot of a matrix scaled to a diagonal of ones."""
    if not len(matrix):
        return 1.0, 1.0
    root = extended([_root(x) for x in np.diag(matrix)])
    scaled = matrix / np.outer(root, root)
    n = len(scaled)
    inverse = solved(scaled, extended(np.eye(n)))
    # Doubles give the largest eigenvalue of a matrix accurately, but not the smallest.
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
