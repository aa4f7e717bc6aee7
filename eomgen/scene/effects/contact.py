"""Soft and rigid contact of bodies with a plane, with a sphere or with each other."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from eomgen.language.conditions import Condition, a_part, are_zero
from eomgen.language.formula import ZERO
from eomgen.language.quantity import Quantity, quantity
from eomgen.scene.effects.base import Contact, Load, Mechanism, Resistance, Scalar, Vector
from eomgen.scene.effects.bodies import wrong
from eomgen.scene.effects.contact_geometry import ContactGeometry
from eomgen.scene.effects.touching import (
    Touch,
    gap_rate_and_slip,
    gap_rate_of,
    merged,
    normal_loads,
    point_loads,
    pressed,
    tangents,
)
from eomgen.scene.effects.vectors import LEAST_SQUARE, at_least_zero, dot

LAWS = {
    "spring_damper": ("stiffness", "damping", "allow_active"),
    "hunt_crossley": ("stiffness", "dissipation", "allow_active"),
    "impact": ("restitution",),
}
"""The keys of each law in addition to the common ones; the first is required."""


class BodyContact(ContactGeometry):
    """Contact of spheres (circles in the plane), points, and corners of boxes.

    Each body of `body` or `bodies` has a sphere of `radius` at `at`, or each of the named `points`
    is the centre of one. `radii` gives single bodies another radius; a sphere of radius 0 is a
    point. With `corners`, half sizes along the body's axes, the corners of a box at `at` are used
    instead, rounded by the radius. These touch

    - `against = "plane"`: the half-space n·x <= `offset`, with n along `normal`, by default up;
    - `against = "heights"`: the ground of the world below `height`, a formula of x, and y in space;
    - `against = "ball"`: the sphere of `other_radius` at `other_at`;
    - `against = "each_other"`: each other, every pair of `bodies`.

    With `shapes` in place of bodies, these are capsules, boxes, ellipsoids and hulls, each of one
    body: see `shapes of contacts`.

    Plane and ball are fixed in the world, or to the body `other`; then they are given relative to
    its centre of mass, in its axes. An offset cannot depend on time: a moving floor is a body.

    With the gap g, the depth d = max(0, -g) and ḋ = -dg/dt, the normal force is

    - `law = "spring_damper"`: max(0, k d + c ḋ) where d > 0; energy ½ k d²;
    - `law = "hunt_crossley"`: max(0, k d^1.5 (1 + 1.5 a ḋ)); energy 2/5 k d^2.5. Hunt & Crossley,
      "Coefficient of restitution interpreted as damping in vibroimpact", J. Appl. Mech. 42 (1975)
      440-445, with λ = 1.5 a k;
    - `law = "impact"`: none; the bodies are rigid, and contacts are events of a run.

    `friction` μ adds -μ F u/sqrt(|u|² + s²) for the slip velocity u (m/s) at the contact point,
    with `slip_speed` s: 71 % of μ F at |u| = s, 99.5 % at 10 s. There is no exact sticking: under a
    tangential load of a fraction ρ < 1 of μ F a body creeps at s ρ/sqrt(1 - ρ²); from a speed
    v >> s a block slides v²/(2 μ g) (1 + (s/v)² (½ + ln(2 v/s))).
    """

    example: ClassVar[str] = """
[[effects]]
type = "contact"
name = "floor"
law = "hunt_crossley"
body = "hand"
radius = 0.05
offset = -1.0
stiffness = 5e4
dissipation = 0.2
"""
    choices: ClassVar[Mapping[str, Mapping[str, tuple[str, ...]]]] = {
        "law": LAWS,
        **ContactGeometry.choices,
    }

    type: Literal["contact"]
    law: Literal["spring_damper", "hunt_crossley", "impact"]
    stiffness: Quantity = quantity(
        "N/m or N/m^1.5",
        "stiffness (needed by the soft laws)",
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
        "coefficient of restitution, 0 to 1 (needed by law 'impact')",
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
    def _keys_fit(self) -> Self:
        given = self.model_fields_set
        needed = LAWS[self.law][0]
        if needed not in given:
            raise wrong(needed, f"is missing; law '{self.law}' needs it")
        if "friction" in given and self.slip_speed is None:
            raise wrong("slip_speed", "is missing; it smooths friction; give a small value in m/s")
        if "friction" not in given and self.slip_speed is not None:
            raise wrong("slip_speed", "smooths friction, which is missing; give both")
        return self

    def conditions(self, location: str) -> Iterator[Condition]:
        """Restitution is from 0 to 1."""
        yield from super().conditions(location)
        yield a_part(f"{location}.restitution", self.restitution)

    def loads(self, mechanism: Mechanism) -> Iterator[Load]:
        """Normal and friction forces: a load for each body and contact, one for all corners."""
        if self.law == "impact":
            return
        found: list[Load] = []
        for touch in self.touches(mechanism):
            if self.friction == ZERO:
                force = self._named_force(mechanism, touch, gap_rate_of(mechanism, touch))
                found += normal_loads(touch, force)
                continue
            gap_rate, slip = gap_rate_and_slip(mechanism, touch)
            force = pressed(touch, self._named_force(mechanism, touch, gap_rate))
            drag = self._drag(mechanism, touch, force, slip)
            pairs = zip(touch.normal, slip, strict=True)
            found += point_loads(touch, tuple(force * n - drag * u for n, u in pairs))
        yield from merged(found)

    def _drag(self, mechanism: Mechanism, touch: Touch, force: Scalar, slip: Vector) -> Scalar:
        """The friction of a normal force over the slip velocity, N s/m."""
        speed = self._slip_speed(mechanism)
        size = mechanism.call("sqrt", dot(slip, slip) + speed * speed)
        drag = mechanism.value(self.friction) * force / size
        return drag if touch.share is None else drag * touch.share

    def resistances(self, mechanism: Mechanism, h: Scalar) -> Iterator[Resistance]:
        """Along the gap the slopes of the normal force; across it the drag of friction over the
        slip, of the normal force before the step.

        What touches only where the step leads has the force there, for the part of the step in
        which it touches: so it takes at least the energy from the motion that the contact stores.
        """
        if self.law == "impact":
            return
        one, nothing = mechanism.number(1.0), mechanism.zero
        for touch in self.touches(mechanism):
            gap_rate, slip = gap_rate_and_slip(mechanism, touch)
            step = h * gap_rate
            closing = mechanism.call("max", -step, mechanism.number(LEAST_SQUARE))
            gap = mechanism.call("select", -touch.gap, touch.gap, touch.gap + step)
            part = mechanism.call("select", -touch.gap, one, -gap / closing)
            ahead = replace(touch, gap=gap)
            force = part * self._force(mechanism, ahead, gap_rate)
            stiffness, damping = (part * x for x in self._slopes(mechanism, ahead, gap_rate))
            before = self._force(mechanism, touch, gap_rate)
            change = mechanism.call("select", -touch.gap, -(stiffness * step), force)
            if self.friction != ZERO:
                drag = self._drag(mechanism, touch, pressed(touch, before), slip)
                for i in range(len(slip)):
                    axis = tuple(one if i == j else nothing for j in range(len(slip)))
                    yield Resistance(point_loads(touch, axis), nothing, drag)
                square = one if touch.slope is None else touch.slope * touch.slope
                damping = damping - drag / square
            yield Resistance(normal_loads(touch, one), stiffness, damping, change)

    def _slopes(
        self, mechanism: Mechanism, touch: Touch, gap_rate: Scalar
    ) -> tuple[Scalar, Scalar]:
        """How fast the normal force grows with the depth and with its rate, at least 0."""
        force, nothing = self._force(mechanism, touch, gap_rate), mechanism.zero
        if self.law == "spring_damper":
            parts = (self.stiffness, self.damping)
            found = [at_least_zero(mechanism, mechanism.value(part)) for part in parts]
        else:
            depth = mechanism.call("max", -touch.gap, mechanism.number(LEAST_SQUARE))
            elastic = self._elastic(mechanism, touch)
            factor = mechanism.number(1.5)
            found = [factor * force / depth, factor * mechanism.value(self.dissipation) * elastic]
        stiffness, damping = (mechanism.call("select", force, x, nothing) for x in found)
        return stiffness, damping

    def potential_energy(self, mechanism: Mechanism) -> Scalar:
        """½ k d² or 2/5 k d^2.5, summed over contacts, J."""
        total = mechanism.zero
        if self.law == "impact":
            return total
        power = mechanism.number(2.0 if self.law == "spring_damper" else 2.5)
        for touch in self.touches(mechanism):
            force = self._elastic(mechanism, touch)
            d = mechanism.call("max", -touch.gap, mechanism.zero)
            part = force * d / power
            if touch.energy_term is not None:
                part = part + force * touch.energy_term
            total = total + part
        return total

    def keeps_energy(
        self, values: Mapping[str, float], inputs: Mapping[str, float], dimensions: int
    ) -> bool:
        """True for a soft law without damping and friction."""
        lost = (self.damping, self.dissipation, self.friction)
        return self.law != "impact" and are_zero(values, *lost)

    def overlap(self, mechanism: Mechanism) -> Scalar:
        """The greatest depth d of a soft law, m."""
        deepest = mechanism.zero
        if self.law == "impact":
            return deepest
        for touch in self.touches(mechanism):
            deepest = mechanism.call("max", deepest, -touch.gap)
        return deepest

    def contact_names(self, bodies: Sequence[str]) -> tuple[str, ...]:
        """Names of rigid contacts."""
        return self.touch_names(bodies) if self.law == "impact" else ()

    def contacts(self, mechanism: Mechanism) -> tuple[Contact, ...]:
        """For law "impact" a contact for each touch."""
        if self.law != "impact":
            return ()
        names = self.contact_names(mechanism.bodies)
        return tuple(
            Contact(
                name,
                self.name,
                touch.gap,
                normal_loads(touch, mechanism.number(1.0)),
                tuple(point_loads(touch, tangent) for tangent in tangents(mechanism, touch)),
                mechanism.value(self.restitution),
                pressed(touch, mechanism.value(self.friction)),
                self._slip_speed(mechanism),
            )
            for name, touch in zip(names, self.touches(mechanism), strict=True)
        )

    def _elastic(self, mechanism: Mechanism, touch: Touch) -> Scalar:
        """k d or k d^1.5, N. As in `vectors.length`, max keeps the derivative finite at d = 0."""
        d = mechanism.call("max", -touch.gap, mechanism.zero)
        force = mechanism.value(self.stiffness) * d
        if self.law == "spring_damper":
            return force
        least = mechanism.number(LEAST_SQUARE)
        return force * mechanism.call("sqrt", mechanism.call("max", d, least))

    def _force(self, mechanism: Mechanism, touch: Touch, gap_rate: Scalar) -> Scalar:
        """The normal force, N, at a rate of the gap, m/s."""
        force, nothing = self._elastic(mechanism, touch), mechanism.zero
        if self.law == "spring_damper" and self.damping != ZERO:
            force = force - mechanism.value(self.damping) * gap_rate
            force = mechanism.call("max", force, nothing)
            return mechanism.call("select", -touch.gap, force, nothing)
        if self.law == "hunt_crossley" and self.dissipation != ZERO:
            factor = mechanism.number(1.5) * mechanism.value(self.dissipation)
            force = force * (mechanism.number(1.0) - factor * gap_rate)
            return mechanism.call("max", force, nothing)
        return force

    def _named_force(self, mechanism: Mechanism, touch: Touch, gap_rate: Scalar) -> Scalar:
        return mechanism.called("F", self._force(mechanism, touch, gap_rate))[0]

    def _slip_speed(self, mechanism: Mechanism) -> Scalar:
        """The slip speed, m/s; without friction, where it has no effect, 1."""
        return (
            mechanism.number(1.0) if self.slip_speed is None else mechanism.value(self.slip_speed)
        )
