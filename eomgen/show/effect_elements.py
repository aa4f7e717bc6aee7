"""What a picture shows of each effect of a model: see `scene.effects.elements`."""

from collections.abc import Iterable
from functools import cached_property

import numpy as np

from eomgen.language.formula import Constant, Formula
from eomgen.language.rewriting import constant
from eomgen.model.bodies import dofs_of
from eomgen.model.model import Model
from eomgen.scene.constraints.base import ConstraintTable
from eomgen.scene.effects.elements import WORLD_INDEX, Disc, Element, Vector, Wind
from eomgen.scene.joints.base import WORLD, kinds_of, spatial
from eomgen.show.arrows import wind_at

COIL, SYMBOL = 0.06, 0.14
"""Radius of a coil, and of what is drawn at a joint, relative to the mechanism's size."""


def elements_of(model: Model, size: float) -> tuple[Element, ...]:
    """The elements of all effects, in their order; `size` is a typical length, m."""
    layout, still = _Layout(model, size), np.zeros(model.dimensions)
    found = (e for effect in model.effects for e in effect.elements(layout))
    placed = (wind_at(e, model, still) if isinstance(e, Wind) else e for e in found)
    return tuple(dict.fromkeys(placed))


def elements_of_constraints(model: Model, size: float) -> Iterable[Element]:
    """Those of the constraints that the scene lists."""
    layout = _Layout(model, size)
    for constraint in model.constraints:
        if isinstance(constraint, ConstraintTable):
            yield from constraint.elements(layout)


def discs_of_constraints(model: Model, size: float) -> Iterable[Disc]:
    """The discs of bodies that the constraints turn, one for each centre and radius."""
    layout, seen = _Layout(model, size), set[tuple[str, tuple[float, ...], float]]()
    for constraint in model.constraints:
        for disc in constraint.discs(layout) if isinstance(constraint, ConstraintTable) else ():
            places = (*map(model.value, disc.at),)
            same = (disc.body, places, round(model.value(disc.radius), 9))
            if same not in seen:
                seen.add(same)
                yield disc


class _Layout:
    """A model as effects see it that are drawn: see `scene.effects.elements.Layout`."""

    def __init__(self, model: Model, size: float) -> None:
        self._model, self.dimensions = model, model.dimensions
        self.coil: Formula = Constant(COIL * size)
        self.symbol: Formula = Constant(SYMBOL * size)
        self.bodies = {WORLD: WORLD_INDEX} | {b.name: k for k, b in enumerate(model.bodies)}

    @cached_property
    def joints(self) -> dict[str, tuple[str, ...]]:
        return dofs_of(self._model.bodies, self.dimensions)

    @cached_property
    def _children(self) -> dict[str, int]:
        return {body.joint.name: k for k, body in enumerate(self._model.bodies)}

    def child(self, joint: str) -> int:
        return self._children[joint]

    def coordinates(self, joint: str) -> tuple[str, ...]:
        return tuple(c.name for c in self._model.bodies[self.child(joint)].positions)

    def point(self, name: str) -> tuple[int, Vector]:
        point = next(point for point in self._model.points if point.name == name)
        return point.body, point.at

    def value(self, formula: Formula) -> float:
        return self._model.value(formula)

    def axle(self, body: str, carrier: str) -> tuple[Vector, Vector] | None:
        bodies, (k, n) = self._model.bodies, (self.bodies[body], self.bodies[carrier])
        one, other = (bodies[i] if i >= 0 else None for i in (k, n))
        if one and one.parent == n:
            return one.joint.r_child, one.joint.r_parent
        if other and other.parent == k:
            return other.joint.r_parent, other.joint.r_child
        if one and other and one.parent == other.parent:
            return one.joint.r_child, other.joint.r_child
        return None

    def wheel_axis(self, body: int, at: Vector) -> Vector | None:
        joint, value = self._model.bodies[body].joint, self._model.value
        at_pin = [*map(value, at)] == [*map(value, joint.r_child)]
        if kinds_of(joint, self.dimensions) != ["revolute"] or not at_pin:
            return None
        (primitive,) = joint.primitives(self.dimensions)
        return () if self.dimensions == 2 else constant(*spatial(primitive.axis))
