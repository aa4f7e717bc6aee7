"""Laws of mechanics that a module's accelerations must obey, and what exact motion conserves.

All is computed in 60 digits from free bodies. Kinetic energy and momentum are differenced along the
motion that the module gives; their rates must be the power of all loads and drives, and the
external forces. The module's Jacobian is compared with differences of the independent solver.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from gmpy2 import mpfr

from eomgen.model.model import Model
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import FloatArray
from eomgen.scene.effects.base import JointLoad
from eomgen.scene.joints.base import WORLD, Coordinate
from eomgen.study.precision.extended import (
    NOTHING,
    Array,
    doubles,
    extended,
    extended_digits,
    of_unit_length,
    solved,
    zeros,
)
from eomgen.study.precision.precise import Extended
from eomgen.study.verification.free_bodies import FreeBodies
from eomgen.study.verification.hard_states import State
from eomgen.study.verification.losses import rest_of, ulps
from eomgen.study.verification.roundings import ULP, Roundings, spread, worst_share
from eomgen.study.verification.slopes import SMOOTH, STEP
from eomgen.study.whole import Viewed, names_of, own_of

_LONG_STEP = mpfr(2) ** -40
"""That for slopes under constraints, whose β is itself a difference, with an error of 1e-30."""
_LEFT = 1e-45
"""Rounding error of a difference that should be 0, relative to what is differenced."""
_NEAR = 2
"""Neighbours of a state whose slopes are compared."""
AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Broken:
    """The errors of laws at a state, in ulps of their terms; None where a law does not apply.

    energy    kinetic energy changes by the power of loads and drives
    momentum  linear and angular momentum change by the external loads
    slopes    the Jacobian, along a random direction
    rows      the greatest error of one of its rows there, in units of what rounding makes of it
    """

    state: State
    energy: float | None
    momentum: float | None
    slopes: float | None
    rows: float | None


def why_no_energy_law(model: Model) -> str:
    """Why the energy law does not apply to a model; "" if it does."""
    return "velocity forces are left out on purpose" if model.leave_out else ""


def why_no_momentum_law(model: Model) -> str:
    """Why the momentum law does not apply to a model; "" if it does."""
    if model.leave_out:
        return "velocity forces are left out on purpose"
    held = [b.joint.name for b in model.bodies if b.parent < 0 and b.joint.holds]
    given = {c.position.name for c in model.prescribed}
    held += [
        b.joint.name
        for b in model.bodies
        if b.parent < 0 and any(c.name in given for c in b.positions)
    ]
    held += [c.name for c in model.constraints if not c.internal]
    return f"the world holds {', '.join(dict.fromkeys(held))}" if held else ""


def broken(model: Model, module: GeneratedModule, roundings: Roundings, state: State) -> Broken:
    """The errors of all laws that apply, at a state where the module has a derivative."""
    ydot = module.derivative(state.t, state.y, None, state.u or None)
    nq, nv = len(model.coordinates), len(model.velocities)
    with extended_digits():
        y = of_unit_length(extended(state.y), model.quaternions)
        free = FreeBodies(model, state.t, y, state.u)
        vd = extended(ydot[nq : nq + nv])
        # Coordinates follow the velocities exactly: rounding of their rates is checked elsewhere.
        direction = np.concatenate([free.state_rates[:nq], vd, free.state_rates[nq + nv :]])
        ahead, behind, step = _beside(model, state, y, direction)
        energy = momentum = None
        if not why_no_energy_law(model):
            change = (ahead.kinetic_energy - behind.kinetic_energy) / step
            powers, sizes = free.powers
            held, held_sizes = free.constraint_push
            power = np.sum(powers, initial=mpfr(0)) + held @ free.rates
            needed = abs(free.mass_matrix) @ abs(vd) + free.bias_sizes + free.applied_sizes
            needed = needed + held_sizes[:nv]
            # At both ends of the difference, bodies that are at rest here move.
            scale = (abs(free.rates[:nv]) + step * abs(vd)) @ needed
            scale += np.sum(sizes, initial=mpfr(0))
            scale += _LEFT * free.kinetic_energy / step
            if model.driven:
                power += free.driving_forces(vd) @ free.rates[nv:]
                scale += free.driving_sizes(vd) @ abs(free.rates[nv:])
            energy = ulps(extended([change - power]), extended([scale]))
        if not why_no_momentum_law(model):
            change = (ahead.momentum - behind.momentum) / step
            outside, sizes = _outside(free)
            sizes = sizes + free.inertial_sizes(vd) + _LEFT * free.momentum_sizes / step
            # Force and moment separately: they have different units.
            momentum = max(
                ulps((change - outside)[part], sizes[part]) for part in (slice(3), slice(3, 6))
            )
        slopes, rows = _slopes(module, roundings, state, y, free) or (None, None)
        return Broken(state, energy, momentum, slopes, rows)


def _slopes(
    module: GeneratedModule, roundings: Roundings, state: State, y: Array, free: FreeBodies
) -> tuple[float, float] | None:
    """The error of the Jacobian along a direction, in ulps of its terms, and of its worst row, in
    units of what rounding makes of it; None at a corner, where there are two derivatives.
    """
    model = free.model
    if isinstance(module, Viewed):
        return _slopes_in_closed_form(module, roundings, state, y, free)
    if not (hasattr(module, "jacobian") and len(y)):
        return None
    direction = _some_direction(len(y))
    for indices in map(list, model.quaternions):  # tangent to the sphere of unit quaternions
        direction[indices] = direction[indices] - y[indices] * (direction[indices] @ y[indices])
    change = _change_along(model, state, y, free, direction)
    if change is None:
        return None
    given = module.jacobian(state.t, state.y, None, state.u or None)
    if not np.isfinite(given).all():
        return float("inf"), float("inf")
    made = extended(given), direction, change
    left = rest_of(model) * _size_of_terms(free, direction) if model.constraints else mpfr(0)
    whole = _ulps_of(*made, len(model.coordinates), model.velocities, left=left)
    here = dict(zip(names_of(model), state.y, strict=True))
    return whole, _rows(*made, roundings, state, here, rest_of(model), 0.0)


def _change_along(
    model: Model, state: State, y: Array, free: FreeBodies, direction: Array
) -> Array | None:
    """The derivative of the rates along a direction; None at a corner."""
    ahead, behind, step = _beside(model, state, y, direction, still=True)
    bend = ahead.state_rates - 2 * free.state_rates + behind.state_rates
    change = ahead.state_rates - behind.state_rates
    if max(abs(bend)) > SMOOTH * max(abs(change)):
        return None
    return np.asarray(change / step)


def _rows(
    slopes: Array,
    direction: Array,
    change: Array,
    roundings: Roundings,
    state: State,
    y: Mapping[str, float],
    least: float,
    moved: Any,
) -> float:
    """The error of the worst row of slopes along a direction, in units of what rounding makes of
    it; `y` has the numbers of the module's state, `least` is what 60 digits leave
    of the terms, and `moved` what else is rounding.
    """
    along = doubles(direction)
    if roundings.tangent("jacobian"):
        runs = roundings.runs("jacobian", state.t, y, state.u, along)
    else:
        runs = np.tensordot(along, roundings.runs("jacobian", state.t, y, state.u), (0, 1))
    error = doubles(slopes @ direction - change)
    terms = abs(doubles(slopes)) @ abs(along)
    rest = least * np.max(terms + abs(doubles(change)))
    return worst_share(error, spread(runs) + ULP * terms + moved + rest)[0]


def _some_direction(count: int) -> Array:
    rng = np.random.default_rng(1)
    return extended(rng.uniform(0.5, 1.0, count) * rng.choice((-1.0, 1.0), count))


def _ulps_of(
    slopes: Array,
    direction: Array,
    change: Array,
    nq: int,
    velocities: Sequence[Coordinate],
    least: Any = 0.0,
    left: Any = 0.0,
) -> float:
    """The error of slopes along a direction, in ulps of their terms, those of velocities of a unit
    together; `least` is a size of the terms of these, which may cancel, and `left` what 60 digits
    leave of these.
    """
    scale = abs(slopes) @ abs(direction) + abs(change)
    scale[nq : nq + len(velocities)] += mpfr(least)
    rows = [c.unit for c in velocities]
    for unit in dict.fromkeys(rows):
        group = [nq + i for i, other in enumerate(rows) if other == unit]
        scale[group] = max(scale[group])
    return ulps(np.maximum(abs(slopes @ direction - change) - left, 0), scale)


def _slopes_in_closed_form(
    module: Viewed, roundings: Roundings, state: State, y: Array, free: FreeBodies
) -> tuple[float, float] | None:
    """The same of a module of fewer states: along a direction of these, the others follow so that
    J dq = 0 and J dv + dJ v = 0.
    """
    model, own = free.model, module.own
    if not hasattr(own, "jacobian"):
        return None
    names = names_of(model)
    kept = [names.index(name) for name in own.STATES]
    direction = _some_direction(len(kept))
    found = _change_in_closed_form(module, state, y, free, direction)
    given = own.jacobian(state.t, own_of(own, model, state.y), None, state.u or None)
    if found is None:
        return None
    if not np.isfinite(given).all():
        return float("inf"), float("inf")
    change, least = found
    made, velocities = (extended(given), direction, change), model.velocities
    velocities = tuple(c for c in velocities if c.name in own.STATES)
    whole = _ulps_of(*made, len(own.POSITIONS), velocities, least)

    def change_at(beside: Array, near: FreeBodies) -> Array | None:
        other = _change_in_closed_form(module, state, beside, near, direction)
        return None if other is None else other[0]

    moved = _moved(model, state, y, change, change_at)
    if moved is None:
        return whole, 0.0
    here = dict(zip(names, state.y, strict=True))
    return whole, _rows(*made, roundings, state, here, rest_of(model), moved)


def _moved(
    model: Model,
    state: State,
    y: Array,
    change: Array,
    change_at: Callable[[Array, FreeBodies], Array | None],
) -> FloatArray | None:
    """How far a change along a direction moves between neighbours of a state, which is rounding of
    what follows from the module's states; None where a neighbour has a corner or differences of
    differences leave no digits.
    """
    moved = np.zeros(len(change))
    for seed in range(_NEAR):
        beside = y * (1 + extended(np.random.default_rng(seed).uniform(-ULP, ULP, len(y))))
        found = change_at(beside, FreeBodies(model, state.t, beside, state.u))
        if found is None:
            return None
        moved = np.maximum(moved, abs(doubles(found - change)))
    return moved


def _change_in_closed_form(
    module: Viewed, state: State, y: Array, free: FreeBodies, direction: Array
) -> tuple[Array, Extended] | None:
    """The change of the rates of the module's states along a direction of these, and the size of
    its terms; None at a corner.
    """
    model, own = free.model, module.own
    names, nq = names_of(model), len(model.coordinates)
    kept = [names.index(name) for name in own.STATES]
    whole, at = zeros(len(y)), slice(nq, nq + free.nv)
    whole[kept] = direction
    place = {j: i for index in model.joint_indices for i, j in index.plain}
    plain = extended([whole[place[j]] if j in place else mpfr(0) for j in range(free.nv)])
    plain = _following(free, own.FOLLOWING, plain, zeros(len(free.model.rows)))
    for j, i in place.items():
        whole[i] = plain[j]
    still = whole.copy()
    still[at] = mpfr(0)
    ahead, behind, step = _beside(model, state, y, still, still=True)
    turned = (ahead.constraint_jacobian - behind.constraint_jacobian) / step
    whole[at] = _following(
        free, own.FOLLOWING, whole[at], turned[:, : free.nv] @ free.rates[: free.nv]
    )
    change = _change_along(model, state, y, free, whole)
    if change is None:
        return None
    return change[kept], _size_of_terms(free, whole[at])


def _size_of_terms(free: FreeBodies, direction: Array) -> Extended:
    """The size of terms of ω v, which may cancel: β is a second difference of positions."""
    return max(abs(free.rates)) * (max(abs(free.rates)) + max(abs(direction)))


def _following(free: FreeBodies, names: Sequence[str], v: Array, more: Array) -> Array:
    """v (nv,) with the velocities of these names such that J v + `more` = 0."""
    own = [j for j, c in enumerate(free.model.velocities) if c.name in names]
    found, J = v.copy(), free.constraint_jacobian[:, : free.nv]
    found[own] = mpfr(0)
    found[own] = solved(J[:, own], -(J @ found + more))
    return found


def _beside(
    model: Model, state: State, y: Array, direction: Array, *, still: bool = False
) -> tuple[FreeBodies, FreeBodies, Extended]:
    """The model a small step ahead along `direction` and one behind, and the time between, s.

    Time advances by the same step unless `still`.
    """
    longest = _LONG_STEP if still and model.constraints else STEP
    step = longest / (1 + max(map(abs, direction), default=0))
    time = mpfr(0) if still else step
    ahead = FreeBodies(model, state.t + time, y + step * direction, state.u)
    behind = FreeBodies(model, state.t - time, y - step * direction, state.u)
    return ahead, behind, 2 * step


def _outside(free: FreeBodies) -> tuple[Array, Array]:
    """Force and moment about the world's origin of all external loads, (6,), and sizes of terms.

    Forces between bodies and torques in joints cancel.
    """
    total, sizes = zeros(6), zeros(6)
    for effect in free.model.effects:
        for load in effect.loads(free):
            if isinstance(load, JointLoad) or load.body == WORLD:
                continue
            force = free.in_space(load.force)
            position = free.in_space(free.position(load.body, load.at))
            wrench = np.concatenate([force, np.cross(position, force) + free.torque(load)])
            reach, size = np.sum(abs(position)), np.sum(abs(force))
            total = total + wrench
            sizes = sizes + np.concatenate(
                [zeros(3) + size, zeros(3) + reach * size + np.sum(abs(free.torque(load)))]
            )
    return total, sizes


@dataclass(frozen=True)
class Kept:
    """What exact motion conserves, with inputs 0, as its rates at some states show.

    energy    whether the sum of kinetic and potential energy is conserved
    takers    effects that supply or dissipate energy
    momentum  the conserved components, "x", …, "about z"
    """

    energy: bool
    takers: tuple[str, ...]
    momentum: tuple[str, ...]


def kept(model: Model, states: Sequence[State]) -> Kept:
    """What is conserved at all of the given states; nothing if there are none."""
    lost_energy = not states
    takers: dict[str, None] = {}
    names = [*AXES, *(f"about {axis}" for axis in AXES)]
    if model.dimensions == 2:
        names = ["x", "y", "", "", "", "about z"]
    lost = [not (name and states) for name in names]
    with extended_digits():
        for state in states:
            y = of_unit_length(extended(state.y), model.quaternions)
            free = FreeBodies(model, state.t, y, {})
            still = replace(state, u={})
            ahead, behind, step = _beside(model, still, y, free.state_rates)
            powers, sizes = free.powers
            stored = (ahead.potential_energies - behind.potential_energies) / step
            for effect, power, gone, size in zip(model.effects, powers, stored, sizes, strict=True):
                if effect.prescribes() or not _is_nothing(power + gone, size + abs(gone)):
                    takers[effect.name] = None
            change = (ahead.kinetic_energy - behind.kinetic_energy) / step
            scale = np.sum(sizes, initial=mpfr(0)) + abs(free.rates[: free.nv]) @ free.bias_sizes
            total = change + np.sum(stored, initial=mpfr(0))
            lost_energy |= not _is_nothing(total, scale + abs(change))
            rates = (ahead.momentum - behind.momentum) / step
            pace = abs(free.state_rates)
            scale = free.momentum_sizes + np.max(abs(rates)) + np.max(pace, initial=0) * NOTHING
            lost = [
                gone or not _is_nothing(rate, size)
                for gone, rate, size in zip(lost, rates, scale, strict=True)
            ]
    return Kept(
        not lost_energy,
        tuple(takers),
        tuple(name for name, gone in zip(names, lost, strict=True) if not gone),
    )


def _is_nothing(rate: Extended, scale: Extended) -> bool:
    return bool(abs(rate) <= NOTHING * scale)
