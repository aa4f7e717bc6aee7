"""The sketch of a mechanism at its initial pose.

In space it is oblique: y to the right, z up, x towards the lower left at half its length.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from eomgen.derivation.effects import DerivedEffect
from eomgen.derivation.own_names import names_within
from eomgen.derivation.reading import read
from eomgen.derivation.symbols import of_scene
from eomgen.dynamics.tree.mechanism_state import MechanismState
from eomgen.model.bodies import Body
from eomgen.model.model import Model
from eomgen.model.named import Values
from eomgen.scalars.floats import FloatScalars
from eomgen.scene.effects.base import Load
from eomgen.show.drawing import Arc, Dot, Drawing, Item, Label, Line, Point
from eomgen.show.labels import stroke_points, with_clear_labels
from eomgen.show.symbols import BASE, numbers_of

Expr = Any
OBLIQUE = 0.5
ANGLE = math.radians(35.0)
WIDE, HIGH, MARGIN = 520.0, 340.0, 46.0
GROUND = 12.0
"""How far below its joint the ground is."""
MOST_NAMED = 6
"""The most bodies of a sketch whose arms are named."""
SHARED = 14.0
"""Ends of axes as near as this have one letter."""


@dataclass(frozen=True)
class Shape:
    """A body in the plane of the paper, m: centre of mass, own joint, joints of its children, pins
    that close loops.
    """

    body: Body
    centre: Point
    own: Point | None
    others: tuple[tuple[str, Point], ...]
    pins: tuple[Point, ...]
    axes: tuple[Point, ...]
    loaded: tuple[Point, ...]
    """Points off the centre of mass at which effects act."""

    @property
    def joints(self) -> list[Point]:
        """Its own joint, those of its children, and the pins."""
        own = [] if self.own is None else [self.own]
        return [*own, *(p for _, p in self.others), *self.pins]

    @property
    def points(self) -> list[Point]:
        """All of them."""
        return [self.centre, *self.joints, *self.loaded]


class Pose:
    """The mechanism at its initial state, projected onto the paper."""

    def __init__(self, model: Model) -> None:
        self.model = model
        values = Values(
            model.defaults,
            {i.name: 1.0 for i in model.inputs},
            model.initial_q,
            model.initial_v,
            {x.name: x.initial for x in model.extra},
            0.0,
        )
        self.state = MechanismState(model, values, FloatScalars())

    def flat(self, x: Sequence[float]) -> Point:
        """A vector of the world on the paper."""
        if len(x) == 2:
            return (float(x[0]), float(x[1]))
        back = OBLIQUE * x[0]
        return (float(x[1] - back * math.cos(ANGLE)), float(x[2] - back * math.sin(ANGLE)))

    def point(self, body: str, at: Sequence[float]) -> Point:
        """A point of a body on the paper."""
        return self.flat(self.state.position(body, tuple(at)))

    def shapes(self, effects: Sequence[DerivedEffect]) -> tuple[Shape, ...]:
        """All bodies."""
        model, n = self.model, self.model.dimensions
        found = []
        for k, body in enumerate(model.bodies):
            own = None
            if body.joint.holds:
                own = self.point(body.name, self._vector(body.joint.r_child))
            others = tuple(
                (child.joint.name, self.point(body.name, self._vector(child.joint.r_parent)))
                for child in model.bodies
                if child.parent == k and child.joint.holds
            )
            pins = tuple(
                self.point(body.name, self._vector(at))
                for loop in model.loops
                for name, at in (
                    (loop.joint.parent, loop.joint.r_parent),
                    (loop.joint.child, loop.joint.r_child),
                )
                if name == body.name
            )
            axes = tuple(
                self.flat(self.state.outward(body.name, tuple(float(i == j) for j in range(n))))
                for i in range(n)
            )
            centre = self.point(body.name, (0.0,) * n)
            at = dict.fromkeys(load.at for load in _loads_at(body.name, effects) if any(load.at))
            loaded = tuple(self.point(body.name, numbers(model, x)) for x in at)
            found.append(Shape(body, centre, own, others, pins, axes, loaded))
        return tuple(found)

    def _vector(self, parts: Iterable[Any]) -> tuple[float, ...]:
        return tuple(self.model.value(part) for part in parts)


def is_held(model: Model, body: Body) -> bool:
    """Whether a body's joint keeps it from moving freely in all directions."""
    given = {each.position.name for each in model.prescribed}
    kinds = [p.kind for p in body.joint.primitives(model.dimensions)]
    slides = kinds.count("prismatic") == model.dimensions
    return body.joint.holds and not (slides and given.isdisjoint(x.name for x in body.positions))


def _loads_at(body: str, effects: Sequence[DerivedEffect]) -> Iterator[Load]:
    """The loads on a body, and those of unit impulses of its rigid contacts."""
    for derived in effects:
        contacts = (load for contact in derived.contacts for load in contact.normal)
        for load in (*derived.loads, *contacts):
            if isinstance(load, Load) and load.body == body:
                yield load


def mechanism_sketch(model: Model, effects: Sequence[DerivedEffect]) -> Drawing:
    """The mechanism with its frames, arms and angles."""
    pose = Pose(model)
    shapes = pose.shapes(effects)
    origin = pose.flat((0.0,) * model.dimensions)
    every = [p for shape in shapes for p in shape.points]
    if any(shape.own is not None and shape.body.parent < 0 for shape in shapes):
        every.append(origin)
    fit = Fit(every, WIDE, HIGH)
    items: list[Item] = []
    for shape in shapes:
        items += skeleton(shape, fit.at)
    few, names = len(shapes) <= MOST_NAMED, names_within(model)
    if model.dimensions == 2:
        for shape in shapes:
            items += _angle(pose, shapes, shape, fit.at)
    taken = [item.at for item in items if isinstance(item, Label)]
    taken += [fit.at(shape.centre) for shape in shapes]
    for shape in shapes:
        items += _arms(shape, fit.at, taken if few else None, names)
    for shape in shapes:
        items += _marks(shape, fit.at, model)
    if few:
        items += _body_axes(shapes, fit.at)
        items += (Label(_beside_centre(fit.at(x.centre)), x.body.name, "axis") for x in shapes)
    items += _world_axes(pose, _free_corner(items, model.dimensions))
    title = f"{model.title}: the mechanism at its initial pose"
    return with_clear_labels(Drawing(WIDE, HIGH, title, tuple(items)))


class Fit:
    """From the paper's metres to points of a drawing."""

    def __init__(self, points: Sequence[Point], wide: float, high: float) -> None:
        xs, ys = [p[0] for p in points], [p[1] for p in points]
        width, height = max(xs) - min(xs), max(ys) - min(ys)
        room = (wide - 2 * MARGIN, high - 2 * MARGIN)
        scales = [r / size for r, size in zip(room, (width, height), strict=True) if size > 1e-9]
        self.scale = min(scales, default=1.0)
        self._middle = ((max(xs) + min(xs)) / 2, (max(ys) + min(ys)) / 2)
        self._centre = (wide / 2, high / 2)

    def at(self, p: Point) -> Point:
        """A point of the paper in the drawing."""
        return (
            self._centre[0] + self.scale * (p[0] - self._middle[0]),
            self._centre[1] + self.scale * (p[1] - self._middle[1]),
        )


def skeleton(shape: Shape, at: Any) -> Iterator[Item]:
    """Lines from a body's centre of mass to its joints; `at` gives positions in the drawing."""
    ends = [p for p in shape.joints if apart(at(p), at(shape.centre)) > 2]
    for end in ends:
        yield Line((at(shape.centre), at(end)), "body")
    for end in shape.loaded:
        yield Line((at(shape.centre), at(end)), "thin")
        yield Dot(at(end), 1.8, True)
    if not ends:
        x, y = at(shape.centre)
        yield Dot((x, y), 13.0, False, "body")


def _arms(
    shape: Shape, at: Any, taken: list[Point] | None, names: Mapping[str, str]
) -> Iterator[Item]:
    """Arms, with names away from the places that are taken; without names if these are None."""
    arms = [(name, p, "parent") for name, p in shape.others]
    if shape.own is not None:
        arms.append((shape.body.joint.name, shape.own, "child"))
    for name, p, role in arms:
        start, end = at(shape.centre), at(p)
        if apart(start, end) < 16:
            continue
        yield Line((start, end), "arm", arrow=True)
        if taken is not None:
            sides = _beside(start, end, 5.0 * (len(name) + len(role) + 2))
            place = max(sides, key=lambda x: min((apart(x, p) for p in taken), default=0.0))
            taken.append(place)
            yield Label(place, read(sp.Symbol(f"r_{name},{role}"), names), "arm")


def _angle(pose: Pose, shapes: Sequence[Shape], shape: Shape, at: Any) -> Iterator[Item]:
    """The angle of a joint that turns, from the parent's x axis to the body's."""
    model, body = pose.model, shape.body
    kinds = [p.kind for p in body.joint.primitives(2)]
    if "revolute" not in kinds:
        return
    name = body.positions[kinds.index("revolute")].name
    base = shapes[body.parent].axes[0] if body.parent >= 0 else (1.0, 0.0)
    start = math.atan2(base[1], base[0])
    dofs = {c.name: x for c, x in zip(model.coordinates, model.initial_q, strict=True)}
    own = math.atan2(shape.axes[0][1], shape.axes[0][0])
    value = dofs.get(name, 0.0)
    turn = math.remainder(own - start, 2 * math.pi)
    if abs(value) > 1e-3 and turn * value < 0 and abs(abs(turn) - math.pi) < 0.2:
        turn += math.copysign(2 * math.pi, value)
    centre = at(shape.own if shape.own is not None else shape.centre)
    radius = 34.0 if shape.own is None else 27.0
    reach = radius + 14
    for direction in (start, start + turn):
        end = (centre[0] + reach * math.cos(direction), centre[1] + reach * math.sin(direction))
        yield Line((centre, end), "thin")
    if abs(turn) > 0.02:
        yield Arc(centre, radius, start, start + turn, "angle", arrow=abs(turn) > 0.25)
    middle = start + turn / 2
    away = radius + 14
    label = (centre[0] + away * math.cos(middle), centre[1] + away * math.sin(middle))
    yield Label(label, sp.Symbol(name), "angle")


def _marks(shape: Shape, at: Any, model: Model) -> Iterator[Item]:
    """Its centre of mass, its own joint with what holds it, and its pins."""
    yield Dot(at(shape.centre), 3.2, True)
    if shape.own is not None and is_held(model, shape.body):
        own = at(shape.own)
        if shape.body.parent < 0:
            yield from _ground(own)
        yield Dot(own, 4.2, False, "arm")
    for pin in shape.pins:
        yield Dot(at(pin), 4.2, False, "arm")


def _beside_centre(p: Point) -> Point:
    """Where the name of a body is looked for first."""
    return (p[0] - 11, p[1] - 12)


def _body_axes(shapes: Sequence[Shape], at: Any) -> Iterator[Item]:
    """The axes of bodies; of ends that are near each other only one has the letter."""
    named: list[tuple[str, Point]] = []
    for shape in shapes:
        x, y = at(shape.centre)
        for letter, axis in zip("xyz", shape.axes, strict=False):
            if math.hypot(*axis) <= 0.15:
                continue
            yield Line(((x, y), (x + 24 * axis[0], y + 24 * axis[1])), "axis", arrow=True)
            tip = (x + 34 * axis[0], y + 34 * axis[1])
            if all(other != letter or apart(tip, p) > SHARED for other, p in named):
                named.append((letter, tip))
                yield Label(tip, sp.Symbol(letter), "axis")


def _ground(p: Point) -> Iterator[Item]:
    """What holds a joint on the world."""
    for line in BASE:
        down = (numbers_of(point) for point in line.points)
        yield Line(tuple((p[0] + GROUND * y, p[1] - GROUND * x) for x, y in down), "axis")


def _free_corner(items: Iterable[Item], dimensions: int) -> Point:
    """Where the world's axes start: in the corner in which least is drawn, first the lower left."""
    drawn = stroke_points(items)[:, :2]
    aside, up = (30.0, 26.0) if dimensions == 2 else (40.0, 34.0)
    corners = [(x, y) for y in (up, HIGH - up - 26) for x in (aside, WIDE - aside - 26)]
    return min(corners, key=lambda p: int((np.abs(drawn - p - 12).max(axis=1) < 44).sum()))


def _world_axes(pose: Pose, corner: Point) -> Iterator[Item]:
    for i in range(pose.model.dimensions):
        unit = pose.flat(tuple(float(i == j) for j in range(pose.model.dimensions)))
        end = (corner[0] + 26 * unit[0], corner[1] + 26 * unit[1])
        yield Line((corner, end), "axis", arrow=True)
        tip = (corner[0] + 37 * unit[0], corner[1] + 37 * unit[1])
        yield Label(tip, sp.Symbol("xyz"[i]), "axis")


def numbers(model: Model, at: Sequence[Expr]) -> tuple[float, ...]:
    """A point in body axes by its symbols' values."""
    values = {of_scene(name).name: value for name, value in model.defaults.items()}
    return tuple(float(sp.N(x.subs({s: values[s.name] for s in x.free_symbols})))
                 for x in at)  # fmt: skip


def apart(a: Point, b: Point) -> float:
    """The distance of two points of a drawing."""
    return math.hypot(a[0] - b[0], a[1] - b[1])


def _beside(start: Point, end: Point, width: float) -> list[Point]:
    """The places for a label of a width on both sides of the middle of a line."""
    length = apart(start, end) or 1.0
    nx, ny = -(end[1] - start[1]) / length, (end[0] - start[0]) / length
    distance = 12.0 + abs(nx) * width / 2
    x, y = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2
    return [(x + s * distance * nx, y + s * distance * ny) for s in (1, -1)]
