"""Energy, momentum and powers of free bodies, in 60 digits."""

from functools import cached_property

import numpy as np
from gmpy2 import mpfr

from eomgen.study.precision.extended import Array, along, extended, zeros
from eomgen.study.precision.precise import Extended
from eomgen.study.verification.virtual_work import VirtualWork


class FreeBodies(VirtualWork):
    """A model at a time and a state, by virtual work, with what exact motion balances."""

    @cached_property
    def kinetic_energy(self) -> Extended:
        """The kinetic energy of all bodies and rotors, J."""
        energy = mpfr(0)
        for k, (name, pose) in enumerate(zip(self.bodies, self.poses, strict=True)):
            u, w = along(self.rates, pose.position_v), self.spin(k)
            energy += (self.mass(name) * (u @ u) + w @ self.inertias[k] @ w) / 2
        for i, armature in self.rotors.items():
            energy += armature * self.rates[i] ** 2 / 2
        return energy

    @cached_property
    def potential_energy(self) -> Extended:
        """The potential energy of all effects, J."""
        return np.sum(self.potential_energies, initial=mpfr(0))

    @cached_property
    def potential_energies(self) -> Array:
        """The potential energy of each effect, J."""
        return extended([effect.potential_energy(self) for effect in self.model.effects])

    @cached_property
    def momentum(self) -> Array:
        """Linear momentum, then angular momentum about the world's origin, world axes, (6,)."""
        return self._momentum[0]

    @cached_property
    def momentum_sizes(self) -> Array:
        """Sum of the sizes of the terms of momentum, (6,)."""
        return self._momentum[1]

    @cached_property
    def _momentum(self) -> tuple[Array, Array]:
        total, sizes = zeros(6), zeros(6)
        for k, (name, pose) in enumerate(zip(self.bodies, self.poses, strict=True)):
            p = self.mass(name) * along(self.rates, pose.position_v)
            spin = self.inertias[k] @ self.spin(k)
            total = total + np.concatenate([p, np.cross(pose.position, p) + spin])
            arm, force = abs(pose.position), abs(p)
            moment = np.sum(arm) * np.sum(force) + np.sum(abs(spin))
            sizes = sizes + np.concatenate([zeros(3) + np.sum(force), zeros(3) + moment])
        return total, sizes

    def inertial_sizes(self, vd: Array) -> Array:
        """Sum of the sizes of all terms of the rate of momentum at v̇, (6,)."""
        whole, sizes = np.concatenate([vd, self.driven_rates]), zeros(6)
        for k, (name, pose) in enumerate(zip(self.bodies, self.poses, strict=True)):
            w, inertia = self.spin(k), self.inertias[k]
            force = self.mass(name) * (abs(pose.position_b) + abs(along(whole, pose.position_v)))
            spin = abs(inertia) @ (abs(pose.spin_b) + abs(along(whole, pose.spin_v)))
            spin = spin + abs(np.cross(w, inertia @ w))
            linear, moment = np.sum(force), np.sum(spin)
            moment = moment + np.sum(abs(pose.position)) * linear
            sizes = sizes + np.concatenate([zeros(3) + linear, zeros(3) + moment])
        return sizes

    @cached_property
    def _pushes(self) -> list[tuple[Array, Array]]:
        return [self.pushed(list(effect.loads(self))) for effect in self.model.effects]

    @cached_property
    def effect_forces(self) -> tuple[Array, Array]:
        """The generalised forces of each effect's loads, and the sizes of their terms."""
        forces, sizes = (np.array([p[k][: self.nv] for p in self._pushes]) for k in (0, 1))
        return forces, sizes

    @cached_property
    def powers(self) -> tuple[Array, Array]:
        """The power of each effect's loads, W, and the sizes of its terms; 0 for drives."""
        speeds = abs(self.rates)
        return (
            extended([push @ self.rates for push, _ in self._pushes]),
            extended([sizes @ speeds for _, sizes in self._pushes]),
        )

    @cached_property
    def effect_powers(self) -> tuple[Array, Array]:
        """The same including the power of drives, at the v̇ that the effects cause."""
        powers, sizes = (x.copy() for x in self.powers)
        if self.model.driven:
            taken = dict(zip(self.model.driven, self.driving_forces(self.vd), strict=True))
            speeds = dict(zip(self.model.driven, self.rates[self.nv :], strict=True))
            at = {effect.name: k for k, effect in enumerate(self.model.effects)}
            needed = dict(zip(self.model.driven, self.driving_sizes(self.vd), strict=True))
            for drive, force in taken.items():
                k = at[str(drive.by)]
                powers[k] = force * speeds[drive]
                sizes[k] = needed[drive] * abs(speeds[drive])
        return powers, sizes
