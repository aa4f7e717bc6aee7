"""Forward and inverse dynamics of a mechanism at a state, over any scalars.

Each algorithm works in the axes in which it is cheapest. Forces and the articulated-body recursion
use the frames' own axes in space, and the world's in the plane, where angles add. So do composite
bodies, since about a coordinate axis most entries are 0. Derivatives of inverse dynamics use the
world's axes, where nothing is rotated repeatedly.
"""

import math
from collections.abc import Sequence
from functools import cached_property

from eomgen.dynamics.inverse import InverseDynamics
from eomgen.dynamics.loops import constraints
from eomgen.dynamics.loops.embedding import Embedded
from eomgen.dynamics.loops.freedoms import Formulation, Forward, Response
from eomgen.dynamics.loops.least_constraint import LeastConstraint
from eomgen.dynamics.loops.null_space import NullSpace
from eomgen.dynamics.loops.range_space import RangeSpace
from eomgen.dynamics.orthogonal.elimination import Elimination
from eomgen.dynamics.orthogonal.mixed import well_conditioned
from eomgen.dynamics.tree import forces as fc
from eomgen.dynamics.tree.articulated import Pivots, articulate, respond
from eomgen.dynamics.tree.composite import (
    Entries,
    Factors,
    ancestors,
    factorised,
    mass_entries,
    solved,
)
from eomgen.dynamics.tree.frames import Linkage
from eomgen.dynamics.tree.kinematics import TreeKinematics
from eomgen.dynamics.tree.linkage import make_linkage
from eomgen.dynamics.tree.motion import (
    Acceleration,
    accelerations,
    kinetic_energy,
)
from eomgen.dynamics.tree.solids import Solid, centres, ranked, solids
from eomgen.dynamics.tree.vectors import no_matrix, sub, zeros
from eomgen.model.named import Values
from eomgen.scalars.floats import FloatScalars
from eomgen.scalars.protocol import Scalar
from eomgen.scene.effects import Effect
from eomgen.tables.routes import ROUTES

__all__ = ["Dynamics", "Forward", "Values"]


class Dynamics(InverseDynamics):
    """A model at given values. Each property is computed once, when it is first used."""

    @cached_property
    def vd(self) -> list[Scalar]:
        """v̇ (nv,) under the effects."""
        return self.forward("aba")(None)

    @cached_property
    def driving_forces(self) -> list[Scalar]:
        """The driving force of each driven coordinate, N m or N: inverse dynamics minus loads."""
        return self._driving(self.vd)

    def _driving(self, vd: Sequence[Scalar]) -> list[Scalar]:
        """`driving_forces` at other v̇."""
        pairs = zip(self._needed(vd)[self.nv :], self._applied[self.nv :], strict=True)
        found = [needed - applied for needed, applied in pairs]
        if not (found and self.model.constraints):
            return found
        held = constraints.held(self, self.constrained("aba").multipliers())
        return [force - by for force, by in zip(found, held[self.nv :], strict=True)]

    def driving_powers(self, vd: Sequence[Scalar], beside: Sequence[Scalar]) -> list[Scalar]:
        """The power of each driven effect at v̇, W, in the order of the effects. `beside` are
        generalised forces besides the effects, with the rows of driven velocities.
        """
        taken = zip(self._driving(vd), beside[self.nv :], self.v[self.nv : self.moved], strict=True)
        powers = {
            c.by: (force - other) * rate
            for c, (force, other, rate) in zip(self.model.driven, taken, strict=True)
        }
        return [powers[e.name] for e in self.model.effects if e.name in powers]

    # Forward dynamics.

    @cached_property
    def articulated(self) -> Pivots:
        """The pivots of the articulated-body algorithm."""
        return articulate(self.kinematics, self.scalars)

    def forward(self, route: str) -> Forward:
        """Forward dynamics by the recursion of a route."""
        if self.model.constraints:
            return self.constrained(route).forward
        found: Forward = getattr(self, f"{ROUTES[route].recursion}_forward")
        return found

    def constrained(self, route: str) -> Formulation:
        """The constraints, solved with the recursion of a route."""
        if route not in self._constrained:
            self._constrained[route] = self._solver(ROUTES[route].recursion)
        return self._constrained[route]

    def _solver(self, recursion: str) -> Formulation:
        if recursion == "independent":
            return self.by_independent_velocities
        if recursion == "embedded":
            return Embedded(
                self,
                self._generalised_forces,
                lambda: self._bias_wrenches(self.kinematics),
                self._beyond_effects,
                self._fall,
            )
        if recursion == "orthogonal":
            return LeastConstraint(
                self,
                self._solids,
                solids(self._in_numbers, FloatScalars()),
                self._applied_about_centres,
                self._beyond_effects,
                self._fall,
                self._scales,
            )
        forward, response = (
            getattr(self, f"{recursion}_{name}") for name in ("forward", "response")
        )
        return RangeSpace(self, forward, response)

    @cached_property
    def by_independent_velocities(self) -> NullSpace:
        """The constraints, solved for dependent velocities."""
        return NullSpace(self, self.mass_entries, self._right, self._fall)

    @cached_property
    def _scales(self) -> list[float]:
        """Powers of two near the root of each diagonal entry of M⁻¹, of the scene's own numbers."""
        model = self.model
        values = Values(model.defaults, self.values.inputs, model.initial_q, model.initial_v)
        entries = Dynamics(model, values, FloatScalars()).mass_entries
        return [2.0 ** round(-math.log2(entries[i, i]) / 2) for i in range(self.nv)]

    def _beyond_effects(self, vd: Sequence[Scalar]) -> list[Scalar]:
        """The generalised forces besides the effects that v̇ takes: M v̇ + V + G - F."""
        pairs = zip(self.inverse(vd), self.applied_force, strict=True)
        return [needed - applied for needed, applied in pairs]

    @cached_property
    def _constrained(self) -> dict[str, Formulation]:
        return {}

    def response(self, route: str) -> Response:
        """A function that computes M⁻¹ f of generalised impulses or forces f by the recursion of a
        route; under constraints the change of the velocities, which keep these.
        """
        if self.model.constraints:
            return self.constrained(route).response
        found: Response
        found = getattr(self, f"{ROUTES[route].recursion}_response")
        return found

    def articulated_forward(self, tau: Sequence[Scalar] | None = None) -> list[Scalar]:
        """v̇ (nv,) under the effects and generalised forces `tau`, by articulated bodies."""
        forces = self._generalised_forces(tau)
        wrenches = self._bias_wrenches(self.kinematics)
        found = respond(self.kinematics, self.articulated, wrenches, forces, self.scalars)
        return self._with_gravity(found)

    def factored_forward(self, tau: Sequence[Scalar] | None = None) -> list[Scalar]:
        """The same by the LᵀDL factors of the mass matrix."""
        right = self._right(tau)
        return self._with_gravity(solved(self.factors, right))

    def _right(self, tau: Sequence[Scalar] | None) -> list[Scalar]:
        """F - h with generalised forces `tau`, without the weight of trees on a free joint."""
        carried = fc.carried(self.kinematics, self._bias_wrenches(self.inertias))
        bias = fc.generalised(self.kinematics, carried, self.moved)[: self.nv]
        return [a - b for a, b in zip(self._generalised_forces(tau), bias, strict=True)]

    def orthogonal_forward(self, tau: Sequence[Scalar] | None = None) -> list[Scalar]:
        """The same by orthogonal elimination, in the frames' own axes."""
        return self._with_gravity(self._elimination.respond(*self._applied_about_centres(tau)))

    def mixed_forward(self, tau: Sequence[Scalar] | None = None) -> list[Scalar]:
        """The same by orthogonal elimination along the joints that lose digits only."""
        return self._with_gravity(self._mixed.respond(*self._applied_about_centres(tau)))

    def _applied_about_centres(
        self, tau: Sequence[Scalar] | None
    ) -> tuple[tuple[Acceleration, ...], tuple[fc.Wrench, ...], list[Scalar]]:
        """The frames' accelerations at v̇ = 0 without gravity of trees on a free joint, the wrenches
        about their centres of mass, and the generalised forces with `tau`.
        """
        about = centres(self._solids, self.scalars)
        wrenches = fc.wrenches(self.linkage, self.kinematics, self.loads[0], self.scalars, about)
        return self._reference_accelerations, wrenches, self._generalised_forces(tau)

    def articulated_response(self, impulse: Sequence[Scalar]) -> list[Scalar]:
        """M⁻¹ times generalised impulses, by articulated bodies."""
        still = [fc.no_wrench(self.scalars)] * len(self.kinematics.links)
        return respond(self.kinematics, self.articulated, still, impulse, self.scalars)

    def factored_response(self, impulse: Sequence[Scalar]) -> list[Scalar]:
        """The same by LᵀDL factors of the mass matrix."""
        return solved(self.factors, impulse)

    def orthogonal_response(self, impulse: Sequence[Scalar]) -> list[Scalar]:
        """M⁻¹ times generalised impulses, by orthogonal elimination."""
        return self._struck(self._elimination, impulse)

    def mixed_response(self, impulse: Sequence[Scalar]) -> list[Scalar]:
        """The same along the joints that lose digits only."""
        return self._struck(self._mixed, impulse)

    def _struck(self, elimination: Elimination, impulse: Sequence[Scalar]) -> list[Scalar]:
        nothing, matrix = zeros(self.scalars), no_matrix(self.scalars)
        frame = Acceleration(nothing, nothing, matrix, nothing, nothing)
        still = [frame] * len(self.kinematics.links)
        wrenches = [fc.no_wrench(self.scalars)] * len(still)
        return elimination.respond(still, wrenches, impulse)

    @cached_property
    def _solids(self) -> tuple[Solid | None, ...]:
        return solids(self.linkage, self.scalars)

    @cached_property
    def _elimination(self) -> Elimination:
        return Elimination(self.kinematics, self._solids, ranked(self._in_numbers), self.scalars)

    @cached_property
    def _mixed(self) -> Elimination:
        plain, ranks = well_conditioned(self._in_numbers), ranked(self._in_numbers)
        return Elimination(self.kinematics, self._solids, ranks, self.scalars, plain)

    @cached_property
    def _in_numbers(self) -> Linkage:
        """The linkage at the scene's parameters."""
        return make_linkage(self.model, self.model.defaults, FloatScalars())

    @cached_property
    def _free_roots(self) -> list[int]:
        """The index of the first velocity of each body on a free joint."""
        return [
            index.v[0]
            for index in self.model.joint_indices
            if not index.body.joint.holds and max(index.v[: self.dimensions]) < self.nv
        ]

    @cached_property
    def _reference_accelerations(self) -> tuple[Acceleration, ...]:
        """Accelerations of the frames at v̇ = 0, without gravity in trees on a free joint. Gravity
        accelerates such a tree as a whole; `_with_gravity` adds that.
        """
        falling = [
            k
            for k, link in enumerate(self.kinematics.links)
            if link.v and link.v[0] in self._free_roots
        ]
        base = sub(zeros(self.scalars), self.down)
        v, twists = self.felt
        vd = self.with_driven(None)
        return accelerations(self.kinematics, twists, v, vd, base, self.scalars, falling)

    def _bias_wrenches(self, links: TreeKinematics) -> list[fc.Wrench]:
        """The wrenches that would make v̇ = 0, for the inertias of the given links."""
        inertial = fc.inertial(links, self._reference_accelerations, self.scalars)
        return [fc.less(a, b) for a, b in zip(inertial, self.wrenches, strict=True)]

    @cached_property
    def _fall(self) -> list[Scalar]:
        """The accelerations (nv,) of trees on a free joint by uniform gravity."""
        found = [self.scalars.number(0.0)] * self.nv
        for i in self._free_roots:
            found[i : i + self.dimensions] = self.down[: self.dimensions]
        return found

    def _with_gravity(self, vd: Sequence[Scalar]) -> list[Scalar]:
        """v̇ plus the gravity of trees on a free joint, with the names of its components."""
        found = list(vd)
        for i in self._free_roots:
            for axis in range(self.dimensions):
                found[i + axis] = found[i + axis] + self.down[axis]
        rates = zip(found, self.model.velocities, strict=True)
        return [self.scalars.named(x, c.acceleration) for x, c in rates]

    def _generalised_forces(self, tau: Sequence[Scalar] | None) -> list[Scalar]:
        """The joint loads of the effects plus `tau`."""
        motors = self.motors[: self.nv]
        return motors if tau is None else [a + b for a, b in zip(motors, tau, strict=True)]

    @cached_property
    def mass_entries(self) -> Entries:
        """The entries of M that the tree's shape allows not to be 0."""
        return mass_entries(self.inertias, self.scalars)

    @cached_property
    def factors(self) -> Factors:
        """The factors of M = Lᵀ D L."""
        names = [c.name for c in self.model.velocities]
        return factorised(self.mass_entries, ancestors(self.kinematics), names, self.scalars)

    # Energy.

    @cached_property
    def kinetic_energy(self) -> Scalar:
        """Kinetic energy of all bodies and rotors, J."""
        return kinetic_energy(self.kinematics, self._solids, self.twists, self.v, self.scalars)

    def power(self, effect: Effect) -> Scalar:
        """The power of an effect's loads, W, of gravity and springs too."""
        if drive := effect.prescribes():
            i = [c.by for c in self.model.driven].index(effect.name)
            return self.driving_forces[i] * self.rate(drive[0])
        return self.power_of(effect.loads(self))
