"""A mechanism at a state: everything the recursions find, over any scalars, each thing when asked.

This is the one place that knows in which axes each algorithm is cheapest: forces and the
articulated-body recursion in the frames' own axes in space, in the world's in the plane, where
angles add up; composite bodies in the world's, where nothing is turned again and again.
"""

from collections.abc import Iterable, Sequence
from functools import cached_property

from eomgen.derivation.recursive import forces as fc
from eomgen.derivation.recursive.articulated import Pivots, articulate, respond
from eomgen.derivation.recursive.composite import (
    Entries,
    Factors,
    ancestors,
    factorised,
    mass_entries,
    solved,
)
from eomgen.derivation.recursive.motion import (
    Acceleration,
    Twist,
    accelerations,
    kinetic_energy,
    velocities,
)
from eomgen.derivation.recursive.moving import Moving, Values
from eomgen.derivation.recursive.vectors import Scalar, sub, zeros
from eomgen.effects import Effect, Gravity
from eomgen.effects.base import Contact, JointLoad, Load
from eomgen.joints import Free
from eomgen.joints.base import WORLD

__all__ = ["Dynamics", "Values"]


class Dynamics(Moving):
    """A model at given values. What is asked for is computed once; nothing else is."""

    def accelerating(
        self, vd: Sequence[Scalar] | None, *, still: bool = False, weightless: bool = False
    ) -> tuple[Acceleration, ...]:
        """Accelerations of the frames at v̇, counted from free fall; `still` leaves v out."""
        zero = self.scalars.number(0.0)
        v = [zero] * self.nv if still else self.values.v
        moving = velocities(self.instant, v, self.scalars) if still else self.moving
        nothing = zeros(self.scalars)
        base = nothing if weightless else sub(nothing, self.down)
        return accelerations(self.instant, moving, v, vd, base, self.scalars)

    def motion_in_world(
        self, vd: Sequence[Scalar]
    ) -> tuple[tuple[Twist, ...], tuple[Acceleration, ...]]:
        """Velocities and accelerations of the frames at v̇, in world axes."""
        v, base = self.values.v, sub(zeros(self.scalars), self.down)
        moving = velocities(self.in_world, v, self.scalars)
        return moving, accelerations(self.in_world, moving, v, vd, base, self.scalars)

    # Forces.

    @cached_property
    def loads(self) -> tuple[tuple[fc.PointForce, ...], tuple[JointLoad, ...]]:
        """What the effects put on bodies and joints; uniform gravity is an acceleration instead."""
        points, joints = [], []
        for effect in self.model.effects:
            if not isinstance(effect, Gravity) or effect.except_bodies:
                for load in effect.loads(self):
                    if isinstance(load, JointLoad):
                        joints.append(load)
                    elif load.body != WORLD:
                        points.append(self._point_force(load))
        return tuple(points), tuple(joints)

    def _point_force(self, load: Load) -> fc.PointForce:
        zero = self.scalars.number(0.0)
        torque = zeros(self.scalars)
        if load.torque:
            torque = (zero, zero, load.torque[0])
            if len(load.torque) == 3:
                torque = (load.torque[0], load.torque[1], load.torque[2])
        body, at, force = self.index[load.body], self._three(load.at), self._three(load.force)
        return fc.PointForce(body, at, force, torque)

    @cached_property
    def wrenches(self) -> tuple[fc.Force, ...]:
        """The loads on each frame."""
        return fc.wrenches(self.linkage, self.instant, self.loads[0], self.scalars)

    @cached_property
    def motors(self) -> list[Scalar]:
        """The loads on each velocity's own joint."""
        forces = [self.scalars.number(0.0)] * self.nv
        for load in self.loads[1]:
            i = self.first[load.joint][1] + load.coordinate
            forces[i] = forces[i] + load.force
        return forces

    @cached_property
    def applied_force(self) -> list[Scalar]:
        """F of M v̇ + V + G = F."""
        carried = fc.carried(self.instant, self.wrenches)
        parts = fc.generalised(self.instant, carried, self.nv)
        return [a + b for a, b in zip(parts, self.motors, strict=True)]

    def bias(self, *, still: bool = False, weightless: bool = False) -> list[Scalar]:
        """h = V + G; without velocities G, without weight V."""
        return self.inverse(None, still=still, weightless=weightless)

    def inverse(
        self, vd: Sequence[Scalar] | None, *, still: bool = False, weightless: bool = False
    ) -> list[Scalar]:
        """M v̇ + V + G by the recursive Newton-Euler algorithm (Featherstone 2008, 5.3)."""
        moving = self.accelerating(vd, still=still, weightless=weightless)
        inertial = fc.inertial(self.instant, moving, self.scalars)
        parts = fc.generalised(self.instant, fc.carried(self.instant, inertial), self.nv)
        if vd is None:
            return parts
        rotors = fc.rotor_forces(self.instant, vd, self.nv, self.scalars)
        return [a + b for a, b in zip(parts, rotors, strict=True)]

    # Forward dynamics.

    @cached_property
    def articulated(self) -> Pivots:
        """The pivots of the articulated-body algorithm."""
        return articulate(self.instant, self.scalars)

    def articulated_forward(self, tau: Sequence[Scalar] | None = None) -> list[Scalar]:
        """v̇ under the effects and forces `tau` beside them, by articulated bodies."""
        driven = self._driven(tau)
        found = respond(self.instant, self.articulated, self._at_rest, driven, self.scalars)
        return self._fallen(found)

    def factored_forward(self, tau: Sequence[Scalar] | None = None) -> list[Scalar]:
        """The same by LᵀDL factors of the mass matrix."""
        carried = fc.carried(self.instant, self._at_rest)
        bias = fc.generalised(self.instant, carried, self.nv)
        right = [a - b for a, b in zip(self._driven(tau), bias, strict=True)]
        return self._fallen(solved(self.factors, right))

    @cached_property
    def _free_roots(self) -> list[int]:
        """Of each body that nothing holds the index of its first velocity."""
        starts = zip(self.model.bodies, self.model.first_velocity, strict=True)
        return [i for body, i in starts if isinstance(body.joint, Free)]

    @cached_property
    def _at_rest(self) -> list[fc.Force]:
        """The wrenches that would keep the velocities as they are, but for the fall of trees that
        nothing holds: their weight changes nothing else, and is put in at the end.
        """
        falling = [k for k, link in enumerate(self.instant.links) if link.v[0] in self._free_roots]
        base = sub(zeros(self.scalars), self.down)
        moving = accelerations(
            self.instant, self.moving, self.values.v, None, base, self.scalars, falling
        )
        inertial = fc.inertial(self.instant, moving, self.scalars)
        return [fc.less(a, b) for a, b in zip(inertial, self.wrenches, strict=True)]

    def _fallen(self, vd: Sequence[Scalar]) -> list[Scalar]:
        """v̇ with the fall of free trees, and with its names."""
        found = list(vd)
        for i in self._free_roots:
            for axis in range(self.dimensions):
                found[i + axis] = found[i + axis] + self.down[axis]
        rates = zip(found, self.model.velocities, strict=True)
        return [self.scalars.named(x, c.acceleration) for x, c in rates]

    def _driven(self, tau: Sequence[Scalar] | None) -> list[Scalar]:
        if tau is None:
            return self.motors
        return [a + b for a, b in zip(self.motors, tau, strict=True)]

    @cached_property
    def mass_entries(self) -> Entries:
        """The entries of M that are not zero by the tree's shape."""
        return mass_entries(self.in_world, self.scalars)

    @cached_property
    def factors(self) -> Factors:
        """M = Lᵀ D L."""
        names = [c.name for c in self.model.velocities]
        return factorised(self.mass_entries, ancestors(self.instant), names, self.scalars)

    # Energy.

    @cached_property
    def kinetic_energy(self) -> Scalar:
        """Of all bodies and rotors, J."""
        return kinetic_energy(self.instant, self.moving, self.values.v, self.scalars)

    @cached_property
    def potential_energy(self) -> Scalar:
        """Of all effects, J."""
        energy = self.scalars.number(0.0)
        for effect in self.model.effects:
            energy = energy + effect.potential_energy(self)
        return energy

    def power(self, effect: Effect) -> Scalar:
        """What an effect's loads do to the motion, W; of gravity and springs, too."""
        return self.power_of(effect.loads(self))

    def power_of(self, loads: Iterable[Load | JointLoad]) -> Scalar:
        """The power of loads, W; of unit loads their speed, m/s or rad/s."""
        power = self.scalars.number(0.0)
        for load in loads:
            if isinstance(load, JointLoad):
                power = power + load.force * self.rate(load.joint, load.coordinate)
                continue
            for force, speed in zip(load.force, self.velocity(load.body, load.at), strict=True):
                power = power + force * speed
            for torque, rate in zip(load.torque, self.turning(load.body), strict=False):
                power = power + torque * rate
        return power

    @cached_property
    def contacts(self) -> tuple[Contact, ...]:
        """The rigid contacts of all effects, in order."""
        return tuple(contact for effect in self.model.effects for contact in effect.contacts(self))

    @cached_property
    def state_rates(self) -> list[Scalar]:
        """Time derivatives of the extra states, in order."""
        return [rate for effect in self.model.effects for rate in effect.rates(self)]
