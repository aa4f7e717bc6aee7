"""Joints of a URDF file as joints, effects and constraints of a scene."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from eomgen.scene.importers.parts import SLIDING_SPEED, Parts
from eomgen.scene.importers.rotations import (
    EYE,
    angles_of,
    cleaned,
    rotation,
    squared,
    times,
    to_axis,
    transposed,
)
from eomgen.scene.importers.urdf.tree import SINGLE, Joint, Tree, moved
from eomgen.scene.importers.vectors import Vector
from eomgen.scene.joints.base import WORLD


@dataclass(frozen=True)
class Names:
    """Names of bodies by link, and of joints by joint."""

    bodies: Mapping[str, str]
    joints: Mapping[str, str]

    def of_parent(self, joint: Joint) -> str:
        """The body, or the world, that carries a joint."""
        return self.bodies[joint.parent]


@dataclass
class Mechanism(Parts):
    """The parts of a scene, and what remarks are about."""

    unlimited: list[str] = field(default_factory=list)
    clipped: list[str] = field(default_factory=list)
    held: list[str] = field(default_factory=list)


def add_joints(tree: Tree, names: Names, made: Mechanism, massless: Collection[str]) -> None:
    """The joints of a tree, each with its friction, motor and coupling.

    `massless` are links that neither have nor carry mass. Nothing resists the joints of these, so
    they are held, unless other motion depends on them.
    """
    for joint in moved(tree):
        name = names.joints[joint.name]
        if joint.kind in SINGLE:
            made.joints.append(_single(joint, name, names, made))
        elif joint.kind == "fixed":
            made.joints.append(_table(joint, name, "weld", names))
        elif joint.kind == "planar":
            _add_planar(joint, name, names, made)
        else:
            _add_floating(joint, name, names, made)
    followed = {joint.name: _followed(joint, tree) for joint in moved(tree) if joint.kind in SINGLE}
    heavy = {f.of.name for name, f in followed.items() if tree.joint(name).child not in massless}
    for name, following in followed.items():
        joint = tree.joint(name)
        free = following.of is joint
        acts = name in heavy if free else bool(joint.damping or joint.friction)
        if joint.child in massless and not acts:
            made.held.append(name)
            made.locked[names.joints[name]] = made.start.pop(names.joints[name], 0.0)
        else:
            _add_effects(joint, following, names, made)


@dataclass(frozen=True)
class _Following:
    """A coordinate is `factor` times that of joint `of`, plus `offset`."""

    of: Joint
    factor: float = 1.0
    offset: float = 0.0


def _followed(joint: Joint, tree: Tree) -> _Following:
    """What a joint follows in the end: itself, if it mimics no other."""
    factor, offset, of = 1.0, 0.0, joint
    while of.mimic is not None and of.kind in SINGLE:
        offset += factor * of.mimic.offset
        factor *= of.mimic.multiplier
        of = tree.joint(of.mimic.of)
    return _Following(of, factor, offset)


def _add_effects(joint: Joint, following: _Following, names: Names, made: Mechanism) -> None:
    """The motor of a joint, or what it follows; and its friction.

    A joint that follows one that is fixed is held.
    """
    name, of = names.joints[joint.name], following.of
    if of is joint:
        made.effects += _friction(joint, name)
        motor = {"type": "motor", "name": f"{name}_motor", "joint": name, "torque": "input"}
        made.effects.append(motor)
    elif of.kind not in SINGLE or following.factor == 0.0:
        made.locked[name] = following.offset
    else:
        made.effects += _friction(joint, name)
        _add_coupling(name, following, names.joints[of.name], made)


def _add_coupling(name: str, following: _Following, of: str, made: Mechanism) -> None:
    """The constraint of a joint that follows joint `of`, and where it starts."""
    factor, offset = following.factor, following.offset
    text = of if factor == 1.0 else f"{factor!r} * {of}"
    equals = f"{text} + {offset!r}" if offset else text
    coupling = {"type": "coupling", "name": f"{name}_mimic", "coordinate": name, "equals": equals}
    made.constraints.append(coupling)
    start = factor * made.start.get(of, 0.0) + offset
    if start:
        made.start[name] = start


def _table(joint: Joint, name: str, kind: str, names: Names) -> dict[str, Any]:
    """The keys that all joints have."""
    table: dict[str, Any] = {
        "name": name,
        "type": kind,
        "parent": names.of_parent(joint),
        "child": names.bodies[joint.child],
    }
    if any(at := cleaned(joint.at)):
        table["r_parent"] = at
    if any(joint.angles):
        table["orientation"] = [squared(angle) for angle in joint.angles]
    return table


def _single(joint: Joint, name: str, names: Names, made: Mechanism) -> dict[str, Any]:
    """A revolute or prismatic joint, whose coordinate has the joint's name."""
    kind = "prismatic" if joint.kind == "prismatic" else "revolute"
    table = _table(joint, name, kind, names)
    table |= {"axis": list(joint.axis), "coordinate": name}
    if joint.limits is None:
        return table
    low, high = joint.limits
    if low >= high:
        made.unlimited.append(joint.name)
        return table
    table["limits"] = [low, high]
    if joint.mimic is None and not low <= 0.0 <= high:
        made.start[name] = (low + high) / 2
        made.clipped.append(joint.name)
    return table


def _add_planar(joint: Joint, name: str, names: Names, made: Mechanism) -> None:
    """Motion in the plane perpendicular to the axis: along z of a frame between two bodies."""
    table = _table(joint, name, "planar", names)
    tilt = to_axis(joint.axis)
    if tilt == EYE:
        made.joints.append(table)
        return
    between = _massless(f"{names.bodies[joint.child]}_plane", made)
    turned = times(rotation(joint.angles), tilt)
    table |= {"child": between, "orientation": _angles(angles_of(turned))}
    back: dict[str, Any] = {"name": f"{name}_tilt", "type": "weld", "parent": between}
    back |= {"child": names.bodies[joint.child]}
    back |= {"orientation": _angles(angles_of(transposed(tilt)))}
    made.joints += [table, back]


def _add_floating(joint: Joint, name: str, names: Names, made: Mechanism) -> None:
    """Three translations in the joint's axes, then a rotation."""
    between = _massless(f"{names.bodies[joint.child]}_point", made)
    slide = _table(joint, f"{name}_slide", "particle", names) | {"child": between}
    turn = {"name": name, "type": "ball", "parent": between}
    made.joints += [slide, turn | {"child": names.bodies[joint.child]}]


def _massless(name: str, made: Mechanism) -> str:
    """A body without mass, which is a frame between two joints."""
    zeros = [0.0, 0.0, 0.0]
    made.bodies.append({"name": name, "mass": 0.0, "inertia_com": zeros, "com": zeros})
    return name


def _angles(angles: Vector) -> list[float]:
    return [squared(angle) for angle in angles]


def _friction(joint: Joint, name: str) -> Iterator[dict[str, Any]]:
    table: dict[str, Any] = {"type": "joint_friction", "name": f"{name}_friction", "joint": name}
    if joint.damping:
        table["viscous"] = joint.damping
    if joint.friction:
        table |= {"coulomb": joint.friction, "speed": SLIDING_SPEED}
    if len(table) > 3:
        yield table


def floating_base(root: str, names: Names) -> dict[str, Any]:
    """The free joint of the root."""
    return {"name": f"{names.bodies[root]}_base", "type": "free", "child": names.bodies[root]}


def fixed_base(root: str, names: Names) -> dict[str, Any]:
    """The weld of the root to the world."""
    body = names.bodies[root]
    return {"name": f"{body}_base", "type": "weld", "parent": WORLD, "child": body}
