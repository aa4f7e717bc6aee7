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
    Array,
    doubles,
    extended,
    extended_digits,
    of_unit_length,
    roots,
    solved,
)
from eomgen.study.verification.free_bodies import FreeBodies
from eomgen.study.verification.hard_states import State
from eomgen.study.verification.judged_outputs import Spreads, judged_outputs, on_tree
from eomgen.study.verification.losses import Loss, loss_of
from eomgen.study.verification.roundings import ULP, Roundings
from eomgen.study.verification.truth import Truth
from eomgen.study.verification.ulps import LEAST_SCALE

NEAR = 4
"""Number of random changes of the data."""


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
        spreads = Spreads(roundings, modules[taken], free, state)
        losses, parts = judged_outputs(
            free, near, (modules[taken], full), found[taken], spreads, state
        )
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
    root = roots(np.diag(free.mass_matrix))
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
        found[route] = loss_of(0.0 * given, true, changed, scale)
    return found


def _needed(free: FreeBodies, vd: Array) -> Array:
    """M v̇ + h - F - Jᵀ λ, at the λ of the free bodies."""
    return on_tree(free, vd) - free.constraint_push[0][: free.nv]


def _load_sizes(free: FreeBodies) -> Array:
    """The sizes of the terms of h, F and Jᵀ λ, (nv,)."""
    return free.bias_sizes + free.applied_sizes + free.constraint_push[1][: free.nv]


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
    root = roots(np.diag(matrix))
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


def _log10(x: Any) -> float:
    return float(np.log10(float(x))) if float(x) else -60.0


def _finite(values: Array) -> bool:
    return bool(np.isfinite(doubles(values)).all())
