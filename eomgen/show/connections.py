"""Rods inside the shapes of a scene that keep bodies and their joints together.

Shapes with numbers do not follow the parameters of a run or the sliders of a page. A rod from a
body's centre of mass to a joint does; while the shapes reach the joint, it is hidden in them.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from eomgen.language.formula import Constant, Formula, names_in
from eomgen.language.rewriting import constant, valued
from eomgen.model.model import Model
from eomgen.scene.look import Rod, Shape
from eomgen.show.body_points import Vector, is_drawn, length_of
from eomgen.show.outlines import extent_points

THIN = 0.03
"""Width of a rod relative to the mechanism's size."""
NEAR = 0.1
"""A joint may be beyond the bounds of the shapes by this much, relative to the same."""


PINS = ("revolute", "universal", "ball")
"""Joints that hold a point."""


def hidden_rods(
    model: Model, shapes: Sequence[Shape], joints: Sequence[Vector], size: float, color: str
) -> Iterator[Rod]:
    """A rod to each joint to which no shape leads by a formula: to those that parameters move, if
    they are within or near the bounds of the shapes at the model's parameters, and to pins beyond
    these bounds, so that no bob hangs on nothing.
    """
    n = model.dimensions
    corners = extent_points([valued(shape, model.defaults) for shape in shapes], n)
    low, high = corners.min(axis=0), corners.max(axis=0)
    held = [body.joint for body in model.bodies if body.joint.holds]
    pins = {r for joint in held if joint.type in PINS for r in (joint.r_parent, joint.r_child)}
    ends = {getattr(shape, key, None) for shape in shapes for key in ("start", "end", "center")}
    for joint in joints:
        if joint in ends:
            continue
        place = np.array([*map(model.value, joint)])
        between = np.vstack([np.zeros(n), place])
        slack = NEAR * size
        within = (between >= low - slack).all() and (between <= high + slack).all()
        seen = not within and joint in pins
        hidden = within and any(_moves(part) for part in joint)
        if (seen or hidden) and is_drawn(length_of(model, joint)):
            zero, width = constant(*[0.0] * n), Constant(THIN * size)
            yield Rod(type="rod", start=zero, end=joint, width=width, color=color)


def _moves(formula: Formula) -> bool:
    return next(names_in(formula), None) is not None
