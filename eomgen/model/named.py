"""A model over any scalars, of which every name has a value: what effects may ask of it without
kinematics (`scene.effects.base.Mechanism`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

from eomgen.language.formula import Formula, evaluate, names_in
from eomgen.model.bodies import JointIndex, dofs_of
from eomgen.model.model import Model
from eomgen.scalars.duals import Dual, Duals
from eomgen.scalars.exact import Real
from eomgen.scalars.protocol import Scalar, Scalars
from eomgen.scene.constraints.base import Partials
from eomgen.scene.effects.base import Vector

ROUNDING = 1.5 * 2.0**52
"""Added to a number and taken away again, it leaves the nearest whole number."""


@dataclass(frozen=True)
class Values:
    """Values of all that a model leaves open: parameters, inputs and extra states by name, q and v
    of the state in order, and the time, s.
    """

    parameters: Mapping[str, Scalar]
    inputs: Mapping[str, Scalar]
    q: Sequence[Scalar]
    v: Sequence[Scalar]
    states: Mapping[str, Scalar] = field(default_factory=dict)
    time: Scalar = 0.0

    def by_name(self, model: Model, q: Sequence[Any], v: Sequence[Any]) -> dict[str, Scalar]:
        """The values of all names that formulas may use, with all coordinates `q` and velocities
        `v`: those of the state, then the prescribed ones.
        """
        positions = (*model.coordinates, *(c.position for c in model.prescribed))
        velocities = (*model.velocities, *(c.velocity for c in model.prescribed))
        return {
            "t": self.time,
            **self.inputs,
            **self.states,
            **{c.name: x for c, x in zip(positions, q, strict=True)},
            **{c.name: x for c, x in zip(velocities, v, strict=True)},
            **self.parameters,
        }


class NamedModel:
    """A model and the values of its names. `nv` is the number of velocities of the state, `moved`
    the number of these and the driven ones.
    """

    def __init__(self, model: Model, scalars: Scalars) -> None:
        self.model = model
        self.scalars = scalars
        self.dimensions = model.dimensions
        self.bodies = tuple(body.name for body in model.bodies)
        self.masses = {body.name: body.mass for body in model.bodies}
        self.zero = scalars.number(0.0)
        self.nv = len(model.velocities)
        self.moved = self.nv + len(model.driven)

    @cached_property
    def names(self) -> dict[str, Scalar]:
        """The values of all names that formulas may use."""
        raise NotImplementedError

    @property
    def magnitude(self) -> float:
        """The order of magnitude of its lengths, m."""
        return self.model.magnitude

    @cached_property
    def joints(self) -> dict[str, tuple[str, ...]]:
        """The joints that move but the free ones, each with the kinds of its primitives."""
        return dofs_of(self.model.bodies, self.dimensions)

    @cached_property
    def index(self) -> dict[str, int]:
        """Index of each body by its name."""
        return {name: k for k, name in enumerate(self.bodies)}

    @cached_property
    def joint_indices(self) -> dict[str, JointIndex]:
        """Indices of each joint's coordinates and velocities, by its name."""
        return {index.body.joint.name: index for index in self.model.joint_indices}

    def point(self, name: str) -> tuple[str, Vector]:
        """A named point: its body, and where on it, m."""
        point = next(point for point in self.model.points if point.name == name)
        return self.bodies[point.body], tuple(self.value(part) for part in point.at)

    def coordinate(self, joint: str, index: int = 0) -> Scalar:
        """A coordinate of a joint."""
        return self.names[self.coordinate_name(joint, index)]

    def coordinate_name(self, joint: str, index: int = 0) -> str:
        """Its name."""
        return self.joint_indices[joint].body.positions[index].name

    def rate(self, joint: str, index: int = 0) -> Scalar:
        """A velocity of a joint."""
        return self.names[self.joint_indices[joint].body.velocities[index].name]

    def value(self, formula: Formula, **names: Scalar) -> Scalar:
        """A quantity."""
        return evaluate(formula, {**self.names, **names} if names else self.names, self.scalars)

    def slope(self, formula: Formula, names: Mapping[str, Scalar], name: str) -> Scalar:
        """The derivative of a formula of `names` by one of them, by dual numbers."""
        duals = Duals(self.scalars)
        along = {used: duals.still(names[used]) for used in names_in(formula)}
        along[name] = Dual(names[name], self.scalars.number(1.0))
        return evaluate(formula, along, duals).rate

    def partials(self, formula: Formula, by: Literal["positions", "velocities"]) -> Partials:
        """A formula with its derivatives, along one coordinate at a time."""
        names, used = self.names, set(names_in(formula))
        slopes = []
        for body in self.model.bodies:
            own = body.positions if by == "positions" else body.velocities
            along = ((i, c.name) for i, c in enumerate(own) if c.name in used)
            slopes += [(body.joint.name, i, self.slope(formula, names, x)) for i, x in along]
        rates = {c.name: self.zero for body in self.model.bodies for c in body.velocities}
        return Partials(
            evaluate(formula, names, self.scalars),
            tuple(slopes),
            self.slope(formula, names, "t") if "t" in used else self.zero,
            evaluate(formula, {**names, **rates}, self.scalars),
        )

    def gradient(
        self, formula: Formula, names: Mapping[str, Scalar]
    ) -> tuple[Scalar, Vector, Scalar]:
        """A formula of `names`, t and parameters with its derivatives by the names and by t."""
        values, used = {**self.names, **names}, set(names_in(formula))
        *slopes, by_time = (
            self.slope(formula, values, name) if name in used else self.zero
            for name in (*names, "t")
        )
        return evaluate(formula, values, self.scalars), tuple(slopes), by_time

    def input(self, name: str) -> Scalar:
        """An input."""
        return self.names[name]

    def state(self, name: str) -> Scalar:
        """An extra state."""
        return self.names[name]

    def number(self, value: Real) -> Scalar:
        """A number."""
        return self.scalars.number(value)

    def call(self, function: str, *arguments: Scalar) -> Scalar:
        """A function of formulas."""
        return self.scalars.call(function, *arguments)

    def rounded(self, value: Scalar, quantum: Scalar) -> Scalar:
        """The nearest multiple of a quantum."""
        whole = self.number(ROUNDING)
        return quantum * ((value / quantum + whole) - whole)

    def called(self, letter: str, *values: Scalar) -> Vector:
        """The values themselves."""
        return values
