"""The loads of all effects on a mechanism at a state, and their potential energy."""

from collections.abc import Iterable
from functools import cached_property

from eomgen.dynamics.tree import forces as fc
from eomgen.dynamics.tree.loads import power_of
from eomgen.dynamics.tree.mechanism_state import MechanismState
from eomgen.dynamics.tree.vectors import Vec, torque_in_space
from eomgen.scalars.protocol import Scalar
from eomgen.scene.effects.base import Contact, JointLoad, Load, Vector
from eomgen.scene.joints.base import WORLD


class AppliedLoads(MechanismState):
    """A model at given values, with what its effects exert."""

    @cached_property
    def loads(self) -> tuple[tuple[fc.PointForce, ...], tuple[JointLoad, ...]]:
        """The loads of all effects on bodies and on joints. Uniform gravity is not among them: it
        is an acceleration of the world.
        """
        points, joints = [], []
        for effect in self.model.effects:
            if not effect.uniform:
                for load in effect.loads(self):
                    if isinstance(load, JointLoad):
                        joints.append(load)
                    elif load.body != WORLD:
                        points.append(self.point_force(load))
        return tuple(points), tuple(joints)

    def point_force(self, load: Load) -> fc.PointForce:
        """A load as a force on a body, in space."""

        def in_space(force: Vector, torque: Vector) -> tuple[Vec, Vec]:
            return self._in_space(force), torque_in_space(torque, self.scalars)

        at, own = self._in_space(load.at), load.in_body and in_space(*load.in_body)
        return fc.PointForce(self.index[load.body], at, *in_space(load.force, load.torque), own)

    @cached_property
    def wrenches(self) -> tuple[fc.Wrench, ...]:
        """The sum of the loads on each frame, about its origin."""
        return fc.wrenches(self.linkage, self.kinematics, self.loads[0], self.scalars)

    @cached_property
    def motors(self) -> list[Scalar]:
        """The sum of the joint loads on each velocity, driven ones too. Loads on a locked joint do
        no work.
        """
        forces = [self.scalars.number(0.0)] * self.moved
        for load in self.loads[1]:
            i = self.joint_indices[load.joint].v[load.coordinate]
            if i < self.moved:
                forces[i] = forces[i] + load.force
        return forces

    @cached_property
    def potential_energy(self) -> Scalar:
        """Potential energy of all effects, J."""
        energy = self.scalars.number(0.0)
        for effect in self.model.effects:
            energy = energy + effect.potential_energy(self)
        return energy

    def power_of(self, loads: Iterable[Load | JointLoad]) -> Scalar:
        """The power of loads, W; for unit loads it is their speed, m/s or rad/s."""
        return power_of(self, loads)

    @cached_property
    def contacts(self) -> tuple[Contact, ...]:
        """The rigid contacts of all effects, in order."""
        return tuple(contact for effect in self.model.effects for contact in effect.contacts(self))

    @cached_property
    def state_rates(self) -> list[Scalar]:
        """Time derivatives of the extra states, in order."""
        return [rate for effect in self.model.effects for rate in effect.rates(self)]
