"""Soft and rigid contact of bodies with a plane, with a sphere or with each other."""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations, product
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar

from pydantic import Field, model_validator

from eomgen.base.errors import SceneError
from eomgen.language.base import Identifier
from eomgen.language.conditions import Condition, a_part, are_zero, can_meet, not_negative
from eomgen.language.formula import ZERO, Apply, Constant, Formula
from eomgen.language.quantity import Numbers, Quantity, Vector, quantity, with_components
from eomgen.language.rewriting import constant, difference, sum_of, times
from eomgen.scalars.exact import direction
from eomgen.scene.effects.base import Contact, Load, Mechanism, Scalar
from eomgen.scene.effects.base import Vector as Components
from eomgen.scene.effects.bodies import OnBodies, wrong
from eomgen.scene.effects.contact_shapes import ContactShape, between_count
from eomgen.scene.effects.elements import Element, Layout, Round, Touching
from eomgen.scene.effects.elements import Plane as PlaneElement
from eomgen.scene.effects.nearest import between
from eomgen.scene.effects.touching import (
    Plane,
    Solid,
    Touch,
    gap_rate_and_slip,
    gap_rate_of,
    merged,
    normal_loads,
    on_plane,
    point_loads,
    tangents,
)
from eomgen.scene.effects.vectors import LEAST_SQUARE, dot
from eomgen.scene.joints.base import WORLD

LAWS = {
    "spring_damper": ("stiffness", "damping", "allow_active"),
    "hunt_crossley": ("stiffness", "dissipation", "allow_active"),
    "impact": ("restitution",),
}
"""The keys of each law in addition to the common ones; the first is required."""
AGAINST = {
    "plane": ("normal", "offset", "corners", "other"),
    "ball": ("other_radius", "other_at", "other"),
    "each_other": ("except_pairs",),
}
"""The keys of contact with each of these, in addition to the common ones."""


Of = TypeVar("Of")
MOST_SHAPES = 1000
MOST_CORNERS = 400
"""More corners of boxes in contact than these are not drawn."""


class BodyContact(OnBodies):
    """Contact of spheres (circles in the plane), points, and corners of boxes.

    Each body of `body` or `bodies` has a sphere of `radius` at `at`, or each of the named `points`
    is the centre of one. `radii` gives single bodies another radius; a sphere of radius 0 is a
    point. With `corners`, half sizes along the body's axes, the corners of a box at `at` are used
    instead, rounded by the radius. These touch

    - `against = "plane"`: the half-space n·x <= `offset`, with n along `normal`, by default up;
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
    naming: ClassVar[tuple[str, ...]] = (*OnBodies.naming, "shapes")
    body_fields: ClassVar[tuple[str, ...]] = ("body", "bodies", "radii")
    anchor_fields: ClassVar[tuple[str, ...]] = ("other", "shapes")
    vector_fields: ClassVar[tuple[str, ...]] = ("at", "corners", "other_at")

    points_of: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "at": ("body", "bodies"),
        "other_at": ("other",),
    }

    type: Literal["contact"]
    law: Literal["spring_damper", "hunt_crossley", "impact"]
    against: Literal["plane", "ball", "each_other"] = "plane"
    radius: Quantity = quantity("m", "radius", "nonnegative", default=ZERO, validate_default=False)
    radii: dict[Identifier, Quantity] = quantity(
        "m", "radius", "nonnegative", default={}, validate_default=False
    )
    corners: Vector | None = quantity("m", "half sizes of the box", "positive", default=None)
    normal: Numbers = Field(
        default=(),
        validate_default=False,
        description="direction of the outward normal of the plane",
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
    shapes: Annotated[dict[Identifier, ContactShape], Field(max_length=MOST_SHAPES)] = Field(
        default={}, description="shapes that touch, by name, in place of bodies"
    )
    except_pairs: tuple[tuple[Identifier, Identifier], ...] = Field(
        default=(), description="pairs of bodies whose shapes do not touch each other"
    )

    @model_validator(mode="after")
    def _keys_fit(self) -> Self:
        given = self.model_fields_set
        choices = (("law", self.law, LAWS), ("against", self.against, AGAINST))
        for choice, chosen, all_keys in choices:
            takes = all_keys[chosen]
            for key in dict.fromkeys(key for keys in all_keys.values() for key in keys):
                if key in given and key not in takes:
                    known = f"it takes {', '.join(takes)}" if takes else "leave it out"
                    raise wrong(key, f"does not belong to {choice} '{chosen}'; {known}")
        needed = LAWS[self.law][0]
        if needed not in given:
            raise wrong(needed, f"is missing; law '{self.law}' needs it")
        if "friction" in given and self.slip_speed is None:
            raise wrong("slip_speed", "is missing; it smooths friction; give a small value in m/s")
        if "friction" not in given and self.slip_speed is not None:
            raise wrong("slip_speed", "smooths friction, which is missing; give both")
        return self

    @model_validator(mode="after")
    def _shapes_fit(self) -> Self:
        for key in ("at", "radius", "radii", "corners") if self.shapes else ():
            if key in self.model_fields_set:
                raise wrong(key, "each of the shapes has its own; leave it out")
        for name, shape in self.shapes.items():
            if shape.body == self.other and self.against != "each_other":
                what = "does not move on" if self.other == WORLD else "cannot touch"
                raise wrong(f"shapes.{name}.body", f"'{shape.body}' {what} itself; name another")
            if self.against != "plane" and (shape.semi_axes or shape.vertices):
                raise wrong(f"shapes.{name}", "touches planes only; give a sphere, capsule or box")
        bodies = {shape.body for shape in self.shapes.values()}
        for i, pair in enumerate(self.except_pairs):
            for name in pair:
                if name not in bodies:
                    raise wrong(f"except_pairs[{i}]", f"'{name}' has no shape here; leave it out")
        return self

    @model_validator(mode="after")
    def _bodies_fit(self) -> Self:
        listed = self.bodies if isinstance(self.bodies, tuple) else (self.body,)
        listed = tuple(self.shapes) or listed
        if self.points is not None and self.against == "each_other":
            raise wrong("points", "may be on one body; give bodies instead")
        if self.points is not None and self.radii:
            raise wrong("radii", "named points have one radius; give each effect its own points")
        if self.against == "each_other" and len(listed) < 2 and self.bodies != "all":
            key = "body" if self.bodies is None else "bodies"
            if self.shapes:
                raise wrong("shapes", "one shape has no other to touch; give two or more")
            raise wrong(key, "one body has no other to touch; give two or more in bodies")
        if self.other != WORLD and self.other in listed:
            raise wrong("other", f"'{self.other}' cannot touch itself; name another body or world")
        for name in self.radii:
            if name not in listed and self.bodies != "all":
                raise wrong(f"radii.{name}", "is not one of the bodies in contact; leave it out")
        return self

    def checked(self, dimensions: int, location: str) -> Self:
        """Set the default normal; check that it is not zero, and the shapes."""
        up = (0.0,) * (dimensions - 1) + (1.0,)
        normal = with_components(self.normal or up, 0.0, dimensions, f"{location}.normal")
        if not any(normal):
            raise SceneError(f"{location}.normal: has no direction; give one that is not zero")
        shapes = {
            name: shape.checked(dimensions, f"{location}.shapes.{name}")
            for name, shape in self.shapes.items()
        }
        return self.replaced(normal=normal, shapes=shapes)

    def conditions(self, location: str) -> Iterator[Condition]:
        """Radii are not negative, two points do not touch, restitution is from 0 to 1."""
        radii = {f"radii.{name}": radius for name, radius in self.radii.items()}
        radii |= {"radius": self.radius, "other_radius": self.other_radius}
        radii |= {f"shapes.{name}.radius": shape.radius for name, shape in self.shapes.items()}
        for key, radius in radii.items():
            yield not_negative(f"{location}.{key}", radius, "m")
        yield a_part(f"{location}.restitution", self.restitution)
        listed = self.points or (self.bodies if isinstance(self.bodies, tuple) else (self.body,))
        if self.bodies == "all" and self.radii:
            return  # the bodies without a radius of their own are not known here
        own = [radii.get(f"radii.{name}", self.radius) for name in listed]
        own = [shape.radius for shape in self.shapes.values()] or own
        if self.against == "ball":
            for radius in dict.fromkeys(own):
                yield can_meet(f"{location}.other_radius", (radius, self.other_radius))
        if self.against == "each_other":
            both = (*own, self.radius) if self.bodies == "all" else own
            if self.shapes:
                radii = {name: shape.radius for name, shape in self.shapes.items()}
                for a, b in self._pairs(tuple(radii)):
                    yield can_meet(f"{location}.shapes.{b}.radius", (radii[a], radii[b]))
                return
            yield can_meet(f"{location}.radius", both)

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
            force = self._named_force(mechanism, touch, gap_rate)
            speed = self._slip_speed(mechanism)
            size = mechanism.call("sqrt", dot(slip, slip) + speed * speed)
            drag = mechanism.value(self.friction) * force / size
            pairs = zip(touch.normal, slip, strict=True)
            found += point_loads(touch, tuple(force * n - drag * u for n, u in pairs))
        yield from merged(found)

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

    def elements(self, layout: Layout) -> Iterator[Element]:
        """The plane or the ball that it is against, and spheres, wheels or corners of bodies."""
        other = layout.bodies[self.other]
        if self.against == "plane":
            normal = constant(*map(float, direction(self.normal)))
            yield PlaneElement(self.name, other, normal, self.offset)
        if self.against == "ball":
            yield Round("ball", self.name, other, self.other_at, self.other_radius)
        names = tuple(layout.bodies)[1:]
        for shape in self.shapes.values():
            for at in shape.places(layout.dimensions):
                yield Round("ball", self.name, layout.bodies[shape.body], at, shape.radius)
        for k, at in self.points_drawn(layout):
            radius = self.radii.get(names[k], self.radius)
            if self.corners is not None:
                if 2 ** len(at) * len(names) > MOST_CORNERS:
                    return
                for signs in product((-1.0, 1.0), repeat=len(at)):
                    half = tuple(times(*pair) for pair in zip(signs, self.corners, strict=True))
                    yield Round("ball", self.name, k, sum_of(at, half), radius)
                continue
            axis = layout.wheel_axis(k, at)
            kind: Literal["ball", "wheel"] = "ball" if axis is None else "wheel"
            yield Round(kind, self.name, k, at, radius, axis=axis or None)

    def from_centres(self, centres: Mapping[str, Vector]) -> Mapping[str, Any]:
        """The offset of a plane, which the frame of `other` gives, from its centre of mass; and the
        points of shapes.
        """
        if self.shapes:
            shapes = {name: shape.from_centre(centres) for name, shape in self.shapes.items()}
            return {"shapes": shapes, **self.replaced(shapes={}).from_centres(centres)}
        if self.against != "plane" or self.other not in centres:
            return {}
        centre, offset = centres[self.other], self.offset
        normal = self.normal or tuple(float(i == len(centre) - 1) for i in range(len(centre)))
        length = math.hypot(*normal)
        for n, c in zip(normal, centre, strict=True):
            if n:
                part = c if n == length else Apply("*", (Constant(n / length), c))
                offset = difference(offset, part)
        return {"offset": offset}

    def points_drawn(self, layout: Layout) -> Iterator[tuple[int, Vector]]:
        """The points of bodies that may touch."""
        if self.points is not None:
            yield from map(layout.point, self.points)
            return
        for body in self._in_contact(tuple(layout.bodies)[1:]):
            yield layout.bodies[body], self.at

    def shapes_in_contact(self, bodies: Sequence[str]) -> Iterator[Touching]:
        """Of each body that it names, and its shapes."""
        for shape in self.shapes.values():
            yield from shape.touching(len(self.normal))
        for body in self._in_contact(bodies) if self.points is None else ():
            yield Touching(body, self.at, self.radii.get(body, self.radius), self.corners)

    def lengths(self) -> tuple[Formula, ...]:
        """Twice the diameter of its spheres."""
        return (times(4.0, self.radius),)

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
        """Names of rigid contacts: `<effect>_<body>` or `<effect>_<point>`, then the number of the
        corner or the name of the other body if there is one.
        """
        if self.law != "impact":
            return ()
        touching = self.points or tuple(self.shapes) or self._in_contact(bodies)
        counts, n = dict[str, int](), len(self.normal)
        if self.against == "each_other":
            for a, b in self._pairs(touching):
                pair = (self.shapes[a], self.shapes[b]) if self.shapes else ()
                counts[f"{a}_{b}"] = between_count(*pair, n) if pair else 1
        else:
            for name in touching:
                own = self.shapes.get(name)
                if own is None:
                    counts[name] = 2 ** len(self.corners or ())
                elif self.against == "ball":
                    counts[name] = between_count(own, ContactShape(body=WORLD), n)
                else:
                    counts[name] = own.count(n)
        return tuple(
            f"{self.name}_{name}{f'_{k + 1}' * (count > 1)}"
            for name, count in counts.items()
            for k in range(count)
        )

    def contacts(self, mechanism: Mechanism) -> tuple[Contact, ...]:
        """For law "impact" a contact for each point, sphere, corner or pair of spheres."""
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
                mechanism.value(self.friction),
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

    def _in_contact(self, bodies: Sequence[str]) -> list[str]:
        """Names of the bodies whose spheres or corners may touch."""
        if self.body is not None or self.shapes:
            return [self.body] if self.body else []
        listed = self.bodies if isinstance(self.bodies, tuple) else bodies
        return [body for body in listed if body != self.other]

    def _solids(self, mechanism: Mechanism) -> Iterator[Solid]:
        """What touches: its shapes, or the spheres or boxes of bodies."""
        for shape in self.shapes.values():
            yield shape.solid(mechanism)
        if self.shapes:
            return
        edges = list[Components]()
        for k, size in enumerate(self.corners or ()):
            zeros = [mechanism.zero] * mechanism.dimensions
            edges.append((*zeros[:k], mechanism.value(size), *zeros[k + 1 :]))
        for body, at in self.loaded_points(mechanism):
            if body != self.other:
                radius = mechanism.value(self.radii.get(body, self.radius))
                yield Solid(body, at, radius, edges=tuple(edges))

    def _pairs(self, touching: Sequence[Of]) -> Iterator[tuple[Of, Of]]:
        """Every two of those that touch, but for shapes of one body, or of two that do not."""
        bodies = [shape.body for shape in self.shapes.values()]
        for i, j in combinations(range(len(touching)), 2):
            pair = bodies[i : i + 1] + bodies[j : j + 1]
            if not pair or (
                pair[0] != pair[1] and not {*self.except_pairs} & {(*pair,), (*pair[::-1],)}
            ):
                yield touching[i], touching[j]

    def touches(self, mechanism: Mechanism) -> Iterator[Touch]:
        solids = list(self._solids(mechanism))
        if self.against == "each_other":
            for pair in self._pairs(solids):
                yield from between(mechanism, *pair)
            return
        if self.against == "ball":
            centre = tuple(mechanism.value(part) for part in self.other_at)
            ball = Solid(self.other, centre, mechanism.value(self.other_radius))
            for solid in solids:
                yield from between(mechanism, solid, ball)
            return
        zeros = (mechanism.zero,) * mechanism.dimensions
        normal = tuple(mechanism.number(x) for x in direction(self.normal))
        plane = Plane(self.other, zeros, normal, mechanism.value(self.offset))
        for solid in solids:
            yield from on_plane(mechanism, plane, solid)
