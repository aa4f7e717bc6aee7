"""Where contacts are: of bodies with a plane, with a sphere or with each other."""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations, product
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar

from pydantic import Field, model_validator

from eomgen.base.errors import SceneError
from eomgen.language.base import Identifier
from eomgen.language.conditions import Condition, can_meet, not_negative
from eomgen.language.formula import ZERO, Apply, Constant, Formula, names_in
from eomgen.language.quantity import Numbers, Quantity, Vector, quantity, with_components
from eomgen.language.rewriting import constant, difference, sum_of, times
from eomgen.scalars.exact import direction
from eomgen.scene.effects.base import Mechanism
from eomgen.scene.effects.base import Vector as Components
from eomgen.scene.effects.bodies import OnBodies, wrong
from eomgen.scene.effects.contact_shapes import ContactShape, between_count
from eomgen.scene.effects.elements import Element, Layout, Round, Touching
from eomgen.scene.effects.elements import Heights as HeightsElement
from eomgen.scene.effects.elements import Plane as PlaneElement
from eomgen.scene.effects.nearest import between
from eomgen.scene.effects.touching import Heights, Plane, Solid, Touch, on_heights, on_plane
from eomgen.scene.joints.base import WORLD

AGAINST = {
    "plane": ("normal", "offset", "corners", "other"),
    "heights": ("height", "corners"),
    "ball": ("other_radius", "other_at", "other"),
    "each_other": ("pairs", "except_pairs"),
}
"""The keys of contact with each of these, in addition to the common ones."""


Of = TypeVar("Of")
MOST_SHAPES = 1000
MOST_PAIRS = 10_000
MOST_CORNERS = 400
"""More corners of boxes in contact than these are not drawn."""


class ContactGeometry(OnBodies):
    """Where bodies may touch: their shapes, and what these are against."""

    naming: ClassVar[tuple[str, ...]] = (*OnBodies.naming, "shapes")
    choices: ClassVar[Mapping[str, Mapping[str, tuple[str, ...]]]] = {"against": AGAINST}
    """For each key with a choice the keys that belong to each of its values."""
    body_fields: ClassVar[tuple[str, ...]] = ("body", "bodies", "radii")
    anchor_fields: ClassVar[tuple[str, ...]] = ("other", "shapes")
    vector_fields: ClassVar[tuple[str, ...]] = ("at", "corners", "other_at")

    points_of: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "at": ("body", "bodies"),
        "other_at": ("other",),
    }

    against: Literal["plane", "heights", "ball", "each_other"] = "plane"
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
    height: Quantity = quantity(
        "m", "height of the ground", sees=("x", "y"), default=ZERO, validate_default=False
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
    shapes: Annotated[dict[Identifier, ContactShape], Field(max_length=MOST_SHAPES)] = Field(
        default={}, description="shapes that touch, by name, in place of bodies"
    )
    pairs: Annotated[tuple[tuple[Identifier, Identifier], ...], Field(max_length=MOST_PAIRS)] = (
        Field(default=(), description="pairs of shapes that touch each other, in place of all")
    )
    except_pairs: tuple[tuple[Identifier, Identifier], ...] = Field(
        default=(), description="pairs of bodies whose shapes do not touch each other"
    )

    @model_validator(mode="after")
    def _choices_fit(self) -> Self:
        for choice, all_keys in self.choices.items():
            chosen = getattr(self, choice)
            takes = all_keys[chosen]
            for key in dict.fromkeys(key for keys in all_keys.values() for key in keys):
                if key in self.model_fields_set and key not in takes:
                    known = f"it takes {', '.join(takes)}" if takes else "leave it out"
                    raise wrong(key, f"does not belong to {choice} '{chosen}'; {known}")
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
            if self.against == "heights" and shape.semi_axes:
                raise wrong(f"shapes.{name}", "touches planes only; give another shape")
            if self.against not in ("plane", "heights") and (shape.semi_axes or shape.vertices):
                raise wrong(f"shapes.{name}", "touches planes only; give a sphere, capsule or box")
        for i, pair in enumerate(self.pairs):
            for name in pair:
                if name not in self.shapes:
                    raise wrong(f"pairs[{i}]", f"'{name}' is no shape here; name two of them")
            if self.shapes[pair[0]].body == self.shapes[pair[1]].body:
                raise wrong(f"pairs[{i}]", "both are of one body; name two of different bodies")
        if self.pairs and self.except_pairs:
            raise wrong("except_pairs", "is given in addition to 'pairs'; give one of them")
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
        if dimensions == 2 and "y" in names_in(self.height):
            raise SceneError(f"{location}.height: depends on y; in the plane it is a formula of x")
        shapes = {
            name: shape.checked(dimensions, f"{location}.shapes.{name}")
            for name, shape in self.shapes.items()
        }
        return self.replaced(normal=normal, shapes=shapes)

    def conditions(self, location: str) -> Iterator[Condition]:
        """Radii are not negative, and two points do not touch."""
        radii = {f"radii.{name}": radius for name, radius in self.radii.items()}
        radii |= {"radius": self.radius, "other_radius": self.other_radius}
        radii |= {f"shapes.{name}.radius": shape.radius for name, shape in self.shapes.items()}
        for key, radius in radii.items():
            yield not_negative(f"{location}.{key}", radius, "m")
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

    def elements(self, layout: Layout) -> Iterator[Element]:
        """The plane or the ball that it is against, and spheres, wheels or corners of bodies."""
        other = layout.bodies[self.other]
        if self.against == "plane":
            normal = constant(*map(float, direction(self.normal)))
            yield PlaneElement(self.name, other, normal, self.offset)
        if self.against == "heights":
            yield HeightsElement(self.name, self.height)
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

    def touch_names(self, bodies: Sequence[str]) -> tuple[str, ...]:
        """Names of its touches: `<effect>_<body>` or `<effect>_<point>`, then the number of the
        corner or the name of the other body if there is one.
        """
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
        """The pairs of those that touch: by default every two, but for shapes of one body, or of
        two that do not.
        """
        order = {name: i for i, name in enumerate(self.shapes)}
        for a, b in self.pairs:
            yield touching[order[a]], touching[order[b]]
        bodies = [shape.body for shape in self.shapes.values()]
        for i, j in combinations(range(len(touching)), 2) if not self.pairs else ():
            pair = bodies[i : i + 1] + bodies[j : j + 1]
            if not pair or (
                pair[0] != pair[1] and not {*self.except_pairs} & {(*pair,), (*pair[::-1],)}
            ):
                yield touching[i], touching[j]

    def touches(self, mechanism: Mechanism) -> Iterator[Touch]:
        """Where it may act: at each point, sphere, corner or pair of spheres."""
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
        if self.against == "heights":
            heights = Heights.of(self.height, mechanism.dimensions)
            for solid in solids:
                yield from on_heights(mechanism, heights, solid)
            return
        zeros = (mechanism.zero,) * mechanism.dimensions
        normal = tuple(mechanism.number(x) for x in direction(self.normal))
        plane = Plane(self.other, zeros, normal, mechanism.value(self.offset))
        for solid in solids:
            yield from on_plane(mechanism, plane, solid)
