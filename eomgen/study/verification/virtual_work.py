"""A numeric solver that shares nothing with the recursions: free bodies and virtual work.

It writes down only poses, joint by joint from the world outwards, as rotation matrices and
positions. Velocities and accelerations come from their derivatives: each rotation and position has
its value, its partial derivatives along each velocity, and its second time derivative at constant
velocities. Each body is then free, by Newton and Euler, m a = f and I α + ω x I ω = n. By
d'Alembert's principle, joint reactions do no virtual work, so that

    Σ J_pᵀ (m a - f) + J_wᵀ (I α + ω x I ω - n) = 0,    J_p = ∂ position'/∂v,  J_w = ∂ω/∂v.

Unlike the recursions, it passes no velocity from body to body, shifts no inertia to another point,
and carries no force inwards. Dense elimination with partial pivoting solves for v̇. Joints are
composed of their primitives; effects state loads and energies.

Constraints J v̇ + β = 0 join as further rows, and their multipliers λ as further unknowns:

    [M  -Jᵀ] [v̇]   [F - h]
    [J   0 ] [λ] = [ -β  ]

J is the virtual work of unit multipliers; ġ and β are first and second differences of the residuals
g along the motion at constant velocities.

Numbers are MPFR's, with 60 digits. Driving formulas are differentiated by central differences.
"""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from gmpy2 import mpfr
from numpy.typing import NDArray

from eomgen.scene.constraints.base import Row
from eomgen.scene.effects.base import JointLoad, Load
from eomgen.scene.joints.base import WORLD, Geared, WithRotor
from eomgen.study.precision.extended import NOTHING, Array, extended, solved, zeros
from eomgen.study.precision.precise import Extended
from eomgen.study.verification.evaluated import EvaluatedModel
from eomgen.study.verification.poses import composed

_MOMENT = mpfr(2) ** -50
"""Step of the differences of constraints, s, for rates of order 1."""


class VirtualWork(EvaluatedModel):
    """M v̇ + V + G = F of a model at a time and a state."""

    # Equations of motion.

    @cached_property
    def inertias(self) -> list[Array]:
        """The inertia of each body about its centre of mass, world axes, (3, 3), kg m²."""
        found = []
        for body, pose in zip(self.model.bodies, self.poses, strict=True):
            entries = [self.value(entry) for entry in body.inertia_com]
            if len(entries) == 1:
                matrix = zeros(3, 3)
                matrix[2, 2] = entries[0]
            else:
                xx, yy, zz, xy, xz, yz = entries
                matrix = extended([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            found.append(pose.rotation @ matrix @ pose.rotation.T)
        return found

    @cached_property
    def _whole_matrix(self) -> Array:
        """M of all velocities that move, including the driven ones, (m, m)."""
        matrix = zeros(self.moved, self.moved)
        for k, (name, pose) in enumerate(zip(self.bodies, self.poses, strict=True)):
            moving = self.carrying[k]
            position_v, spin_v = pose.position_v[moving], pose.spin_v[moving]
            part = (
                position_v @ (self.mass(name) * position_v.T) + spin_v @ self.inertias[k] @ spin_v.T
            )
            at = np.ix_(moving, moving)
            matrix[at] = matrix[at] + part
        for i, armature in self.rotors.items():
            matrix[i, i] = matrix[i, i] + armature
        return matrix

    @cached_property
    def rotors(self) -> dict[int, Extended]:
        """Reflected inertia of rotors, by velocity, kg m² or kg."""
        found = {}
        for index in self.model.joint_indices:
            joint = index.body.joint
            if isinstance(joint, WithRotor):
                inertia = self.value(joint.motor_inertia)
                if isinstance(joint, Geared) and joint.gear_ratio is not None:
                    inertia = self.value(joint.gear_ratio) ** 2 * inertia
                found.update({i: inertia for i in index.v if i < self.moved})
        return found

    @cached_property
    def _resisting(self) -> tuple[Array, Array]:
        """Generalised inertial forces at constant velocities (m,), and the sizes of their terms."""
        total, sizes = zeros(self.moved), zeros(self.moved)
        left_out = "velocity_forces" in self.model.leave_out
        pace = np.max(abs(self.felt), initial=mpfr(0))
        # If all terms cancel, as in a free body that rotates evenly, none is left to compare with.
        least = NOTHING * pace * pace
        for k, (name, pose) in enumerate(zip(self.bodies, self.poses, strict=True)):
            force = self.mass(name) * pose.position_b
            torque = self.inertias[k] @ pose.spin_b
            if not left_out:
                w = self.spin(k)
                torque = torque + np.cross(w, self.inertias[k] @ w)
            total = total + pose.position_v @ force + pose.spin_v @ torque
            sizes = sizes + _reach(pose.position_v, force) + _reach(pose.spin_v, torque)
            sizes = sizes + _reach(pose.position_v, least * self.mass(name) * self.reach)
            sizes = sizes + _reach(pose.spin_v, least * self.inertias[k])
        return total, sizes

    def pushed(self, loads: Sequence[Load | JointLoad]) -> tuple[Array, Array]:
        """Generalised forces of loads (m,), and the sizes of their terms."""
        total, sizes = zeros(self.moved), zeros(self.moved)
        for load in loads:
            if isinstance(load, JointLoad):
                i = self.joint_indices[load.joint].v[load.coordinate]
                if i < self.moved:
                    total[i] = total[i] + load.force
                    sizes[i] = sizes[i] + abs(load.force)
            elif load.body != WORLD:
                pose = self.poses[self.index[load.body]]
                force, torque = self.in_space(load.force), self.torque(load)
                at = pose.position_v + pose.rotation_v @ self.in_space(load.at)
                total = total + at @ force + pose.spin_v @ torque
                sizes = sizes + _reach(at, force) + _reach(pose.spin_v, torque)
        return total, sizes

    def torque(self, load: Load) -> Array:
        """The torque of a load, world axes, (3,), N m."""
        return extended(
            [*(0.0,) * (3 - len(load.torque)), *load.torque] if load.torque else [0.0] * 3
        )

    @cached_property
    def _loads(self) -> dict[str, tuple[Array, Array]]:
        """The generalised forces of gravity, and of all other loads."""
        kinds: dict[str, list[Load | JointLoad]] = {"gravity": [], "applied": []}
        for effect in self.model.effects:
            for load in effect.loads(self):
                kinds["applied" if isinstance(load, JointLoad) else load.kind].append(load)
        return {kind: self.pushed(loads) for kind, loads in kinds.items()}

    @cached_property
    def mass_matrix(self) -> Array:
        """M (nv, nv)."""
        return self._whole_matrix[: self.nv, : self.nv]

    @cached_property
    def velocity_force(self) -> Array:
        """V (nv,), including the inertial forces of driven accelerations."""
        resisting = self._resisting[0][: self.nv]
        if not self.model.driven:
            return resisting
        return resisting + self._whole_matrix[: self.nv, self.nv :] @ self.driven_rates

    @cached_property
    def gravity_force(self) -> Array:
        """G (nv,)."""
        return -self._loads["gravity"][0][: self.nv]

    @cached_property
    def bias_force(self) -> Array:
        """h = V + G."""
        return self.velocity_force + self.gravity_force

    @cached_property
    def applied_force(self) -> Array:
        """F (nv,)."""
        return self._loads["applied"][0][: self.nv]

    @cached_property
    def bias_sizes(self) -> Array:
        """Sum of the sizes of all terms of V and G, (nv,)."""
        found = self._resisting[1] + self._loads["gravity"][1]
        if self.model.driven:
            found = found + abs(self._whole_matrix[:, self.nv :]) @ abs(self.driven_rates)
        return found[: self.nv]

    @cached_property
    def applied_sizes(self) -> Array:
        """Sum of the sizes of all terms of F, (nv,)."""
        return self._loads["applied"][1][: self.nv]

    @cached_property
    def vd(self) -> Array:
        """v̇ (nv,). Raises `ZeroDivisionError` if M is singular, or J M⁻¹ Jᵀ."""
        return self._solution[: self.nv]

    @cached_property
    def constraint_forces(self) -> Array:
        """λ (nc,), N or N m."""
        return self._solution[self.nv :]

    @cached_property
    def _solution(self) -> Array:
        right, nc = self.applied_force - self.bias_force, len(self.model.rows)
        if not nc:
            return solved(self.mass_matrix, right)
        J = self.constraint_jacobian[:, : self.nv]
        matrix = np.block([[self.mass_matrix, -J.T], [J, zeros(nc, nc)]])
        return solved(matrix, np.concatenate([right, -self.bend]))

    def driving_forces(self, vd: Array) -> Array:
        """Force or torque on each driven velocity at the v̇ of the others, N or N m."""
        whole = np.concatenate([vd, self.driven_rates])
        needed = self._whole_matrix @ whole + self._resisting[0]
        loads = self._loads["gravity"][0] + self._loads["applied"][0] + self.constraint_push[0]
        return (needed - loads)[self.nv :]

    def driving_sizes(self, vd: Array) -> Array:
        """Sum of the sizes of the terms of these forces."""
        whole = abs(np.concatenate([vd, self.driven_rates]))
        sizes = abs(self._whole_matrix) @ whole + self._resisting[1]
        loads = self._loads["gravity"][1] + self._loads["applied"][1] + self.constraint_push[1]
        return (sizes + loads)[self.nv :]

    # Constraints.

    @cached_property
    def constraint_rows(self) -> list[Row]:
        """The rows of all constraints, without those that follow from others."""
        found = [row for constraint in self.model.constraints for row in constraint.rows(self)]
        names = [name for name, _ in self.model.every_row]
        kept = zip(names, found, strict=True)
        return [row for name, row in kept if name not in self.model.dropped]

    @cached_property
    def constraint_jacobian(self) -> Array:
        """J by all velocities that move, (nc, m)."""
        rows = [self.pushed(row.loads)[0] for row in self.constraint_rows]
        return np.array(rows, dtype=object).reshape(len(rows), self.moved)

    @cached_property
    def constraint_push(self) -> tuple[Array, Array]:
        """Jᵀ λ (m,), and the sizes of its terms."""
        J, found = self.constraint_jacobian, self.constraint_forces
        if not len(found):
            return zeros(self.moved), zeros(self.moved)
        return J.T @ found, abs(J).T @ abs(found)

    @cached_property
    def constraint_residuals(self) -> Array:
        """g (nc,); 0 for rows of velocities alone."""
        rows = self.constraint_rows
        return extended([mpfr(0) if row.residual is None else row.residual for row in rows])

    @cached_property
    def constraint_rates(self) -> Array:
        """ġ (nc,) by differences of g, or J v where only the rate is constrained."""
        ahead, behind, step = self._around
        change = (ahead.constraint_residuals - behind.constraint_residuals) / (2 * step)
        return np.where(self._holonomic, change, self._restricted_rates)

    @cached_property
    def bend(self) -> Array:
        """β (nc,): g̈ at v̇ = 0."""
        ahead, behind, step = self._around
        here = self.constraint_residuals
        second = (ahead.constraint_residuals - 2 * here + behind.constraint_residuals) / step**2
        first = (ahead._restricted_rates - behind._restricted_rates) / (2 * step)
        return np.where(self._holonomic, second, first)

    @cached_property
    def _holonomic(self) -> NDArray[np.bool_]:
        return np.array([row.residual is not None for row in self.constraint_rows])

    @cached_property
    def _restricted_rates(self) -> Array:
        drift = [mpfr(0) if row.drift is None else row.drift for row in self.constraint_rows]
        return self.constraint_jacobian @ self.rates + extended(drift)

    @cached_property
    def _around(self) -> tuple["VirtualWork", "VirtualWork", Extended]:
        """The model a moment later and earlier if its velocities did not change."""
        step = _MOMENT / (1 + max(map(abs, self.rates)))
        return self._later(step), self._later(-step), step

    def _later(self, step: Extended) -> "VirtualWork":
        nq = len(self.model.coordinates)
        q = extended(self.q[:nq])
        q = q + step * self._position_rates(q) + step**2 / 2 * self._bends(q)
        given = self.values
        y = [*q, *given.v, *given.states.values()]
        return VirtualWork(self.model, given.time + step, y, given.inputs, given.parameters)

    def _bends(self, q: Array) -> Array:
        """q̈ at constant velocities: of quaternions alone."""
        found = self._position_rates(self._position_rates(q))
        for index in self.model.joint_indices:
            for i, j in index.plain:
                if j < self.nv:
                    found[i] = mpfr(0)
        return found

    def _position_rates(self, q: Array) -> Array:
        """q̇ (nq,)."""
        found: list[Extended] = []
        for index in self.model.joint_indices:
            found += [self.v[j] for _, j in index.plain if j < self.nv]
            if index.quaternion:
                spin = extended([self.v[j] for j in index.spin])
                found += list(composed(extended([q[i] for i in index.quaternion]), spin) / 2)
        return extended(found)

    @cached_property
    def state_rates(self) -> Array:
        """ẏ (ny,): the rates of coordinates, velocities and extra states."""
        extra = [rate for effect in self.model.effects for rate in effect.rates(self)]
        return extended([*self._position_rates(extended(self.q)), *self.vd, *extra])

    @cached_property
    def reach(self) -> Extended:
        """Sum of the distances of all bodies from their parents, m: a bound of any position."""
        total = mpfr(0)
        for body, pose in zip(self.model.bodies, self.poses, strict=True):
            base = self.poses[body.parent].position if body.parent >= 0 else zeros(3)
            total += np.sum(abs(pose.position - base))
        return total


def _reach(slopes: Array, force: Array | Extended) -> Array:
    """Greatest power of a force, of any direction, along partial velocities (m, 3), (m,)."""
    return np.sum(abs(slopes), axis=1) * np.sum(abs(force))
