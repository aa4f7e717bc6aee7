"""The model: a mechanism with all names resolved and its bodies in a tree, parents first."""

import hashlib
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import accumulate

from eomgen.base.displays import Displayed
from eomgen.base.frozen import FrozenDict
from eomgen.language.base import Table
from eomgen.language.conditions import Condition, require
from eomgen.language.formula import Formula, evaluate
from eomgen.language.quantity import Parameter
from eomgen.model.bodies import (
    Body,
    JointIndex,
    Point,
    Prescribed,
    positions_of,
    prescribed_of,
    velocities_of,
)
from eomgen.model.groups import Group
from eomgen.scalars.exact import Real, radians
from eomgen.scalars.floats import FloatScalars
from eomgen.scene.constraints import Constraint, ConstraintTable, LoopJoint
from eomgen.scene.effects import Effect
from eomgen.scene.effects.base import ExtraState, Input
from eomgen.scene.joints.base import Coordinate
from eomgen.scene.schema import Form, LeftOut, LoopsKept, Route


@dataclass(frozen=True, repr=False)
class Model(Displayed):
    """A mechanism and the effects that act on it, without drawing and integration settings.

    conditions  conditions on the values of parameters
    extra       extra states of effects, which follow coordinates and velocities
    locked      locked coordinates by name, with their values
    locked_deg  locked angles by name, as the scene gives them in degrees: 90 is exact, π/2 is not
    notices     what elaboration corrected, one line each
    constraints what closes loops or restricts motions besides the joints of the tree
    held        names of coordinates and velocities whose initial values the scene gives
    dropped     names of rows of constraints that follow from the others
    pivots      for each row of the constraints, in the order of elimination, its index and that of
                the velocity that is solved for by it
    blocks      of these, the indices of those that are eliminated together with the next
    loops_kept  how loops are kept: "closed", solved in closed form; "projected"; or "auto"
    groups      what determines the coordinates that follow from the others in closed form, in the
                order in which they are solved; () if they are states too
    """

    shown = (
        "title",
        "dimensions",
        "freedom",
        "bodies",
        "states",
        "inputs",
        "parameters",
        "effects",
        "constraints",
        "notices",
    )

    name: str
    title: str
    dimensions: int
    parameters: tuple[Parameter, ...]
    conditions: tuple[Condition, ...]
    inputs: tuple[Input, ...]
    bodies: tuple[Body, ...]
    points: tuple[Point, ...]
    effects: tuple[Effect, ...]
    extra: tuple[ExtraState, ...]
    initial_q: tuple[float, ...]
    initial_v: tuple[float, ...]
    outputs: tuple[str, ...]
    form: Form
    route: Route
    locked: tuple[tuple[str, float], ...] = ()
    locked_deg: tuple[tuple[str, float], ...] = ()
    leave_out: tuple[LeftOut, ...] = ()
    notices: tuple[str, ...] = ()
    constraints: tuple[Constraint, ...] = ()
    held: tuple[str, ...] = ()
    dropped: tuple[str, ...] = ()
    pivots: tuple[tuple[int, int], ...] = ()
    blocks: tuple[int, ...] = ()
    loops_kept: LoopsKept = "auto"
    groups: tuple[Group, ...] = ()

    @cached_property
    def digest(self) -> bytes:
        """A digest of all but the notices: of a large model it takes longer than a short run."""
        parts = [getattr(self, each.name) for each in fields(self) if each.name != "notices"]
        return hashlib.sha256(repr(parts).encode()).digest()

    @cached_property
    def every_row(self) -> tuple[tuple[str, str], ...]:
        """The name of each row of the constraints, dropped ones too, and its multiplier's unit."""
        return tuple(
            row for constraint in self.constraints for row in constraint.row_names(self.dimensions)
        )

    @cached_property
    def rows(self) -> tuple[tuple[str, str], ...]:
        """The same without the dropped ones."""
        return tuple(row for row in self.every_row if row[0] not in self.dropped)

    @cached_property
    def velocity_rows(self) -> tuple[str, ...]:
        """The names of those of them that restrict velocities alone."""
        found = [x for c in self.constraints for x in c.velocity_rows(self.dimensions)]
        return tuple(name for name in found if name not in self.dropped)

    @cached_property
    def loops(self) -> tuple[LoopJoint, ...]:
        """The joints that close loops."""
        return tuple(c for c in self.constraints if isinstance(c, LoopJoint))

    @property
    def sampled(self) -> tuple[str, ...]:
        """The names of the effects that sample."""
        return tuple(effect.name for effect in self.effects if effect.sampling())

    @property
    def force_joints(self) -> tuple[str, ...]:
        """Names of the joints that transmit constraint forces: those of the tree, then loops."""
        return (*(b.joint.name for b in self.holding), *(loop.name for loop in self.loops))

    @cached_property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """The coordinates of the state, in the order of `q`."""
        return positions_of(self.bodies, self.prescribed)

    @cached_property
    def velocities(self) -> tuple[Coordinate, ...]:
        """The velocities of the state, in the order of `v`."""
        return velocities_of(self.bodies, self.prescribed)

    @cached_property
    def state_coordinates(self) -> tuple[int, ...]:
        """The indices in q of the coordinates that are states: those of no group."""
        following = {i for group in self.groups for i in group.coordinates}
        return tuple(i for i in range(len(self.coordinates)) if i not in following)

    @cached_property
    def ranged(self) -> tuple[str, ...]:
        """The names of angles that follow from others in closed form, each within one turn."""
        return tuple(
            self.coordinates[i].name
            for group in self.groups
            for i, cut in zip(group.coordinates, group.cuts, strict=True)
            if cut is not None
        )

    @cached_property
    def state_velocities(self) -> tuple[int, ...]:
        """The indices in v of the velocities that are states."""
        following = {column for _, column in self.pivots} if self.groups else set()
        return tuple(j for j in range(len(self.velocities)) if j not in following)

    @property
    def states(self) -> tuple[str, ...]:
        """The names of the entries of the state [q, v, x] of form 'velocity'.

        Where loops are closed in closed form, which is decided when a module is generated, its
        `STATES` are some of these, and its `FOLLOWING` the others.
        """
        positions = (self.coordinates[i].name for i in self.state_coordinates)
        velocities = (self.velocities[j].name for j in self.state_velocities)
        return (*positions, *velocities, *(x.name for x in self.extra))

    @property
    def freedom(self) -> str:
        """The number of degrees of freedom, and what they are counted from, in words."""
        nq, free = len(self.coordinates), len(self.velocities) - len(self.rows)
        text = f"{free} degree{'s' if free != 1 else ''} of freedom"
        if self.rows:
            return f"{text}, {nq} coordinates with {len(self.rows)} constraints"
        if nq != free:
            balls = len(self.quaternions)
            text += f", {nq} coordinates with {balls} unit quaternion{'s' if balls > 1 else ''}"
        return text

    @cached_property
    def prescribed(self) -> tuple[Prescribed, ...]:
        """The coordinates that are not states: driven ones in the order of the bodies, then locked
        ones.
        """
        return prescribed_of(self.bodies, self.effects, dict(self.locked))

    @property
    def driven(self) -> tuple[Prescribed, ...]:
        """The driven coordinates."""
        return tuple(c for c in self.prescribed if not c.locked)

    @cached_property
    def joint_indices(self) -> tuple[JointIndex, ...]:
        """The indices of each body's joint coordinates and velocities."""
        given = self.prescribed
        positions = (*self.coordinates, *(c.position for c in given))
        velocities = (*self.velocities, *(c.velocity for c in given))
        q = {c.name: i for i, c in enumerate(positions)}
        v = {c.name: i for i, c in enumerate(velocities)}
        return tuple(
            JointIndex(
                b, tuple(q[c.name] for c in b.positions), tuple(v[c.name] for c in b.velocities)
            )
            for b in self.bodies
        )

    @property
    def roots(self) -> tuple[int, ...]:
        """For each body the index of the root of its tree: a body whose parent is the world."""
        roots: list[int] = []
        for k, body in enumerate(self.bodies):
            roots.append(k if body.parent < 0 else roots[body.parent])
        return tuple(roots)

    @property
    def first_position(self) -> tuple[int, ...]:
        """The index of each joint's first coordinate; valid if no coordinate is prescribed."""
        return tuple(accumulate((len(b.positions) for b in self.bodies), initial=0))[:-1]

    @property
    def first_velocity(self) -> tuple[int, ...]:
        """The index of each joint's first velocity; valid if no coordinate is prescribed."""
        return tuple(accumulate((len(b.velocities) for b in self.bodies), initial=0))[:-1]

    @property
    def angle_index(self) -> tuple[int, ...]:
        """For each planar body the index of its joint's angle, which is the joint's last
        coordinate; valid if no coordinate is prescribed.
        """
        return tuple(accumulate((len(b.positions) for b in self.bodies), initial=-1))[1:]

    @property
    def quaternions(self) -> tuple[tuple[int, int, int, int], ...]:
        """Indices in `q` of each unit quaternion."""
        found = []
        for index in self.joint_indices:
            if index.quaternion:
                w, x, y, z = index.quaternion
                found.append((w, x, y, z))
        return tuple(found)

    @property
    def carriers(self) -> tuple[int, ...]:
        """For each velocity of the state the number of velocities between its body and the world
        that come before it: the off-diagonal entries of its row in a triangle of M.
        """
        nv, depth = len(self.velocities), list[int]()
        carriers = [0] * nv
        for index in self.joint_indices:
            above = depth[index.body.parent] if index.body.parent >= 0 else 0
            for i in index.v:
                if i < nv:
                    carriers[i] = above
                    above += 1
            depth.append(above)
        return tuple(carriers)

    @property
    def holding(self) -> tuple[Body, ...]:
        """The bodies whose joint transmits constraint forces: all except undriven, unlocked free
        bodies.
        """
        given = {c.position.name for c in self.prescribed}
        return tuple(
            body
            for body in self.bodies
            if body.joint.holds or any(c.name in given for c in body.positions)
        )

    @cached_property
    def defaults(self) -> Mapping[str, float]:
        """The scene's parameter values, by name."""
        return FrozenDict({p.name: p.default for p in self.parameters})

    def quantities(self) -> Iterator[Formula]:
        """Every quantity of bodies, joints, points and effects, in order."""
        for body in self.bodies:
            yield from (body.mass, *body.inertia_com)
        joints = (*(body.joint for body in self.bodies), *(loop.joint for loop in self.loops))
        listed = (c for c in self.constraints if isinstance(c, ConstraintTable))
        for table in (*joints, *self.effects, *listed):
            for field in type(table).model_fields:
                yield from _formulas(getattr(table, field))
        for point in self.points:
            yield from point.at

    def locked_angle(self, name: str) -> Real:
        """The value of a locked angle, rad, to more digits than a double has."""
        degrees = dict(self.locked_deg)
        return radians(degrees[name]) if name in degrees else dict(self.locked)[name]

    @cached_property
    def magnitude(self) -> float:
        """The magnitude of the mechanism's lengths, m, as a power of 2^40.

        Tolerances that must be negligible beside any length are multiples of it. It is 1 for
        lengths from a micrometre to a megametre.
        """
        lengths = [p.default for p in self.parameters if p.unit == "m"]
        pairs = zip(self.coordinates, self.initial_q, strict=False)
        lengths += [value for coordinate, value in pairs if coordinate.unit == "m"]
        largest = max(map(abs, lengths), default=0.0)
        if not (largest > 0 and math.isfinite(largest)):
            return 1.0
        return float(2.0 ** (40 * round(math.log2(largest) / 40)))

    def with_parameters(self, values: Mapping[str, float]) -> "Model":
        """The same model with other default values for some parameters.

        Raises `SceneError` for values that do not meet the model's conditions.
        """
        parameters = (replace(p, default=values.get(p.name, p.default)) for p in self.parameters)
        model = replace(self, parameters=tuple(parameters))
        require(self.conditions, model.defaults)
        return model

    def value(self, formula: Formula) -> float:
        """A quantity's value at the scene's parameter values."""
        return float(evaluate(formula, self.defaults, FloatScalars()))


def _formulas(value: object) -> Iterator[Formula]:
    """The formulas in a value and in its rows."""
    if isinstance(value, tuple):
        for part in value:
            yield from _formulas(part)
    elif isinstance(value, Table):
        yield from _formulas(tuple(getattr(value, field) for field in type(value).model_fields))
    elif isinstance(value, Formula):
        yield value
