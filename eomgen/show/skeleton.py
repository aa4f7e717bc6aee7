"""Shapes for bodies to which the scene gives none: a box, and rods from it to their joints."""

import math
from statistics import median

from eomgen.language.formula import Formula
from eomgen.model.model import Model
from eomgen.scene.appearance import Appearance
from eomgen.scene.joints import Free
from eomgen.scene.joints.base import WORLD
from eomgen.scene.look import Box, Rod, Shape, from_centre

BOX, ROD = 0.25, 0.07
"""Side of a box and width of a rod, relative to the length of a rod."""
DRAWN = (1e-90, 1e90)
"""Only lengths between these, m, are drawn; other bodies appear as dots."""


def shapes_of(model: Model, appearance: Appearance) -> tuple[tuple[Shape, ...], ...]:
    """The shapes of every body, its own or a skeleton, at the scene's parameters."""
    arms = _arms(model)
    own = _size(model, arms)
    size = appearance.camera.height / 10 if own is None else own
    return tuple(
        tuple(from_centre(shape, [*map(model.value, body.com)]) for shape in own_shapes)
        if (own_shapes := appearance.shapes.get(body.name))
        else _skeleton(arms[body.name], model.dimensions, size)
        for body in model.bodies
    )


def _arms(model: Model) -> dict[str, list[tuple[float, ...]]]:
    """For each body the points of its joints outside its centre of mass, body axes, m."""
    arms: dict[str, list[tuple[float, ...]]] = {body.name: [] for body in model.bodies}

    def add(body: str, r: tuple[Formula, ...]) -> None:
        point = tuple(map(model.value, r))
        if body != WORLD and _drawn(math.hypot(*point)) and point not in arms[body]:
            arms[body].append(point)

    for body in model.bodies:
        if not isinstance(body.joint, Free):
            add(body.name, body.joint.r_child)
            add(body.joint.parent, body.joint.r_parent)
    for loop in model.loops:
        add(loop.joint.child, loop.joint.r_child)
        add(loop.joint.parent, loop.joint.r_parent)
    return arms


def _size(model: Model, arms: dict[str, list[tuple[float, ...]]]) -> float | None:
    """A typical length, m: of the arms, else twice the radius of gyration; None without either."""
    lengths = [math.hypot(*point) for points in arms.values() for point in points]
    if lengths:
        return median(lengths)
    masses = [model.value(body.mass) for body in model.bodies]
    moments = [max(map(model.value, body.inertia_com)) for body in model.bodies]
    gyrations = [math.sqrt(i / m) for i, m in zip(moments, masses, strict=True) if i > 0 and m > 0]
    return 2.0 * median(gyrations) if gyrations else None


def _skeleton(arms: list[tuple[float, ...]], dimensions: int, size: float) -> tuple[Shape, ...]:
    if not _drawn(size):
        return ()
    centre = (0.0,) * dimensions
    rods = [Rod(type="rod", start=centre, end=point, width=ROD * size) for point in arms]
    return (Box(type="box", size=(BOX * size,) * dimensions), *rods)


def _drawn(length: float) -> bool:
    return DRAWN[0] < length < DRAWN[1]
