"""What a picture shows of each effect of a model."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Literal

import numpy as np

from eomgen.language.formula import ZERO, Constant, Formula
from eomgen.model.model import Model, dofs_of
from eomgen.scalars.exact import direction
from eomgen.scene.effects import (
    BodyContact,
    Controller,
    Drag,
    Driven,
    Effect,
    ExternalForce,
    ExternalTorque,
    ForceField,
    Gravity,
    JointFriction,
    JointSpring,
    JointStop,
    Motor,
    Pairwise,
    PointGravity,
    Spring,
)
from eomgen.scene.effects.bodies import OnBodies
from eomgen.scene.effects.dofs import OnCoordinate
from eomgen.scene.joints.base import WORLD, spatial
from eomgen.show.arrows import wind_at
from eomgen.show.elements import (
    WORLD_INDEX,
    AtJoint,
    Attachment,
    Attraction,
    Ball,
    Element,
    Field,
    Link,
    Plane,
    Pull,
    Vector,
    Weight,
    Wind,
)
from eomgen.show.formulas import constant, sum_of, times
from eomgen.show.joint_axes import zero_direction

COIL, SYMBOL = 0.06, 0.14
"""Radius of a coil, and of what is drawn at a joint, relative to the mechanism's size."""
MOST_CORNERS = 400
"""More corners of boxes in contact than these are not drawn."""


def elements_of(model: Model, size: float) -> tuple[Element, ...]:
    """The elements of all effects, in their order; `size` is a typical length, m."""
    names = _Names(
        model=model,
        bodies={WORLD: WORLD_INDEX} | {body.name: k for k, body in enumerate(model.bodies)},
        joints={body.joint.name: k for k, body in enumerate(model.bodies)},
        dofs=dofs_of(model.bodies, model.dimensions),
        size=size,
    )
    return tuple(dict.fromkeys(e for effect in model.effects for e in _of_effect(effect, names)))


@dataclass(frozen=True)
class _Names:
    """The indices of a model's names, and a typical length, m."""

    model: Model
    bodies: dict[str, int]
    joints: dict[str, int]
    dofs: dict[str, tuple[str, ...]]
    size: float

    @property
    def symbol(self) -> Formula:
        """Radius of a symbol at a joint, m."""
        return Constant(SYMBOL * self.size)

    def points(self, effect: OnBodies) -> Iterator[tuple[int, Vector]]:
        """The points that an effect acts on."""
        if effect.points is not None:
            named = {point.name: point for point in self.model.points}
            yield from ((named[name].body, named[name].at) for name in effect.points)
            return
        every = tuple(body.name for body in self.model.bodies)
        listed = (effect.body,) if effect.body is not None else effect.bodies
        other = getattr(effect, "other", WORLD)
        for name in every if listed == "all" else listed or ():
            if name != other:
                yield self.bodies[name], effect.at


def _of_effect(effect: Effect, names: _Names) -> Iterator[Element]:
    match effect:
        case Spring():
            yield _link(effect, names)
        case Pairwise():
            yield from _between_all(effect, names)
        case BodyContact():
            yield from _contact(effect, names)
        case JointSpring() | JointStop() | JointFriction():
            yield from _at_joints(effect, names)
        case OnCoordinate():
            kind: Literal["motor", "servo"] = "motor" if isinstance(effect, Motor) else "servo"
            names_of = [c.name for c in names.model.bodies[names.joints[effect.joint]].positions]
            k = names_of.index(effect.coordinate) if effect.coordinate else 0
            yield AtJoint(kind, effect.name, names.joints[effect.joint], k, names.symbol)
        case Controller():
            for joint in effect.torques:
                yield AtJoint("servo", effect.name, names.joints[joint], 0, names.symbol)
        case Driven():
            yield AtJoint("drive", effect.name, names.joints[effect.joint], 0, names.symbol)
        case ForceField():
            yield from _field(effect, names)
        case Drag():
            if any(part != ZERO for part in effect.wind):
                origin = constant(*[0.0] * names.model.dimensions)
                wind = Wind(effect.name, origin, formula=effect.wind)
                yield wind_at(wind, names.model, np.zeros(names.model.dimensions))
        case PointGravity():
            pulled = tuple(
                k
                for k, body in enumerate(names.model.bodies)
                if body.name not in effect.except_bodies
            )
            yield Attraction(effect.name, effect.at, pulled)
        case ExternalForce():
            yield Pull("force", effect.name, names.bodies[effect.body], effect.at)
        case ExternalTorque():
            at = constant(*[0.0] * names.model.dimensions)
            yield Pull("torque", effect.name, names.bodies[effect.body], at)
        case Gravity():
            yield Weight(effect.name, constant(*_down(effect, names.model.dimensions)))


def _link(spring: Spring, names: _Names) -> Link:
    damped = spring.damping != ZERO
    kind: Literal["coil", "damper", "spring_damper", "rope"]
    kind = "spring_damper" if damped else "coil"
    if spring.tension_only:
        kind = "rope"
    elif spring.law is None and spring.stiffness == ZERO:
        kind = "damper"
    return Link(
        kind,
        spring.name,
        Attachment(names.bodies[spring.body_1], spring.at_1),
        Attachment(names.bodies[spring.body_2], spring.at_2),
        None if kind == "damper" else spring.rest_length,
        Constant(COIL * names.size),
    )


def _between_all(effect: Pairwise, names: _Names) -> Iterator[Link]:
    """A spring between every two bodies; a line, as a rope, for other attractions."""
    for one, two in effect.pairs(tuple(names.bodies)[1:]):
        link = _link(effect.spring(names.model.dimensions, one, two), names)
        if effect.stiffness is None:
            link = replace(link, kind="rope", rest=ZERO)
        yield link


def _contact(contact: BodyContact, names: _Names) -> Iterator[Element]:
    other = names.bodies[contact.other]
    if contact.against == "plane":
        normal = constant(*map(float, direction(contact.normal)))
        yield Plane(contact.name, other, normal, contact.offset)
    if contact.against == "ball":
        yield Ball("ball", contact.name, other, contact.other_at, contact.other_radius)
    bodies = names.model.bodies
    for k, at in names.points(contact):
        radius = contact.radii.get(bodies[k].name, contact.radius)
        if contact.corners is not None:
            if 2 ** len(at) * len(bodies) > MOST_CORNERS:
                return
            for signs in product((-1.0, 1.0), repeat=len(at)):
                half = tuple(times(*pair) for pair in zip(signs, contact.corners, strict=True))
                yield Ball("ball", contact.name, k, sum_of(at, half), radius)
            continue
        axis = _wheel_axis(names.model, k, at)
        kind: Literal["ball", "wheel"] = "ball" if axis is None else "wheel"
        yield Ball(kind, contact.name, k, at, radius, axis=axis or None)


def _at_joints(effect: JointSpring | JointStop | JointFriction, names: _Names) -> Iterator[Element]:
    for joint in effect.acted_on(names.dofs):
        k = names.joints[joint]
        positions = names.model.bodies[k].positions
        zero = zero_direction(names.model, names.model.bodies[k])
        for index in range(len(names.dofs[joint])):
            if effect.coordinate not in (None, positions[index].name):
                continue
            match effect:
                case JointSpring(rest=rest):
                    yield AtJoint(
                        "torsion", effect.name, k, index, names.symbol, rest=rest, zero=zero
                    )
                case JointStop(low=low, high=high):
                    yield AtJoint(
                        "stop", effect.name, k, index, names.symbol, low=low, high=high, zero=zero
                    )
                case _:
                    yield AtJoint("brake", effect.name, k, index, names.symbol)


def _field(field: ForceField, names: _Names) -> Iterator[Element]:
    if field.kind == "avoid":
        assert field.radius is not None and field.reach is not None  # by the kind
        yield Ball(
            "obstacle", field.name, WORLD_INDEX, field.center, field.radius, reach=field.reach
        )
    elif field.kind == "formula":
        yield Field(field.name, field.kind, formula=field.force)
    else:
        yield Field(field.name, field.kind, field.center)


def _wheel_axis(model: Model, k: int, at: Vector) -> Vector | None:
    """The axis about which a body rotates if it does so about the point `at`; () in the plane."""
    joint = model.bodies[k].joint
    if joint.type != "revolute" or [*map(model.value, at)] != [*map(model.value, joint.r_child)]:
        return None
    (primitive,) = joint.primitives(model.dimensions)
    return () if model.dimensions == 2 else constant(*spatial(primitive.axis))


def _down(gravity: Gravity, dimensions: int) -> Sequence[float]:
    given = gravity.direction or ((0.0,) * (dimensions - 1) + (-1.0,))
    return tuple(map(float, direction(given)))
