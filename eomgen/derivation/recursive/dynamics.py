"""A mechanism at a state: everything the recursions find, over any scalars, each thing when asked.

This is the one place that knows in which axes each algorithm is cheapest: forces and the
articulated-body recursion in the frames' own axes in space, in the world's in the plane, where
angles add up; composite bodies in the world's, where nothing is turned again and again.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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
from eomgen.derivation.recursive.frames import Linkage
from eomgen.derivation.recursive.instant import Axes, Instant, at_instant
from eomgen.derivation.recursive.linkage import make_linkage
from eomgen.derivation.recursive.motion import (
    Acceleration,
    Twist,
    accelerations,
    kinetic_energy,
    velocities,
)
from eomgen.derivation.recursive.observe import Places, places, position
from eomgen.derivation.recursive.vectors import Scalar, Scalars, Vec, sub, zeros
from eomgen.effects import Gravity
from eomgen.effects.base import JointLoad
from eomgen.joints import Free
from eomgen.language.formula import Formula, evaluate
from eomgen.model import Model


@dataclass(frozen=True)
class Values:
    """Values of everything a model leaves open: parameters and inputs by name, q and v in order."""

    parameters: Mapping[str, Scalar]
    inputs: Mapping[str, Scalar]
    q: Sequence[Scalar]
    v: Sequence[Scalar]


class Dynamics:
    """A model at given values. What is asked for is computed once; nothing else is."""

    def __init__(
        self, model: Model, values: Values, scalars: Scalars, axes: Axes | None = None
    ) -> None:
        self.model = model
        self.values = values
        self.scalars = scalars
        self.axes: Axes = axes or ("world" if model.dimensions == 2 else "own")
        self.dimensions = model.dimensions
        self.bodies = tuple(body.name for body in model.bodies)
        self.nv = len(model.velocities)

    # What effects may ask (effects.base.Mechanism).

    def mass(self, body: str) -> Scalar:
        """Mass of a body, kg."""
        return self.linkage.mounts[self.bodies.index(body)].mass

    def height(self, body: str) -> Scalar:
        """World y of a centre of mass in the plane, z in space, m."""
        return self.centre(self.bodies.index(body))[self.dimensions - 1]

    def value(self, formula: Formula) -> Scalar:
        """A quantity."""
        return evaluate(formula, self.values.parameters, self.scalars)

    def input(self, name: str) -> Scalar:
        """An input."""
        return self.values.inputs[name]

    # Where everything is and how it moves.

    @cached_property
    def linkage(self) -> Linkage:
        """Frames and mounts."""
        return make_linkage(self.model, self.values.parameters, self.scalars)

    @cached_property
    def instant(self) -> Instant:
        """The frames at q, in the axes of the recursions."""
        return at_instant(self.linkage, self.values.q, self.axes, self.scalars)

    @cached_property
    def in_world(self) -> Instant:
        """The frames at q, in world axes."""
        if self.axes == "world":
            return self.instant
        return at_instant(self.linkage, self.values.q, "world", self.scalars)

    @cached_property
    def places(self) -> Places:
        """Origins of the frames, in the world."""
        return places(self.instant, self.scalars)

    def centre(self, body: int) -> Vec:
        """Centre of mass of a body, in the world."""
        return self.position(body, zeros(self.scalars))

    def position(self, body: int, at: Vec) -> Vec:
        """A point of a body, in the world."""
        return position(self.linkage, self.instant, self.places, body, at, self.scalars)

    def angle(self, body: int) -> Scalar:
        """The angle of a planar body from the world's x axis."""
        mount = self.linkage.mounts[body]
        angle = self.instant.angles[mount.frame] if mount.frame >= 0 else self.scalars.number(0.0)
        return angle + self.scalars.number(mount.angle)

    @cached_property
    def moving(self) -> tuple[Twist, ...]:
        """Velocities of the frames."""
        return velocities(self.instant, self.values.v, self.scalars)

    @cached_property
    def down(self) -> Vec:
        """The uniform gravity that acts, in world axes."""
        g = list(zeros(self.scalars))
        for effect in self.model.effects:
            if isinstance(effect, Gravity):
                g[self.dimensions - 1] = -self.value(effect.g)
        return (g[0], g[1], g[2])

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
        zero = self.scalars.number(0.0)
        for effect in self.model.effects:
            if isinstance(effect, Gravity):
                continue
            for load in effect.loads(self):
                if isinstance(load, JointLoad):
                    joints.append(load)
                else:
                    at, force = (
                        (part[0], part[1], part[2] if len(part) > 2 else zero)
                        for part in (load.at, load.force)
                    )
                    points.append(fc.PointForce(self.bodies.index(load.body), at, force))
        return tuple(points), tuple(joints)

    @cached_property
    def wrenches(self) -> tuple[fc.Force, ...]:
        """The loads on each frame."""
        return fc.wrenches(self.linkage, self.instant, self.loads[0], self.scalars)

    @cached_property
    def motors(self) -> list[Scalar]:
        """The loads on each velocity's own joint."""
        forces = [self.scalars.number(0.0)] * self.nv
        first = {
            body.joint.name: i
            for body, i in zip(self.model.bodies, self.model.first_velocity, strict=True)
        }
        for load in self.loads[1]:
            forces[first[load.joint]] = forces[first[load.joint]] + load.force
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
