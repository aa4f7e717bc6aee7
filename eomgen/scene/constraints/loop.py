"""A joint that closes a loop: it constrains two bodies and adds no coordinates."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from eomgen.base.errors import SceneError
from eomgen.scalars import exact
from eomgen.scene.constraints.base import Linkage, Pair, Row
from eomgen.scene.effects.base import Load, Scalar, Vector
from eomgen.scene.effects.vectors import add, cross, dot, negative, scale, sub
from eomgen.scene.joints import (
    Ball,
    Cylindrical,
    Free,
    Joint,
    Particle,
    Planar,
    Prismatic,
    Revolute,
    Universal,
    Weld,
)
from eomgen.scene.joints.base import WORLD, Orientation, spatial

LoopClosing = Ball | Cylindrical | Particle | Planar | Prismatic | Revolute | Universal | Weld
Direction = tuple[exact.Real, ...]
X, Y, Z = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class LoopJoint:
    """A joint with `loop = true`.

    Positions are compared at the joint's points x_C of the child and x_P of the parent. A pin, a
    ball or a universal joint makes them one point (three rows along the world's axes, two in the
    plane). A joint that slides leaves x_C - x_P the directions of its motion (rows along the
    others, fixed to the parent). Orientations are compared by unit vectors a, fixed to the parent,
    and b, fixed to the child, whose angle is the same in every position of the joint: a · b is
    constant. Such a row is 0 also where the child is turned by half a turn; assembly excludes that.
    """

    joint: LoopClosing

    @property
    def name(self) -> str:
        """The joint's name."""
        return self.joint.name

    def row_names(self, dimensions: int) -> list[tuple[str, str]]:
        """The name and the unit of the multiplier of each row."""
        joint, count = self.joint, 0
        if isinstance(joint, Planar):
            words = ["across"]
        elif isinstance(joint, Prismatic | Cylindrical):
            words = ["across"] if dimensions == 2 else ["across_1", "across_2"]
        elif isinstance(joint, Particle):
            words = []
        else:
            words = list("xyz"[:dimensions])
        if dimensions == 2:
            count = 0 if isinstance(joint, Revolute) else 1
        elif isinstance(joint, Weld | Prismatic | Particle):
            count = 3
        elif not isinstance(joint, Ball):
            count = 1 if isinstance(joint, Universal) else 2
        angles = ["angle"] if count == 1 else [f"angle_{i + 1}" for i in range(count)]
        names = [(word, "N") for word in words] + [(word, "N m") for word in angles]
        return [(f"{self.name}_{word}", unit) for word, unit in names]

    def velocity_rows(self, dimensions: int) -> tuple[str, ...]:
        """None of its rows restricts velocities alone."""
        return ()

    @property
    def internal(self) -> bool:
        """True between two bodies."""
        return WORLD not in (self.joint.parent, self.joint.child)

    def loop_part(self) -> Pair | None:
        """A pin or a slider."""
        slides = isinstance(self.joint, Prismatic)
        return Pair(self.joint, slides) if slides or isinstance(self.joint, Revolute) else None

    def rows(self, mechanism: Linkage) -> Sequence[Row]:
        """Positions first, then orientations."""
        return [*self._positions(mechanism), *self._orientations(mechanism)]

    def upright(self, mechanism: Linkage) -> list[Scalar]:
        """Cosines that are 1 where the child is not turned by half a turn; see `rows`."""
        return [dot(a, b) for a, b in self._alike(mechanism)]

    # Positions.

    def _positions(self, mechanism: Linkage) -> Iterator[Row]:
        parent, child = self.joint.parent, self.joint.child
        at_parent = tuple(mechanism.value(part) for part in self.joint.r_parent)
        at_child = tuple(mechanism.value(part) for part in self.joint.r_child)
        d = sub(mechanism.position(child, at_child), mechanism.position(parent, at_parent))
        held = self._held(mechanism)
        if held is None:
            for i in range(mechanism.dimensions):
                e = tuple(mechanism.number(float(i == k)) for k in range(mechanism.dimensions))
                loads = (
                    Load(child, e, at_child, "applied"),
                    Load(parent, negative(e), at_parent, "applied"),
                )
                yield Row(d[i], loads)
            return
        for e in held:
            arm = cross(d, e)  # the parent's force acts at the child's point
            loads = (
                Load(child, e, at_child, "applied"),
                Load(parent, negative(e), at_parent, "applied", negative(arm)),
            )
            yield Row(dot(e, d), loads)

    def _held(self, mechanism: Linkage) -> list[Vector] | None:
        """World directions in which a joint that slides holds its point; None if it holds it in
        all.
        """
        joint = self.joint
        if isinstance(joint, Particle):
            return []
        if isinstance(joint, Planar):
            return [self._on_parent(mechanism, Z)]
        if isinstance(joint, Prismatic | Cylindrical):
            return [
                self._on_parent(mechanism, n)
                for n in exact.perpendiculars(spatial(joint.axis))
                if mechanism.dimensions == 3 or n[2] == 0
            ]
        return None

    # Orientations.

    def _orientations(self, mechanism: Linkage) -> Iterator[Row]:
        for a, b, cosine in self._across(mechanism):
            if mechanism.dimensions == 2:
                residual, torque = cross(a, b)[0], (dot(a, b),)
            else:
                residual, torque = dot(a, b) - cosine, cross(b, a)
            still = tuple(mechanism.zero for _ in a)
            loads = (
                Load(self.joint.child, still, still, "applied", torque),
                Load(self.joint.parent, still, still, "applied", negative(torque)),
            )
            yield Row(residual, loads)

    def _across(self, mechanism: Linkage) -> list[tuple[Vector, Vector, Scalar]]:
        """Pairs of directions, of the parent and of the child, that keep an angle, and its cosine;
        in the plane, that stay parallel, and 0.
        """
        joint, nothing = self.joint, mechanism.zero
        if mechanism.dimensions == 2:
            return [(a, b, nothing) for a, b in self._alike(mechanism)]
        if isinstance(joint, Ball):
            return []
        if isinstance(joint, Universal):
            first, second = (exact.direction(spatial(axis)) for axis in joint.axes)
            cosine = mechanism.number(exact.inner(first, second))
            pairs: list[tuple[Direction, Direction]] = [(first, second)]
        else:
            cosine = nothing
            axis = self._axis
            if axis is None:
                pairs = [(X, Y), (Y, Z), (Z, X)]
            else:
                pairs = [(n, exact.direction(axis)) for n in exact.perpendiculars(axis)]
        return [
            (self._on_parent(mechanism, a), self._on_child(mechanism, b), cosine) for a, b in pairs
        ]

    def _alike(self, mechanism: Linkage) -> list[tuple[Vector, Vector]]:
        """Pairs of directions that are the same where the joint is closed."""
        joint = self.joint
        if isinstance(joint, Ball | Universal):
            return []
        if mechanism.dimensions == 2:
            axes = [] if isinstance(joint, Revolute) else [X]
        else:
            axes = [X, Y, Z] if self._axis is None else [self._axis]
        units = [exact.direction(axis) for axis in axes]
        return [(self._on_parent(mechanism, u), self._on_child(mechanism, u)) for u in units]

    @property
    def _axis(self) -> tuple[float, float, float] | None:
        """The axis in space about which the child may rotate; None if it does not rotate."""
        joint = self.joint
        if isinstance(joint, Planar):
            return Z
        if isinstance(joint, Revolute | Cylindrical):
            return spatial(joint.axis or Z)
        return None

    def _on_parent(self, mechanism: Linkage, direction: Direction) -> Vector:
        """A direction of the joint's axes on the parent, in world axes."""
        turned = exact.image(exact.orientation(self.joint.orientation_deg), direction)
        parts = tuple(map(mechanism.number, turned))[: mechanism.dimensions]
        if self.joint.orientation is not None:
            parts = rotated(mechanism, self.joint.orientation, parts)
        return mechanism.outward(self.joint.parent, parts)

    def _on_child(self, mechanism: Linkage, direction: Direction) -> Vector:
        """A direction of the joint's axes on the child, in world axes."""
        parts = tuple(map(mechanism.number, direction))[: mechanism.dimensions]
        return mechanism.outward(self.joint.child, parts)


def rotated(mechanism: Linkage, by: Orientation, vector: Vector) -> Vector:
    """A vector rotated by formulas: an angle in the plane; three angles about x, y and z, a
    quaternion w, x, y, z of any length, or the rows of a matrix.
    """
    if not isinstance(by, tuple):
        x, y = vector
        return _about(mechanism, mechanism.value(by), x, y)
    rows = [row for row in by if isinstance(row, tuple)]
    if rows:
        return tuple(dot(tuple(map(mechanism.value, row)), vector) for row in rows)
    parts = [mechanism.value(part) for part in by if not isinstance(part, tuple)]
    x, y, z = vector
    if len(parts) == 3:
        y, z = _about(mechanism, parts[0], y, z)
        z, x = _about(mechanism, parts[1], z, x)
        x, y = _about(mechanism, parts[2], x, y)
        return x, y, z
    w, u = parts[0], tuple(parts[1:])
    once = cross(u, vector)
    whole = add(scale(w, once), cross(u, once))
    share = mechanism.number(2.0) / (w * w + dot(u, u))
    return add(vector, scale(share, whole))


def _about(mechanism: Linkage, angle: Scalar, x: Scalar, y: Scalar) -> tuple[Scalar, Scalar]:
    c, s = mechanism.call("cos", angle), mechanism.call("sin", angle)
    return c * x - s * y, s * x + c * y


def loop_joint(joint: Joint, location: str, dimensions: int) -> LoopJoint:
    """The constraint of a joint that closes a loop.

    Raises `SceneError` for a joint that constrains nothing.
    """
    if isinstance(joint, Free) or (dimensions == 2 and joint.type == "planar"):
        raise SceneError(
            f"{location}.loop: a '{joint.type}' joint holds nothing here, so it closes no loop; "
            "leave the joint out"
        )
    return LoopJoint(joint)
