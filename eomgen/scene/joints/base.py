"""The base of joint types: their table, coordinates and primitives.

A joint is a sequence of primitives: revolute, prismatic or spherical. The velocity of the child
relative to the parent is S v for the joint's velocities v. The columns of S, the joint motion
subspace (Featherstone 2008, 3.5 and 4.4), are the axes of the primitives: an angular axis for a
revolute primitive, a linear one for a prismatic, three angular ones for a spherical. In a frame's
own axes every column is constant; `dynamics.kinematics.MotionAxis` is one column.
"""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from eomgen.language.base import AngleOrNumber, Identifier, Number, Table
from eomgen.language.formula import ZERO, Apply, Formula
from eomgen.language.quantity import Quantity, Vector, quantity

WORLD = "world"
"""The name of the ground, the root of each tree."""


@dataclass(frozen=True)
class Coordinate:
    """One coordinate or one velocity of a joint: name, unit, and a description."""

    name: str
    unit: str
    about: str

    @property
    def rate(self) -> "Coordinate":
        """The velocity that is the time derivative of this coordinate."""
        return Coordinate(f"{self.name}_dot", f"{self.unit}/s", f"rate of {self.name}")

    @property
    def acceleration(self) -> str:
        """Name of a velocity's time derivative: theta_ddot of theta_dot, hip_wx_dot of hip_wx."""
        stem = self.name.removesuffix("_dot")
        return f"{self.name}_dot" if stem == self.name else f"{stem}_ddot"


@dataclass(frozen=True)
class Primitive:
    """A joint primitive: one motion of the child relative to the parent, in the axes that the
    primitives before it leave.

    `revolute` and `prismatic` have one coordinate, about or along `axis` (of any length).
    `spherical` is a rotation by a unit quaternion w, x, y, z; its velocities are the angular
    velocity in the rotated axes.
    """

    kind: Literal["revolute", "prismatic", "spherical"]
    axis: tuple[float, float, float] = (0.0, 0.0, 0.0)


Z_AXIS = (0.0, 0.0, 1.0)


Orientation = (
    Quantity
    | Annotated[tuple[Quantity, ...], Field(min_length=3, max_length=4)]
    | tuple[
        tuple[Quantity, Quantity, Quantity],
        tuple[Quantity, Quantity, Quantity],
        tuple[Quantity, Quantity, Quantity],
    ]
)
"""An angle, three angles, a quaternion or a matrix."""


class JointTable(Table):
    """The keys of all joints except the free one: two bodies, a point on each, a fixed rotation."""

    holds: ClassVar[bool] = True
    """Whether it restricts the motion of its child: a free joint does not."""
    needs_inertia: ClassVar[bool] = True
    """Whether its child needs an `inertia_com`."""
    spaces: ClassVar[tuple[int, ...]] = (2, 3)
    """Dimensions of scenes that this joint type exists in."""

    name: Identifier
    parent: Identifier = Field(description="body on the inner side, or 'world'")
    child: Identifier = Field(description="body on the outer side")
    r_parent: Vector = quantity(
        "m", "joint from the parent's centre of mass", default=(), validate_default=False
    )
    r_child: Vector = quantity(
        "m", "joint from the child's centre of mass", default=(), validate_default=False
    )
    orientation_deg: Number | tuple[Number, Number, Number] = Field(
        default=0.0,
        union_mode="left_to_right",
        description="orientation of the child's axes in the parent's where the coordinates are 0: "
        "an angle; in space three angles about x, then y, z",
    )

    orientation: Orientation | None = Field(
        default=None,
        description="the same: an angle; in space three angles about x, then y, z, a quaternion w, "
        "x, y, z, or a matrix of three rows. Angles are in rad or written as '90 deg'. Formulas of "
        "parameters are allowed",
    )
    loop: bool = Field(
        default=False,
        strict=True,
        description="whether it closes a loop: it then holds two bodies that other joints carry, "
        "and adds no coordinates",
    )


class WithRotor(JointTable):
    """A joint whose velocities are all angular or all linear, and to each of which a motor's rotor
    may add inertia.

    The inertia is added to the velocity's diagonal entry of M, as `armature` in MuJoCo and the
    reflected inertia of Drake are. The rotor's mass is part of a body's, and the moment that turns
    its axis (gyroscopic moment) is left out: it is smaller by the gear ratio.
    """

    motor_inertia: Quantity = quantity(
        "kg m^2",
        "rotor inertia, added to each velocity; in kg if these are linear and there is no "
        "gear_ratio",
        "nonnegative",
        default=ZERO,
        validate_default=False,
    )

    @property
    def reflected_inertia(self) -> Formula:
        """The inertia that is added to each velocity, kg m² or kg."""
        return self.motor_inertia


class Geared(WithRotor):
    """A joint with one coordinate, and optionally the geared rotor of a motor."""

    coordinate: Identifier | None = Field(default=None, description="name of the coordinate")
    gear_ratio: Quantity | None = quantity(
        "", "turns of the rotor for one turn of the joint", default=None
    )
    limits: tuple[AngleOrNumber, AngleOrNumber] | None = Field(
        default=None, description="range of the coordinate; leaving it is reported, not prevented"
    )

    @property
    def reflected_inertia(self) -> Formula:
        """gear_ratio² motor_inertia, kg m² or kg."""
        if self.gear_ratio is None:
            return self.motor_inertia
        return Apply("*", (Apply("*", (self.gear_ratio, self.gear_ratio)), self.motor_inertia))


def kinds_of(joint: Any, dimensions: int) -> list[str]:
    """The kinds of a joint's primitives, in order."""
    return [primitive.kind for primitive in joint.primitives(dimensions)]


def spatial(vector: tuple[float, ...]) -> tuple[float, float, float]:
    """A vector of the plane or of space as one of space."""
    x, y, *z = vector
    return (x, y, z[0] if z else 0.0)
