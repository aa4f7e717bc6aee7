"""The model: a scene whose every name is resolved; bodies in a tree, parents before children."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate
from typing import TypeGuard

from eomgen.effects import Effect
from eomgen.effects.base import ExtraState, Input
from eomgen.joints import Joint, Revolute
from eomgen.joints.base import Coordinate
from eomgen.language.formula import Constant, Floats, Formula, evaluate
from eomgen.language.quantity import Parameter
from eomgen.scene.look import Camera, Shape
from eomgen.scene.schema import Form, Route, Simulation


@dataclass(frozen=True)
class Body:
    """A body and the joint that holds it. `parent` is an index into the bodies, -1 the world.

    `inertia_com` about the centre of mass in body axes: one moment in the plane; in space xx, yy,
    zz, xy, xz, yz. `positions` and `velocities` are the joint's, in the order of `q` and `v`.
    """

    name: str
    mass: Formula
    inertia_com: tuple[Formula, ...]
    joint: Joint
    parent: int
    positions: tuple[Coordinate, ...]
    velocities: tuple[Coordinate, ...]
    shapes: tuple[Shape, ...]

    @property
    def moment(self) -> Formula:
        """The moment of inertia of a planar body."""
        assert len(self.inertia_com) == 1, "in the plane only"
        return self.inertia_com[0]


@dataclass(frozen=True)
class Point:
    """A named point: `body` is an index, `at` runs from its centre of mass in body axes."""

    name: str
    body: int
    at: tuple[Formula, ...]


@dataclass(frozen=True)
class Model:
    """A mechanism with everything that acts on it; see `build_model`.

    `states` are those that effects bring along, after coordinates and velocities.
    `notices` say what was put right on the way, a line each.
    """

    name: str
    title: str
    dimensions: int
    parameters: tuple[Parameter, ...]
    inputs: tuple[Input, ...]
    bodies: tuple[Body, ...]
    points: tuple[Point, ...]
    effects: tuple[Effect, ...]
    states: tuple[ExtraState, ...]
    initial_q: tuple[float, ...]
    initial_v: tuple[float, ...]
    outputs: tuple[str, ...]
    form: Form
    route: Route
    simulation: Simulation
    camera: Camera
    notices: tuple[str, ...] = ()

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """All coordinates, in the order of `q`."""
        return tuple(c for body in self.bodies for c in body.positions)

    @property
    def velocities(self) -> tuple[Coordinate, ...]:
        """All velocities, in the order of `v`."""
        return tuple(c for body in self.bodies for c in body.velocities)

    @property
    def first_position(self) -> tuple[int, ...]:
        """For each body the index in `q` of its joint's first coordinate."""
        return tuple(accumulate((len(b.positions) for b in self.bodies), initial=0))[:-1]

    @property
    def first_velocity(self) -> tuple[int, ...]:
        """For each body the index in `v` of its joint's first velocity."""
        return tuple(accumulate((len(b.velocities) for b in self.bodies), initial=0))[:-1]

    @property
    def turning(self) -> tuple[int, ...]:
        """For each planar body the index of the coordinate that turns it: its joint's last."""
        return tuple(accumulate((len(b.positions) for b in self.bodies), initial=-1))[1:]

    @property
    def quaternions(self) -> tuple[tuple[int, int, int, int], ...]:
        """Indices in `q` of each unit quaternion."""
        found = []
        for body, first in zip(self.bodies, self.first_position, strict=True):
            moves = body.joint.moves(self.dimensions)
            if moves and moves[-1].kind == "spin":
                w = first + len(body.positions) - 4
                found.append((w, w + 1, w + 2, w + 3))
        return tuple(found)

    @cached_property
    def defaults(self) -> Mapping[str, float]:
        """Parameter values of the scene, by name."""
        return {p.name: p.default for p in self.parameters}

    def quantities(self) -> Iterator[Formula]:
        """Every quantity of bodies, joints, points and effects, in order."""
        for body in self.bodies:
            yield from (body.mass, *body.inertia_com)
        for table in (*(body.joint for body in self.bodies), *self.effects):
            for field in type(table).model_fields:
                value = getattr(table, field)
                for part in value if isinstance(value, tuple) else (value,):
                    if isinstance(part, Formula):
                        yield part
        for point in self.points:
            yield from point.at

    def with_parameters(self, values: Mapping[str, float]) -> "Model":
        """The same model with other values for some parameters."""
        parameters = (replace(p, default=values.get(p.name, p.default)) for p in self.parameters)
        return replace(self, parameters=tuple(parameters))

    def value(self, formula: Formula) -> float:
        """A quantity's value at the scene's parameters."""
        return float(evaluate(formula, self.defaults, Floats()))


def off_centre(joint: Joint) -> TypeGuard[Revolute]:
    """Whether a pin holds its child away from the centre of mass, as its structure says."""
    return isinstance(joint, Revolute) and not all(is_zero(r) for r in joint.r_child)


def is_zero(formula: Formula) -> bool:
    """Whether a quantity is a bare 0: structure, no parameter."""
    return isinstance(formula, Constant) and formula.value == 0.0
