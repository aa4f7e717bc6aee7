"""Linearisation of a module about a state: δẏ = A δy + B δu, from its generated Jacobians."""

import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from eomgen.base.displays import Displayed
from eomgen.base.errors import RunError
from eomgen.base.files import write_whole
from eomgen.base.frozen import Frozen
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import FloatArray
from eomgen.run.tangents import tangents
from eomgen.study.linear.discrete import Discrete, discrete_of
from eomgen.study.linear.manifold import Manifold, is_constrained, manifold
from eomgen.study.linear.modes import Mode, controllable_rank, modes, stability

FORMAT = "linearisation 1"
BOUND = 1e100
"""Greater numbers count as infinite: their squares nearly overflow."""
_STEADY = 1e-9
"""Smaller values, relative to the greatest entry of A, count as rounding."""
_UNIT = 1e-9
"""Greatest difference of a quaternion's length from 1."""


@dataclass(frozen=True, eq=False, repr=False)
class Linearisation(Frozen, Displayed):
    """δẏ = A δy + B δu for small deviations from the motion through `y` under `u`.

    A (n, n), B (n, nu)  derivatives of the rates with respect to states and inputs
    state_names          of the n deviations: the states themselves, or see `reduced`
    input_names          of the nu inputs
    y (ny,), u (nu,)     the state and the constant inputs, SI units
    rates (ny,)          ẏ there, zero at an equilibrium
    quaternions          indices into the deviations of each unit quaternion among them
    manifold             of the deviations, three for a quaternion, that keep the constraints; None
                         without constraints
    """

    shown = ("state_names", "input_names", "y", "u", "A", "B")

    A: FloatArray
    B: FloatArray
    state_names: tuple[str, ...]
    input_names: tuple[str, ...]
    y: FloatArray
    u: FloatArray
    rates: FloatArray
    quaternions: tuple[tuple[int, int, int, int], ...]
    manifold: Manifold | None = None

    def reduced(self) -> "Linearisation":
        """The same system with as many states as independent positions and velocities.

        Four deviations of a quaternion become three rotations, rad, about the body's own axes,
        named `<prefix>_rx`, …: q + δq = q (1, δr/2). With δy = T δx the system is
        ẋ = T⁺ (A T - Ṫ) x + T⁺ B u, where Ṫ follows the motion and is zero at rest. Without
        quaternions nothing changes.

        With constraints only the independent deviations are left; the others follow from them. What
        rolls has fewer independent velocities than positions.
        """
        if self.manifold:
            free = replace(self, manifold=None).reduced()
            T, kept = self.manifold
            return replace(
                free,
                A=(free.A @ T)[kept],
                B=free.B[kept],
                state_names=tuple(free.state_names[i] for i in kept),
            )
        if not self.quaternions:
            return self
        basis = tangents(self.y, self.quaternions)
        basis_rate = tangents(self.rates, self.quaternions, plain=0.0)
        inverse = basis.T / np.sum(basis**2, axis=0)[:, np.newaxis]  # its columns are orthogonal
        return Linearisation(
            A=inverse @ (self.A @ basis - basis_rate),
            B=inverse @ self.B,
            state_names=_deviations(self.state_names, self.quaternions),
            input_names=self.input_names,
            y=self.y,
            u=self.u,
            rates=self.rates,
            quaternions=(),
        )

    def discrete(self, period: float, noise: FloatArray | None = None) -> Discrete:
        """The `reduced` system from one sample to the next, with inputs held for `period` s.

        `noise` (n, n) is the spectral density of white noise in the rates, of which `Q` is what it
        adds to the covariance. Raises `RunError` for a period that is not positive.
        """
        least = self.reduced()
        names = least.state_names, least.input_names
        return discrete_of(least.A, least.B, names, period, noise)

    @property
    def basis(self) -> FloatArray:
        """T (ny, n) of δy = T δx, where δx are the deviations of the `reduced` system."""
        free = tangents(self.y, self.quaternions)
        return free @ self.manifold.T if self.manifold else free

    @property
    def modes(self) -> tuple[Mode, ...]:
        """The modes of the `reduced` system, the fastest growing first."""
        return tuple(modes(self.reduced().A))

    @property
    def stability(self) -> str:
        """One of "unstable", "stable" (asymptotically), or "marginal"."""
        return stability(list(self.modes))

    @property
    def controllable_rank(self) -> int:
        """The dimension of the controllable subspace of the `reduced` system."""
        least = self.reduced()
        return controllable_rank(least.A, least.B)


def linearise(
    module: GeneratedModule, y: FloatArray, u: Any = None, p: Any = None
) -> Linearisation:
    """Linearise a module of form [q, v] about the state `y` (ny,), SI units.

    `u` and `p` are inputs and parameters as the module takes them: None, by name, or in order.
    Raises `RunError` if the module has another form, lacks `input_jacobian`, or refuses `u` or `p`,
    or if a quaternion is not of unit length.
    """
    if module.FORM != "velocity":
        raise RunError(f"linearise: needs the form 'velocity', not '{module.FORM}'")
    y = np.array(y, dtype=np.float64)
    if y.shape != (len(module.STATES),):
        raise RunError(f"linearise: y has shape {y.shape}, not ({len(module.STATES)},)")
    for indices in module.QUATERNIONS:
        length = float(np.linalg.norm(y[list(indices)]))
        if not abs(length - 1) < _UNIT:
            name = module.STATES[indices[0]]
            raise RunError(
                f"linearise: the quaternion that starts at {name} has length {length:g}; scale it "
                "to 1"
            )
    inputs = input_values(module, u)
    rates, by_state, by_input = (
        evaluated(function, y, p, inputs, "linearise")
        for function in (module.derivative, module.jacobian, input_jacobian(module))
    )
    return Linearisation(
        A=by_state,
        B=by_input,
        state_names=module.STATES,
        input_names=tuple(module.INPUTS),
        y=y,
        u=inputs,
        rates=rates,
        quaternions=module.QUATERNIONS,
        manifold=manifold(module, y, p, inputs) if is_constrained(module) else None,
    )


def is_steady(module: GeneratedModule, made: Linearisation, p: Any = None) -> bool:
    """Whether `made` is about a steady motion. Its velocities are not all 0; they and the
    controller states are constant; and A and B are the same after the motion has moved on by half a
    radian or metre, except for rounding.
    """
    nq = len(module.POSITIONS)
    fastest = float(np.max(np.abs(made.rates[:nq]), initial=0.0))
    rest = float(np.max(np.abs(made.rates[nq:]), initial=0.0))
    here = made.reduced()
    size = max(1.0, float(np.max(np.abs(here.A), initial=0.0)))
    if not fastest > 0 or rest > _STEADY * size:
        return False
    y = made.y + 0.5 / fastest * made.rates
    for indices in map(list, module.QUATERNIONS):
        y[indices] /= np.linalg.norm(y[indices])
    try:
        there = linearise(module, y, made.u, p)
    except RunError:
        return False
    on = there.reduced()
    left = (there.rates[nq:], here.A - on.A, here.B - on.B)
    return all(float(np.max(np.abs(part), initial=0.0)) <= _STEADY * size for part in left)


def evaluated(
    function: Callable[..., FloatArray], y: FloatArray, p: Any, u: FloatArray, what: str
) -> FloatArray:
    """A function of a module at a state. Raises `RunError` if it fails or is not finite."""
    try:
        with np.errstate(all="ignore"):
            result = function(0.0, y, p, u)
    except (ValueError, ArithmeticError) as error:
        raise RunError(f"{what}: {error}") from None
    if not np.all(np.abs(result) < BOUND):
        raise RunError(f"{what}: the result overflows at this state; change state or parameters")
    return result


def input_jacobian(module: GeneratedModule) -> Callable[..., FloatArray]:
    """∂ẏ/∂u of a module as a function of t, y, p, u. Raises `RunError` if it has none."""
    if not module.INPUTS:
        return lambda t, y, p, u: np.zeros((len(y), 0))
    function: Callable[..., FloatArray] | None = getattr(module, "input_jacobian", None)
    if function is None:
        raise RunError(
            "linearise: the module has no input_jacobian; generate it with --outputs input_jacobian"
        )
    return function


def rate_unit(unit: str) -> str:
    """The unit of a rate, from the unit: m/s^2 for m/s, rad for rad s, N m/s for N m."""
    if unit.endswith("/s"):
        return f"{unit}^2"
    return unit.removesuffix(" s") if unit.endswith(" s") else f"{unit or '1'}/s"


def input_values(module: GeneratedModule, u: Any) -> FloatArray:
    """Inputs as an array (nu,) in the module's order: from None (defaults), a mapping, an array."""
    if u is None:
        u = {}
    if isinstance(u, Mapping):
        for name in u:
            if name not in module.INPUTS:
                known = ", ".join(module.INPUTS) or "none"
                raise RunError(f"inputs: no input '{name}'; known: {known}")
        u = [u.get(name, default) for name, default in module.INPUTS.items()]
    values = np.array(u, dtype=np.float64)
    if values.shape != (len(module.INPUTS),):
        raise RunError(f"inputs: have shape {values.shape}, not ({len(module.INPUTS)},)")
    return values


def _deviations(
    names: tuple[str, ...], quaternions: tuple[tuple[int, int, int, int], ...]
) -> tuple[str, ...]:
    """Names of the columns of `tangents`."""
    firsts = {indices[0] for indices in quaternions}
    rest = {i for indices in quaternions for i in indices}
    found: list[str] = []
    for i, name in enumerate(names):
        if i in firsts:
            found += [f"{name.removesuffix('qw')}r{axis}" for axis in "xyz"]
        elif i not in rest:
            found.append(name)
    return tuple(found)


def save(linearisation: Linearisation, name: str, path: Path, force: bool = False) -> None:
    """Write A and B with their names as NumPy's .npz, or as a table if `path` ends in .csv.

    Both hold the `reduced` matrices; the .npz also has `A_states` and `B_states` in terms of the
    states themselves, `y` and `u`. Raises `RunError` if `path` cannot be written or holds a file
    that is not ours.
    """
    least = linearisation.reduced()
    if path.suffix == ".csv":
        # The corner marks the file as ours: CSV readers would not skip a comment.
        corner = f"eomgen linearisation of {name}"
        lines = [",".join([corner, *least.state_names, *least.input_names])]
        for row, numbers in zip(least.state_names, np.hstack([least.A, least.B]), strict=True):
            lines.append(",".join([row, *map(repr, numbers.tolist())]))
        write_whole(path, "\n".join(lines) + "\n", force=force)
        return
    buffer = io.BytesIO()
    # `eomgen` must come first: it marks the file as ours.
    np.savez(
        buffer,
        eomgen=np.array(FORMAT),
        name=np.array(name),
        A=least.A,
        B=least.B,
        state_names=np.array(least.state_names, dtype=np.str_),
        input_names=np.array(least.input_names, dtype=np.str_),
        states=np.array(linearisation.state_names, dtype=np.str_),
        A_states=linearisation.A,
        B_states=linearisation.B,
        y=linearisation.y,
        u=linearisation.u,
        rates=linearisation.rates,
    )
    write_whole(path, buffer.getvalue(), force=force)
