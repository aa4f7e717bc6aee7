"""The points of bodies that shapes should reach, and the typical lengths of a mechanism."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from statistics import median

from eomgen.language.formula import Formula
from eomgen.model.bodies import Body
from eomgen.model.model import Model
from eomgen.scene.constraints import ConstraintTable
from eomgen.scene.effects.base import EffectTable
from eomgen.scene.effects.elements import Disc, Link, Round, Touching
from eomgen.scene.joints.base import WORLD
from eomgen.show.effect_elements import discs_of_constraints, elements_of_constraints

DRAWN = (1e-90, 1e90)
"""Only lengths between these, m, are drawn."""

Vector = tuple[Formula, ...]


@dataclass
class BodyPoints:
    """Points of a body from its centre of mass, without repeats, and its sizes in contacts.

    joints   points of joints
    carries  whether another body is joined at its centre of mass
    others   points at which effects act or that have a name
    spheres  centre and radius of its spheres in contacts
    boxes    centre, half sizes and rounding of its boxes in contacts
    solids   its other shapes in contacts
    discs    its discs that ropes, belts or gears turn
    """

    joints: list[Vector] = field(default_factory=list)
    others: list[Vector] = field(default_factory=list)
    carries: bool = False
    spheres: list[tuple[Vector, Formula]] = field(default_factory=list)
    boxes: list[tuple[Vector, Vector, Formula]] = field(default_factory=list)
    solids: list[Touching] = field(default_factory=list)
    discs: list[Disc] = field(default_factory=list)


def points_of(model: Model) -> list[BodyPoints]:
    """The points of every body."""
    found = [BodyPoints() for _ in model.bodies]
    index = {body.name: k for k, body in enumerate(model.bodies)}
    seen: set[tuple[int, tuple[float, ...]]] = set()

    def add(body: str, r: Vector, kind: str) -> None:
        at = tuple(map(model.value, r))
        if body != WORLD and r and (index[body], at) not in seen and _drawn_or_zero(at):
            seen.add((index[body], at))
            getattr(found[index[body]], kind).append(r)

    for body in model.bodies:
        add(body.name, body.joint.r_child, "joints")
        add(body.joint.parent, body.joint.r_parent, "joints")
        if body.parent >= 0 and not length_of(model, body.joint.r_parent):
            found[body.parent].carries = True
    for loop in model.loops:
        add(loop.joint.child, loop.joint.r_child, "joints")
        add(loop.joint.parent, loop.joint.r_parent, "joints")
    names = (*index, WORLD)  # -1 is the world
    for element in elements_of_constraints(model, 1.0):
        if isinstance(element, Link):
            for end in (element.start, element.end):
                add(names[end.body], end.at, "others")
        elif isinstance(element, Round) and element.body >= 0:
            found[element.body].spheres.append((element.at, element.radius))
    for disc in discs_of_constraints(model, 1.0):
        found[index[disc.body]].discs.append(disc)
    for point in model.points:
        add(model.bodies[point.body].name, point.at, "others")
    for effect in model.effects:
        _add_sizes(model, found, index, effect)
        for key, naming in effect.points_of.items():
            for name in effect.named(naming, tuple(index)):
                add(name, getattr(effect, key), "others")
    return found


def _add_sizes(
    model: Model, found: list[BodyPoints], index: Mapping[str, int], effect: EffectTable
) -> None:
    """Note the spheres or boxes of the bodies of a contact; points and repeats are left out."""
    for shape in effect.shapes_in_contact(tuple(index)):
        own = found[index[shape.body]]
        if shape.end or shape.semi_axes or shape.orientation_deg:
            own.solids.append(shape)
        elif shape.corners is not None:
            if (box := (shape.at, shape.corners, shape.radius)) not in own.boxes:
                own.boxes.append(box)
        elif is_drawn(model.value(shape.radius)) and shape.at not in dict(own.spheres):
            own.spheres.append((shape.at, shape.radius))


def length_of(model: Model, vector: Vector) -> float:
    """The length of a vector at the scene's parameters, m."""
    return math.hypot(*map(model.value, vector))


def typical_length(model: Model, points: list[BodyPoints]) -> float:
    """A typical length of the mechanism, m.

    That of links, from joint to joint or from joint to centre of mass; else of what effects name;
    else twice a radius of gyration; else a part of the distances between bodies; else 1.
    """
    lengths = [_span(model, own.joints) for own in points]
    found = [length for length in lengths if is_drawn(length)]
    if not found:
        found = [x for x in _lengths_in_effects(model, points) if is_drawn(x)]
    if not found:
        found = [2 * x for body in model.bodies if is_drawn(x := gyration(model, body))]
    if not found:
        pairs = zip(model.coordinates, model.initial_q, strict=False)
        far = [abs(value) for coordinate, value in pairs if coordinate.unit == "m"]
        found = [0.3 * x for x in far if is_drawn(x)]
    return median(found) if found else 1.0


def gyration(model: Model, body: Body) -> float:
    """The largest radius of gyration about an axis through the centre of mass, m."""
    mass = model.value(body.mass)
    moment = max(map(model.value, body.inertia_com[:3]))
    return math.sqrt(moment / mass) if mass > 0 and moment > 0 else 0.0


def is_drawn(length: float) -> bool:
    """Whether a length is neither 0 nor too small or large for a picture."""
    return DRAWN[0] < length < DRAWN[1]


def _drawn_or_zero(point: tuple[float, ...]) -> bool:
    length = math.hypot(*point)
    return length == 0 or is_drawn(length)


def _span(model: Model, joints: list[Vector]) -> float:
    """The greatest distance of a body's joints from each other and from the centre of mass, m."""
    places = [(0.0,) * model.dimensions, *(tuple(map(model.value, r)) for r in joints)]
    return max(math.dist(a, b) for a in places for b in places)


def _lengths_in_effects(model: Model, points: list[BodyPoints]) -> list[float]:
    found = [length_of(model, r) for own in points for r in own.others]
    listed = (c for c in model.constraints if isinstance(c, ConstraintTable))
    return found + [model.value(x) for e in (*model.effects, *listed) for x in e.lengths()]
