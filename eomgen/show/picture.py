"""What is drawn of a mechanism: bodies, joints, effects and traces, as formulas of parameters."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from eomgen.language.formula import ZERO, Constant
from eomgen.language.rewriting import constant, valued
from eomgen.model.bodies import Body
from eomgen.model.frames import from_centre
from eomgen.model.model import Model
from eomgen.scene.appearance import Appearance
from eomgen.scene.effects.elements import (
    WORLD_INDEX,
    Attraction,
    Element,
    Field,
    Support,
    Vector,
    without_formula,
)
from eomgen.scene.joints.base import WORLD, kinds_of
from eomgen.scene.look import Polygon, Rod, Shape, is_drawable
from eomgen.show.body_points import (
    BodyPoints,
    gyration,
    is_drawn,
    points_of,
    typical_length,
)
from eomgen.show.colours import body_colours
from eomgen.show.connections import hidden_rods
from eomgen.show.effect_elements import SYMBOL, elements_of, elements_of_constraints
from eomgen.show.invented import invented_shapes, inventor_of
from eomgen.show.joint_axes import directions_across, joint_axis, slides

MOST_TRACES = 12
"""Greatest number of points whose paths are drawn: more paths would hide everything else."""

SMALLEST = 0.06
"""The size of a picture of bodies that move around something fixed is at least this part of the
region in which they move."""


@dataclass(frozen=True)
class DrawnBody:
    """A body with its shapes, whose points are from its centre of mass."""

    name: str
    color: str
    shapes: tuple[Shape, ...]


@dataclass(frozen=True)
class DrawnJoint:
    """A joint: the indices of its bodies (-1 for the world), its point on each, and in space or of
    a slider its axis, a unit vector of three components in the parent's axes.

    across  at a revolute joint two unit vectors across its axis, in the parent's axes: that from
            which the coordinate is counted, towards the child's centre of mass if that is beside
            the axis, and that towards which it turns
    """

    name: str
    type: str
    parent: int
    at_parent: Vector
    child: int
    at_child: Vector
    axis: Vector | None
    across: tuple[Vector, Vector] | None


@dataclass(frozen=True)
class Trace:
    """A point whose path is drawn."""

    name: str
    body: int
    at: Vector


@dataclass(frozen=True)
class Picture:
    """Everything drawn of a mechanism. The joint with index k is that of body k.

    size  a typical length, m
    """

    bodies: tuple[DrawnBody, ...]
    joints: tuple[DrawnJoint, ...]
    elements: tuple[Element, ...]
    traces: tuple[Trace, ...]
    size: float

    def valued(self, values: Mapping[str, float], t: float = 0.0) -> "Picture":
        """The same with numbers for formulas, at these parameters and a time; nan where undefined.

        Shapes that have no size then are left out, and so are the formulas of fields and wind,
        which may depend on the motion.
        """
        known = {**values, "t": t}
        elements = tuple(without_formula(element) for element in self.elements)
        found = valued(replace(self, elements=elements), known)
        drawn = (replace(b, shapes=tuple(filter(is_drawable, b.shapes))) for b in found.bodies)
        return replace(found, bodies=tuple(drawn))


def picture_of(model: Model, appearance: Appearance, spread: float = 0.0) -> Picture:
    """The picture of a model. Shapes are invented for bodies to which the scene gives none, from
    the model's values of the parameters, and from the size `spread` of the region, m, in which the
    bodies move.
    """
    points = points_of(model)
    size = typical_length(model, points)
    elements = elements_of(model, size)
    lone = all(body.parent < 0 and not is_drawn(gyration(model, body)) for body in model.bodies)
    seen_whole = lone or any(_is_landmark(element) for element in elements)
    inventor = inventor_of(model, size, spread if seen_whole else 0.0)
    if seen_whole and size < SMALLEST * spread:
        size = SMALLEST * spread
        elements = elements_of(model, size)
    colours = body_colours(model)
    bodies = []
    for body, own, colour in zip(model.bodies, points, colours, strict=True):
        own_colour, given = colour, appearance.shapes.get(body.name)
        if given:
            shapes = tuple(shape_from_centre(shape, body.com) for shape in given)
            colour = shapes[0].color or colour
            shapes = (*hidden_rods(model, shapes, own.joints, size, colour), *shapes)
        else:
            shapes = invented_shapes(inventor, body, own, colour)
        painted = tuple(s if s.color else s.replaced(color=own_colour) for s in shapes)
        bodies.append(DrawnBody(body.name, colour, painted))
    joints = tuple(_joint(model, k, body) for k, body in _holders(model))
    elements = (*_supports(model, size), *elements_of_constraints(model, size), *elements)
    return Picture(tuple(bodies), joints, elements, _traces(model, points, bodies), size)


def _is_landmark(element: Element) -> bool:
    """Whether bodies move around something fixed, so that pictures show all of the motion."""
    if isinstance(element, Field):
        return element.center is not None
    return isinstance(element, Attraction) or element.kind == "obstacle"


def shapes_of(model: Model, appearance: Appearance) -> tuple[tuple[Shape, ...], ...]:
    """The shapes of every body at the model's values of the parameters."""
    picture = picture_of(model, appearance).valued(model.defaults)
    return tuple(body.shapes for body in picture.bodies)


def shape_from_centre(shape: Shape, com: Vector) -> Shape:
    """A shape given in a body's frame, from its centre of mass `com`; () if that is the origin."""
    fields: dict[str, object] = {}
    for name in ("center", "start", "end") if com else ():
        if (point := getattr(shape, name, None)) is not None:
            fields[name] = from_centre(point, com)
    if com and isinstance(shape, Polygon):
        fields["points"] = tuple(from_centre(point, com) for point in shape.points)
    return shape.replaced(**fields) if fields else shape


def _holders(model: Model) -> list[tuple[int, Body]]:
    """Each joint as a body that it holds, with the body's index: those of the tree, then loops."""
    index = {WORLD: WORLD_INDEX, **{body.name: k for k, body in enumerate(model.bodies)}}
    loops = [
        (index[loop.joint.child], loop.joint) for loop in model.loops if loop.joint.child != WORLD
    ]
    return [
        *enumerate(model.bodies),
        *(
            (k, replace(model.bodies[k], joint=joint, parent=index[joint.parent]))
            for k, joint in loops
        ),
    ]


def _joint(model: Model, k: int, body: Body) -> DrawnJoint:
    joint, zero = body.joint, (ZERO,) * model.dimensions
    if not joint.holds:
        return DrawnJoint(joint.name, joint.type, WORLD_INDEX, zero, k, zero, None, None)
    return DrawnJoint(
        joint.name,
        joint.type,
        body.parent,
        joint.r_parent,
        k,
        joint.r_child,
        joint_axis(model, body),
        directions_across(model, body),
    )


def _supports(model: Model, size: float) -> list[Support]:
    """A mark where the world holds a joint, and a rail for each slider."""
    found = []
    for k, (_, body) in enumerate(_holders(model)):
        joint = body.joint
        if kinds_of(joint, model.dimensions).count("prismatic") > 1:
            continue
        radius = Constant(SYMBOL * size)
        if slides(joint, model.dimensions):
            axis = joint_axis(model, body)
            assert axis is not None
            found.append(
                Support("rail", k, body.parent, joint.r_parent, radius, axis[: model.dimensions])
            )
        elif body.parent == WORLD_INDEX:
            found.append(Support("base", k, body.parent, joint.r_parent, radius))
    return found


def _traces(model: Model, points: list[BodyPoints], bodies: list[DrawnBody]) -> tuple[Trace, ...]:
    """The paths that are drawn: of the named points, else of the far ends of the last bodies."""
    named = [Trace(point.name, point.body, point.at) for point in model.points]
    if named and len(named) <= MOST_TRACES:
        return tuple(named)
    parents = {body.parent for body in model.bodies}
    last = [k for k in range(len(model.bodies)) if k not in parents]
    kept = np.linspace(0, len(last) - 1, min(len(last), MOST_TRACES)).round().astype(int)
    found = []
    for k in (last[i] for i in kept.tolist()):
        joints, at = points[k].joints, constant(*[0.0] * model.dimensions)
        rods = [shape for shape in bodies[k].shapes if isinstance(shape, Rod)]
        if len(rods) == 1 and len(joints) == 1 and rods[0].start == joints[0]:
            at = rods[0].end
        found.append(Trace(bodies[k].name, k, at))
    return tuple(found)
