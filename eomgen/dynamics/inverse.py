"""Inverse dynamics of a mechanism at a state, over any scalars.

Driven frames move as prescribed. M v̇ + V + G = F has the rows of the free velocities only; V
includes the inertial forces of driven accelerations. If a scene leaves the velocity forces out, all
velocities are 0 in the inertial forces (`felt`). V then consists of the forces of driven
accelerations, without gyroscopic torques, and joint forces follow from the same equations. Effects,
energies and poses still use the velocities. Energy is not conserved then.
"""

from collections.abc import Sequence
from functools import cached_property

from eomgen.dynamics.tree import forces as fc
from eomgen.dynamics.tree.applied import AppliedLoads
from eomgen.dynamics.tree.kinematics import TreeKinematics
from eomgen.dynamics.tree.motion import Acceleration, Twist, accelerations, velocities
from eomgen.dynamics.tree.vectors import sub, zeros
from eomgen.scalars.protocol import Scalar


class InverseDynamics(AppliedLoads):
    """A model at given values, with the generalised forces that its motion takes."""

    def accelerating(
        self, vd: Sequence[Scalar] | None, *, still: bool = False, weightless: bool = False
    ) -> tuple[Acceleration, ...]:
        """Accelerations of the frames at v̇ minus gravity's; `still` sets v to 0, `weightless`
        gravity.
        """
        v, twists = self._stopped if still else self.felt
        nothing = zeros(self.scalars)
        base = nothing if weightless else sub(nothing, self.down)
        vd = vd if still else self.with_driven(vd)
        return accelerations(self.kinematics, twists, v, vd, base, self.scalars)

    @property
    def inertias(self) -> TreeKinematics:
        """The links with the inertias that inverse dynamics and M take. A subclass may have others
        that give the same generalised forces; likewise the next two.
        """
        return self.kinematics

    @property
    def weights(self) -> TreeKinematics:
        """The links with the inertias that gravity forces take."""
        return self.kinematics

    @property
    def inertias_in_world(self) -> TreeKinematics:
        """The links with the inertias that derivatives of inverse dynamics take, in world axes."""
        return self.in_world

    @cached_property
    def felt(self) -> tuple[Sequence[Scalar], tuple[Twist, ...]]:
        """The velocities v and the frames' twists that inertial forces are computed from."""
        if "velocity_forces" in self.model.leave_out:
            return self._stopped
        return self.v, self.twists

    @cached_property
    def _stopped(self) -> tuple[Sequence[Scalar], tuple[Twist, ...]]:
        v = [self.scalars.number(0.0)] * self.moved
        return v, velocities(self.kinematics, v, self.scalars)

    def with_driven(self, vd: Sequence[Scalar] | None) -> Sequence[Scalar] | None:
        """v̇ (None is 0) followed by the accelerations of driven velocities."""
        if self.moved == self.nv:
            return vd
        driven = [a for _, _, a in self.given[: self.moved - self.nv]]
        return [*([self.scalars.number(0.0)] * self.nv if vd is None else vd), *driven]

    def motion_in_world(
        self, vd: Sequence[Scalar]
    ) -> tuple[tuple[Twist, ...], tuple[Acceleration, ...]]:
        """Velocities and accelerations of the frames at v̇, in world axes."""
        v, base = self.felt[0], sub(zeros(self.scalars), self.down)
        twists = velocities(self.in_world, v, self.scalars)
        whole = self.with_driven(vd)
        return twists, accelerations(self.in_world, twists, v, whole, base, self.scalars)

    # Forces.

    @cached_property
    def _applied(self) -> list[Scalar]:
        carried = fc.carried(self.kinematics, self.wrenches)
        parts = fc.generalised(self.kinematics, carried, self.moved)
        return [a + b for a, b in zip(parts, self.motors, strict=True)]

    @cached_property
    def applied_force(self) -> list[Scalar]:
        """F of M v̇ + V + G = F."""
        return self._applied[: self.nv]

    def bias(self, *, still: bool = False, weightless: bool = False) -> list[Scalar]:
        """h = V + G, (nv,): G if `still`, V if `weightless`."""
        return self.inverse(None, still=still, weightless=weightless)

    def inverse(
        self, vd: Sequence[Scalar] | None, *, still: bool = False, weightless: bool = False
    ) -> list[Scalar]:
        """M v̇ + V + G by the recursive Newton-Euler algorithm (Featherstone 2008, 5.3)."""
        return self._needed(vd, still=still, weightless=weightless)[: self.nv]

    def _needed(
        self, vd: Sequence[Scalar] | None, *, still: bool = False, weightless: bool = False
    ) -> list[Scalar]:
        """`inverse` with the rows of driven velocities."""
        frame_accelerations = self.accelerating(vd, still=still, weightless=weightless)
        bodies = self.weights if still else self.inertias
        inertial = fc.inertial(bodies, frame_accelerations, self.scalars)
        parts = fc.generalised(self.kinematics, fc.carried(self.kinematics, inertial), self.moved)
        if vd is None:
            return parts
        whole = self.with_driven(vd)
        assert whole is not None
        rotors = fc.rotor_forces(self.kinematics, whole, self.moved, self.scalars)
        return [a + b for a, b in zip(parts, rotors, strict=True)]
