"""Force fields: formulas of position, velocity and time, and some predefined ones."""

from collections.abc import Iterator, Mapping
from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from eomgen.language.base import Number
from eomgen.language.formula import ZERO
from eomgen.language.quantity import Quantity, quantity
from eomgen.language.quantity import Vector as VectorField
from eomgen.scene.effects.base import Load, Mechanism, Scalar, Vector
from eomgen.scene.effects.bodies import OnBodies, local_names, wrong
from eomgen.scene.effects.elements import WORLD_INDEX, Element, Layout, Round
from eomgen.scene.effects.elements import Field as Drawn
from eomgen.scene.effects.vectors import cross, dot, length, negative, scale, sub

Kind = Literal["formula", "attract", "repel", "vortex", "avoid"]
CENTRAL = ("center", "strength", "power", "softening")
KEYS: dict[str, tuple[str, ...]] = {
    "formula": ("force",),
    "attract": CENTRAL,
    "repel": CENTRAL,
    "vortex": CENTRAL,
    "avoid": ("center", "steering", "radius", "reach"),
}
"""The keys of each kind in addition to the common ones."""
NEEDED = {"formula": ("force",), "avoid": ("steering", "radius", "reach")}
MOST_POWER = 12
HEAD_ON = 1e-18
"""Square of the sine of the angle to the obstacle below which a point moves straight towards it."""


class ForceField(OnBodies):
    """A force at a point of a body that depends on its position and velocity and on time.

    With the vector r from `center` to the point and s² = r·r + softening², in world axes:

    - "formula": `force`, a formula of x, y, z and vx, vy, vz of the point, of t and the motion;
    - "attract", "repel": ∓strength r / s^(power+1), which has a potential energy;
    - "vortex": strength ẑ × r / s^(power+1), anticlockwise about the z axis through `center`; r and
      s are those in the x-y plane;
    - "avoid": steers away from an obstacle (handout, section 1), a ball of `radius`, within `reach`
      of its surface. The force is perpendicular to the velocity v, so it does no work:
      steering h² c² |v| v × n with the unit vector n along v × d and the vector d to the centre. h
      falls from 1 at the surface to 0 at `reach`; c is the cosine between v and d, or 0 if the
      point moves away. The path past an obstacle does not depend on the speed. If v points to the
      centre, n is ẑ and the path turns right. The field only changes the direction of motion; if
      it is too weak, a body passes through the obstacle.

    Without softening the central fields are infinite at the centre. A run with adaptive steps stops
    there; a run with fixed steps may jump across the centre and continue with a large error.
    """

    example: ClassVar[str] = """
[[effects]]
type = "field"
name = "stream"
body = "hand"
force = ["-2*(vx - 1)", "-2*vy"]
"""
    vector_fields = ("at", "center", "force")

    type: Literal["field"]
    kind: Kind = "formula"
    force: VectorField = quantity(
        "N",
        "force",
        sees=("motion", "x", "y", "z", "vx", "vy", "vz"),
        default=(),
        validate_default=False,
    )
    center: VectorField = quantity("m", "centre in the world", default=(), validate_default=False)
    strength: Quantity | None = quantity("N m^power", "strength", "nonnegative", default=None)
    steering: Quantity | None = quantity(
        "kg/m",
        "steering coefficient, mass times curvature of the path",
        "nonnegative",
        default=None,
    )
    power: Number = Field(
        default=2.0, ge=0, le=MOST_POWER, description="power of the distance, a whole number"
    )
    softening: Quantity = quantity(
        "m", "softening length", "nonnegative", default=ZERO, validate_default=False
    )
    radius: Quantity | None = quantity("m", "radius of the obstacle", "nonnegative", default=None)
    reach: Quantity | None = quantity(
        "m", "distance from the surface up to which it acts", "positive", default=None
    )

    @model_validator(mode="after")
    def _keys_of_kind(self) -> Self:
        every = dict.fromkeys(key for keys in KEYS.values() for key in keys)
        for key in every:
            if key in self.model_fields_set and key not in KEYS[self.kind]:
                known = ", ".join(KEYS[self.kind])
                raise wrong(key, f"does not belong to kind '{self.kind}'; it takes {known}")
        for key in NEEDED.get(self.kind, ("strength",)):
            if key not in self.model_fields_set:
                raise wrong(key, f"is missing; kind '{self.kind}' needs it")
        if not self.power.is_integer():
            raise wrong("power", f"{self.power:g} is not a whole number; give one")
        return self

    def loads(self, mechanism: Mechanism) -> Iterator[Load]:
        """The force on each body."""
        for body, at in self.loaded_points(mechanism):
            if self.kind == "formula":
                names = local_names(mechanism, self.force, body, at)
                force: Vector = tuple(mechanism.value(part, **names) for part in self.force)
            elif self.kind == "avoid":
                force = self._sideways(mechanism, body, at)
            else:
                force = self._central(mechanism, body, at)
            yield Load(body, force, at, "applied")

    def elements(self, layout: Layout) -> Iterator[Element]:
        """An obstacle, arrows, or a centre."""
        if self.kind == "avoid":
            assert self.radius is not None and self.reach is not None  # by the kind
            yield Round(
                "obstacle", self.name, WORLD_INDEX, self.center, self.radius, reach=self.reach
            )
        elif self.kind == "formula":
            yield Drawn(self.name, self.kind, formula=self.force)
        else:
            yield Drawn(self.name, self.kind, self.center)

    def potential_energy(self, mechanism: Mechanism) -> Scalar:
        """That of "attract" and "repel", J: 0 at infinity if power > 1, at s = 1 m if power = 1, at
        s = 0 if power < 1.
        """
        total = mechanism.zero
        if self.kind not in ("attract", "repel"):
            return total
        for body, at in self.loaded_points(mechanism):
            square = self._square(mechanism, self._from_center(mechanism, body, at))
            if self.power == 1:
                part = mechanism.number(0.5) * mechanism.call("log", square)
            else:
                shared = mechanism.number(1 - self.power)
                part = mechanism.number(1.0) / (shared * _raised(mechanism, square, self.power - 1))
            total = total + part
        total = total * self._value(mechanism, self.strength)
        return total if self.kind == "attract" else -total

    def keeps_energy(
        self, values: Mapping[str, float], inputs: Mapping[str, float], dimensions: int
    ) -> bool:
        """True for fields with a potential, and for "avoid", which does no work."""
        return self.kind in ("attract", "repel", "avoid")

    def _from_center(self, mechanism: Mechanism, body: str, at: Vector) -> Vector:
        """The vector r from the centre to the point, m."""
        centre = tuple(mechanism.value(part) for part in self.center)
        return sub(mechanism.position(body, at), centre)

    def _square(self, mechanism: Mechanism, r: Vector) -> Scalar:
        softening = mechanism.value(self.softening)
        return dot(r, r) + softening * softening

    def _value(self, mechanism: Mechanism, given: Quantity | None) -> Scalar:
        assert given is not None  # checked in `_keys_of_kind`
        return mechanism.value(given)

    def _central(self, mechanism: Mechanism, body: str, at: Vector) -> Vector:
        r, zero = self._from_center(mechanism, body, at), mechanism.zero
        if self.kind == "vortex":
            r = r[:2]
        r = mechanism.called("r", *r)
        square = self._square(mechanism, r)
        factor = self._value(mechanism, self.strength)
        factor = factor / _raised(mechanism, square, self.power + 1)
        if self.kind == "vortex":
            return (-(factor * r[1]), factor * r[0], zero)[: mechanism.dimensions]
        if self.kind == "attract":
            factor = -factor
        return scale(factor, r)

    def _sideways(self, mechanism: Mechanism, body: str, at: Vector) -> Vector:
        call, zero, one = mechanism.call, mechanism.zero, mechanism.number(1.0)
        ahead = mechanism.called("d", *negative(self._from_center(mechanism, body, at)))
        v = mechanism.velocity(body, at)
        distance, speed = length(mechanism, ahead), length(mechanism, v)
        distance, speed = mechanism.called("l", distance)[0], mechanism.called("v", speed)[0]
        gap = distance - self._value(mechanism, self.radius)
        near = call("max", zero, one - gap / self._value(mechanism, self.reach))
        (near,) = mechanism.called("h", call("min", near, one))
        towards = call("max", zero, dot(v, ahead))
        # c² |v|, where `length` keeps the speed above 0.
        (cosine,) = mechanism.called("c", towards / (distance * speed))
        factor = self._value(mechanism, self.steering) * near * near * cosine * cosine * speed
        if mechanism.dimensions == 2:
            left = v[0] * ahead[1] - v[1] * ahead[0]  # its sign says on which side the obstacle is
            factor = call("select", -left, -factor, factor)
            return (factor * v[1], -(factor * v[0]))
        n = self._turning_axis(mechanism, v, ahead, (distance * speed) * (distance * speed))
        return scale(factor, cross(v, n))

    def _turning_axis(
        self, mechanism: Mechanism, v: Vector, ahead: Vector, scale: Scalar
    ) -> Vector:
        """The unit vector n along v × d in space; ẑ if they are parallel."""
        call, zero, one = mechanism.call, mechanism.zero, mechanism.number(1.0)
        about = cross(v, ahead)
        beside = dot(about, about) - mechanism.number(HEAD_ON) * scale
        upright = (zero, zero, one)
        axis = tuple(call("select", beside, a, b) for a, b in zip(about, upright, strict=True))
        size = length(mechanism, axis)
        return mechanism.called("n", *(part / size for part in axis))


def _raised(mechanism: Mechanism, square: Scalar, power: float) -> Scalar:
    """A length to a whole power, -1 or more, from its square."""
    if power < 0:
        return mechanism.number(1.0) / mechanism.call("sqrt", square)
    result = mechanism.number(1.0)
    for _ in range(int(power) // 2):
        result = result * square
    return result * mechanism.call("sqrt", square) if int(power) % 2 else result
