"""The errors of what a module computes besides v̇, as a whole and by component."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gmpy2 import mpfr

from eomgen.run.problem import FloatArray
from eomgen.study.precision.extended import Array, doubles, extended, roots
from eomgen.study.verification.free_bodies import FreeBodies
from eomgen.study.verification.hard_states import State
from eomgen.study.verification.losses import Loss, loss_of, rest_of
from eomgen.study.verification.roundings import ULP, Roundings, spread, worst_share
from eomgen.study.whole import Viewed, names_of

OF_EFFECTS = ("effect_powers", "effect_forces")
"""Outputs that free bodies know with the sizes of their terms."""


def on_tree(free: FreeBodies, vd: Array) -> Array:
    """M v̇ + h - F."""
    return free.mass_matrix @ vd + free.bias_force - free.applied_force


def judged_outputs(
    free: FreeBodies,
    near: Sequence[FreeBodies],
    modules: Sequence[Any],
    ydot: FloatArray,
    spreads: "Spreads",
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
        found[name] = loss_of(given, true, changes, scale)
        if rows is None or spreads.all_states:
            error, change = extended(given) - true, _change(true, changes)
            given_at = (error, true, scale, change, *extra)
            parts[name] = spreads.share(output or name, *given_at, rows=rows)

    for name, (values, scale) in _quantities(free, near).items():
        given = asked(name) if name != "body_poses" else _matrices(asked(name), free.dimensions)
        weigh(name, given, values, scale)
    # Beside the true accelerations, at which all terms of a row cancel.
    at = doubles(free.vd) * np.random.default_rng(1).uniform(0.5, 0.9, nv)
    needed = [on_tree(f, extended(at)) for f in (free, *near)]
    scale = abs(free.mass_matrix) @ abs(extended(at)) + free.bias_sizes + free.applied_sizes
    weigh("inverse_dynamics", asked("inverse_dynamics", at), needed, scale, at)
    rest = [*range(nq), *range(nq + nv, len(state.y))]
    rates = [f.state_rates[rest] for f in (free, *near)]
    sizes = abs(rates[0]) + np.max(abs(rates[0]), initial=mpfr(0))
    weigh("other rates", ydot[rest], rates, sizes, output="derivative", rows=rest)
    return found, parts


def _change(true: Array, changes: Sequence[Array]) -> Array:
    return np.max([abs(changed - true) for changed in changes], axis=0)


class Spreads:
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
    root = roots(np.diag(free.mass_matrix))
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
        "effect_forces": free.effect_forces[1],
        "body_poses": np.concatenate([extended(one), free.reach * extended(one[:, :, :1])], axis=2),
    }
    if not free.model.effects:
        del scales["effect_powers"], scales["effect_forces"]
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
                values.append(extended(value[0] if name in OF_EFFECTS else value))
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
