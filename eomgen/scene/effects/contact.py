"""Contact: bodies that do not go through a plane or each other, soft or rigid."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from eomgen.errors import SceneError
from eomgen.language.base import Identifier
from eomgen.language.conditions import Condition, a_part, are_zero, can_meet, not_negative
from eomgen.language.formula import ZERO
from eomgen.language.quantity import Numbers, Quantity, Vector, quantity, with_components
from eomgen.scalars.exact import direction
from eomgen.scene.effects.base import Contact, Load, Mechanism, Scalar
from eomgen.scene.effects.base import Vector as Components
from eomgen.scene.effects.bodies import OnBodies, wrong
from eomgen.scene.effects.touching import (
    Ball,
    Plane,
    Touch,
    merged,
    on_ball,
    on_plane,
    parting,
    point_loads,
    pressing,
    sliding,
    tangents,
)
from eomgen.scene.effects.vectors import LEAST_SQUARE, dot
from eomgen.scene.joints.base import WORLD

LAWS = {
    "spring_damper": ("stiffness", "damping", "allow_active"),
    "hunt_crossley": ("stiffness", "dissipation", "allow_active"),
    "impact": ("restitution",),
}
"""What each law takes beside what all take; the first it needs."""
AGAINST = {
    "plane": ("normal", "offset", "corners", "other"),
    "ball": ("other_radius", "other_at", "other"),
    "each_other": (),
}
"""What contact with each takes beside what all take."""


class BodyContact(OnBodies):
    """Spheres (circles in the plane), points, and corners of boxes, which do not go through things.

    Of `body`, or of each of `bodies`, the sphere of `radius` about `at`, or one about each of the
    named `points`; `radii` gives some bodies radii of their own; of radius 0 it is a point. With
    `corners`, half sizes along the body's axes, it is the corners of the box about `at` instead,
    rounded by a radius if there is one. They are

    - `against = "plane"`: n·x >= `offset`, with the direction `normal` n, up if left out;
    - `against = "ball"`: the sphere of `other_radius` about `other_at`;
    - `against = "each_other"`: every two of `bodies`.

    Plane and ball stand still in the world, or are fixed to the body `other` and counted from its
    centre of mass in its axes. An offset is no formula of time: a floor that moves is a body.

    With the gap g, d = -g where they overlap and else 0, and ḋ = -dg/dt the normal force is

    - `law = "spring_damper"`: max(0, k d + c ḋ) where d > 0; energy ½ k d²;
    - `law = "hunt_crossley"`: max(0, k d^1.5 (1 + 1.5 a ḋ)); energy 2/5 k d^2.5. Hunt & Crossley,
      "Coefficient of restitution interpreted as damping in vibroimpact", J. Appl. Mech. 42 (1975)
      440-445, with λ = 1.5 a k;
    - `law = "impact"`: none; they are rigid, and contact is an event (`Contact`).

    `friction` μ adds -μ F u/sqrt(|u|² + s²) for the slip u (m/s) at the touching point, with
    `slip_speed` s: 71 % of μ F at |u| = s, 99.5 % at 10 s. So nothing quite sticks: under a load of
    the fraction ρ < 1 of μ F it creeps at s ρ/sqrt(1 - ρ²); from a speed v >> s a block slides
    v²/(2 μ g) (1 + (s/v)² (½ + ln(2 v/s))).
    """

    body_fields: ClassVar[tuple[str, ...]] = ("body", "bodies", "radii")
    anchor_fields: ClassVar[tuple[str, ...]] = ("other",)
    vector_fields: ClassVar[tuple[str, ...]] = ("at", "corners", "other_at")

    type: Literal["contact"]
    law: Literal["spring_damper", "hunt_crossley", "impact"]
    against: Literal["plane", "ball", "each_other"] = "plane"
    radius: Quantity = quantity("m", "radius", "nonnegative", default=ZERO, validate_default=False)
    radii: dict[Identifier, Quantity] = quantity(
        "m", "radius", "nonnegative", default={}, validate_default=False
    )
    corners: Vector | None = quantity("m", "half sizes of the box", "positive", default=None)
    normal: Numbers = Field(
        default=(), validate_default=False, description="direction out of the plane"
    )
    offset: Quantity = quantity(
        "m", "position of the plane along its normal", default=ZERO, validate_default=False
    )
    other: Identifier = Field(
        default=WORLD, description="body of the plane or the ball, or 'world'"
    )
    other_at: Vector = quantity(
        "m", "centre of the ball from the centre of mass", default=(), validate_default=False
    )
    other_radius: Quantity = quantity(
        "m", "radius of the ball", "nonnegative", default=ZERO, validate_default=False
    )
    stiffness: Quantity = quantity(
        "N/m or N/m^1.5",
        "stiffness, which the soft laws need",
        "nonnegative",
        default=ZERO,
        validate_default=False,
    )
    damping: Quantity = quantity(
        "N s/m", "damping", "nonnegative", default=ZERO, validate_default=False
    )
    dissipation: Quantity = quantity(
        "s/m", "dissipation a", "nonnegative", default=ZERO, validate_default=False
    )
    restitution: Quantity = quantity(
        "",
        "coefficient of restitution, 0 to 1, which law 'impact' needs",
        default=ZERO,
        validate_default=False,
    )
    friction: Quantity = quantity(
        "", "coefficient of friction", "nonnegative", default=ZERO, validate_default=False
    )
    slip_speed: Quantity | None = quantity(
        "m/s", "speed within which friction is smoothed", "positive", default=None
    )
    allow_active: bool = Field(
        default=False, strict=True, description="whether stiffness and damping may be negative"
    )

    @model_validator(mode="after")
    def _keys_that_belong(self) -> Self:
        given = self.model_fields_set
        choices = (("law", self.law, LAWS), ("against", self.against, AGAINST))
        for choice, chosen, all_keys in choices:
            takes = all_keys[chosen]
            for key in dict.fromkeys(key for keys in all_keys.values() for key in keys):
                if key in given and key not in takes:
                    known = f"it takes {', '.join(takes)}" if takes else "leave it out"
                    raise wrong(key, f"is nothing that {choice} '{chosen}' takes; {known}")
        needed = LAWS[self.law][0]
        if needed not in given:
            raise wrong(needed, f"is missing; law '{self.law}' needs it")
        if "friction" in given and self.slip_speed is None:
            raise wrong("slip_speed", "is missing; it smooths friction, give a small one in m/s")
        if "friction" not in given and self.slip_speed is not None:
            raise wrong("slip_speed", "smooths friction, which is missing; give both")
        return self

    @model_validator(mode="after")
    def _bodies_that_fit(self) -> Self:
        listed = self.bodies if isinstance(self.bodies, tuple) else (self.body,)
        if self.points is not None and self.against == "each_other":
            raise wrong("points", "may lie on one body; give bodies instead")
        if self.points is not None and self.radii:
            raise wrong("radii", "named points have one radius; give each effect its own points")
        if self.against == "each_other" and len(listed) < 2 and self.bodies != "all":
            key = "body" if self.bodies is None else "bodies"
            raise wrong(key, "one body has no other to touch; give two or more in bodies")
        if self.other != WORLD and self.other in listed:
            raise wrong("other", f"'{self.other}' cannot touch itself; name another body or world")
        for name in self.radii:
            if name not in listed and self.bodies != "all":
                raise wrong(f"radii.{name}", "is none of the bodies in contact; leave it out")
        return self

    def checked(self, dimensions: int, location: str) -> Self:
        """Its normal has a direction."""
        up = (0.0,) * (dimensions - 1) + (1.0,)
        normal = with_components(self.normal or up, 0.0, dimensions, f"{location}.normal")
        if not any(normal):
            raise SceneError(f"{location}.normal: has no direction; give one that is not zero")
        return self.replaced(normal=normal)

    def conditions(self, location: str) -> Iterator[Condition]:
        """No radius is negative, spheres have one, restitution is from 0 to 1."""
        radii = {f"radii.{name}": radius for name, radius in self.radii.items()}
        radii |= {"radius": self.radius, "other_radius": self.other_radius}
        for key, radius in radii.items():
            yield not_negative(f"{location}.{key}", radius, "m")
        yield a_part(f"{location}.restitution", self.restitution)
        listed = self.points or (self.bodies if isinstance(self.bodies, tuple) else (self.body,))
        if self.bodies == "all" and self.radii:
            return  # which bodies are left to be points is not known here
        own = [radii.get(f"radii.{name}", self.radius) for name in listed]
        if self.against == "ball":
            for radius in dict.fromkeys(own):
                yield can_meet(f"{location}.other_radius", (radius, self.other_radius))
        if self.against == "each_other":
            both = (*own, self.radius) if self.bodies == "all" else own
            yield can_meet(f"{location}.radius", both)

    def loads(self, mechanism: Mechanism) -> Iterator[Load]:
        """One load a body and touching point of it, for the corners of a box in one."""
        if self.law == "impact":
            return
        found: list[Load] = []
        for touch in self._touches(mechanism):
            if self.friction == ZERO:
                force = self._force(mechanism, touch, parting(mechanism, touch))
                found += pressing(touch, force)
                continue
            apart, slip = sliding(mechanism, touch)
            force = self._force(mechanism, touch, apart)
            speed = self._slip_speed(mechanism)
            size = mechanism.call("sqrt", dot(slip, slip) + speed * speed)
            drag = mechanism.value(self.friction) * force / size
            pairs = zip(touch.normal, slip, strict=True)
            found += point_loads(touch, tuple(force * n - drag * u for n, u in pairs))
        yield from merged(found)

    def potential_energy(self, mechanism: Mechanism) -> Scalar:
        """½ k d² or 2/5 k d^2.5 of every contact, J."""
        total = mechanism.number(0.0)
        if self.law == "impact":
            return total
        power = mechanism.number(2.0 if self.law == "spring_damper" else 2.5)
        for touch in self._touches(mechanism):
            force = self._elastic(mechanism, touch)
            d = mechanism.call("max", -touch.gap, mechanism.number(0.0))
            part = force * d / power
            if touch.meeting is not None:
                part = part + force * touch.meeting
            total = total + part
        return total

    def keeps_energy(
        self, values: Mapping[str, float], inputs: Mapping[str, float], dimensions: int
    ) -> bool:
        """It does if it is soft and neither damps nor rubs."""
        lost = (self.damping, self.dissipation, self.friction)
        return self.law != "impact" and are_zero(values, *lost)

    def overlap(self, mechanism: Mechanism) -> Scalar:
        """The greatest depth d of a soft law, m."""
        deepest = mechanism.number(0.0)
        if self.law == "impact":
            return deepest
        for touch in self._touches(mechanism):
            deepest = mechanism.call("max", deepest, -touch.gap)
        return deepest

    def contact_names(self, bodies: Sequence[str]) -> tuple[str, ...]:
        """Of rigid contacts: `<effect>_<body>`, or `<effect>_<point>`, with the corner's number or
        the other body's name behind it if there is one.
        """
        if self.law != "impact":
            return ()
        touching = self.points or self._in_contact(bodies)
        if self.against == "each_other":
            return tuple(f"{self.name}_{a}_{b}" for a, b in combinations(touching, 2))
        names = [f"{self.name}_{body}" for body in touching]
        if self.corners is None:
            return tuple(names)
        numbers = range(1, 2 ** len(self.corners) + 1)
        return tuple(f"{name}_{number}" for name in names for number in numbers)

    def contacts(self, mechanism: Mechanism) -> tuple[Contact, ...]:
        """Of law "impact": one for each point, sphere, corner or pair of spheres."""
        if self.law != "impact":
            return ()
        names = self.contact_names(mechanism.bodies)
        return tuple(
            Contact(
                name,
                self.name,
                touch.gap,
                pressing(touch, mechanism.number(1.0)),
                tuple(point_loads(touch, tangent) for tangent in tangents(mechanism, touch)),
                mechanism.value(self.restitution),
                mechanism.value(self.friction),
                self._slip_speed(mechanism),
            )
            for name, touch in zip(names, self._touches(mechanism), strict=True)
        )

    def _elastic(self, mechanism: Mechanism, touch: Touch) -> Scalar:
        """k d or k d^1.5, N. d^1.5 has the slope 0 at d = 0, as `vectors.length` has it."""
        d = mechanism.call("max", -touch.gap, mechanism.number(0.0))
        force = mechanism.value(self.stiffness) * d
        if self.law == "spring_damper":
            return force
        least = mechanism.number(LEAST_SQUARE)
        return force * mechanism.call("sqrt", mechanism.call("max", d, least))

    def _force(self, mechanism: Mechanism, touch: Touch, apart: Scalar) -> Scalar:
        """The normal force, N, where the gap grows by `apart`, m/s."""
        force, nothing = self._elastic(mechanism, touch), mechanism.number(0.0)
        if self.law == "spring_damper" and self.damping != ZERO:
            force = force - mechanism.value(self.damping) * apart
            force = mechanism.call("max", force, nothing)
            return mechanism.call("select", -touch.gap, force, nothing)
        if self.law == "hunt_crossley" and self.dissipation != ZERO:
            faster = mechanism.number(1.5) * mechanism.value(self.dissipation)
            force = force * (mechanism.number(1.0) - faster * apart)
            return mechanism.call("max", force, nothing)
        return force

    def _slip_speed(self, mechanism: Mechanism) -> Scalar:
        """m/s; without friction any does."""
        return (
            mechanism.number(1.0) if self.slip_speed is None else mechanism.value(self.slip_speed)
        )

    def _in_contact(self, bodies: Sequence[str]) -> list[str]:
        """Those of all bodies that are in contact with something."""
        if self.body is not None:
            return [self.body]
        listed = self.bodies if isinstance(self.bodies, tuple) else bodies
        return [body for body in listed if body != self.other]

    def _touches(self, mechanism: Mechanism) -> Iterator[Touch]:
        balls = [
            Ball(body, at, mechanism.value(self.radii.get(body, self.radius)))
            for body, at in self.loaded_points(mechanism)
            if body != self.other
        ]
        if self.against == "each_other":
            yield from (on_ball(mechanism, *pair) for pair in combinations(balls, 2))
            return
        if self.against == "ball":
            centre = tuple(mechanism.value(part) for part in self.other_at)
            ball = Ball(self.other, centre, mechanism.value(self.other_radius))
            yield from (on_ball(mechanism, first, ball) for first in balls)
            return
        zeros = (mechanism.number(0.0),) * mechanism.dimensions
        normal = tuple(mechanism.number(x) for x in direction(self.normal))
        plane = Plane(self.other, zeros, normal, mechanism.value(self.offset))
        corners: Components | None = None
        if self.corners is not None:
            corners = tuple(mechanism.value(part) for part in self.corners)
        for ball in balls:
            yield from on_plane(mechanism, plane, ball, corners)
