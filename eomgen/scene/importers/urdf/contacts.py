"""Collision geometry of links as soft contacts with the ground z = 0 and with each other.

A URDF says neither how stiff nor how rough links are. All weight on one point lets it sink in by
`DEPTH`, and of a mass on one point the damping is half the critical one.
"""

import math
from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import Any

import numpy as np

from eomgen.base.text import brief
from eomgen.scene.importers import contacts as shapes
from eomgen.scene.importers.attributes import required, vector
from eomgen.scene.importers.contacts import Contacts, Table, depth_below
from eomgen.scene.importers.pairs import Part, Pose, part
from eomgen.scene.importers.rotations import image, rotation, squared
from eomgen.scene.importers.urdf.joints import Mechanism, Names
from eomgen.scene.importers.urdf.links import Inertial
from eomgen.scene.importers.urdf.shapes import Meshes, length_of, lengths_of
from eomgen.scene.importers.urdf.tree import SINGLE, Joint, Tree, moved
from eomgen.scene.importers.xml_elements import Element
from eomgen.scene.joints.base import WORLD

DEPTH = 1e-3
GRAVITY = 9.81
FRICTION = 0.8
ABOUT = {
    "stiffness": ("N/m", "stiffness of"),
    "damping": ("N s/m", "damping of"),
    "friction": ("", "coefficient of friction of"),
}
EFFECTS = {"ground": "the ground", "self": "links that touch each other"}


def add_contacts(
    tree: Tree,
    inertials: Mapping[str, Inertial],
    names: Names,
    made: Mechanism,
    meshes: Meshes,
    *,
    each_other: bool,
) -> Iterator[str]:
    """Contacts of all links that move with the ground, of all links with each other if wished;
    remarks. A root that moves freely starts where the lowest link touches the ground.
    """
    found, still = Contacts(), set[str]() if _is_free(made) else {tree.root}
    mass = sum(inertial.mass for inertial in inertials.values()) or 1.0
    touching, links, parts = dict[str, list[Table]](), list[str](), list[Part]()
    for name, link in tree.links.items():
        joint = tree.carried.get(name)
        if joint is not None and joint.kind == "fixed" and joint.parent in still:
            still.add(name)
        for kind, tables in _shapes_of(link, f"link '{brief(name)}'", meshes, found):
            links.append(name)
            parts.append(part(names.bodies[name], kind, tables))
            if name in still or names.bodies[name] == WORLD:
                found.lost["shapes of links that cannot move"] += 1
                continue
            found.add(_law("ground", mass, made), parts[-1])
            touching.setdefault(name, []).extend(tables)
    poses = _poses(tree, names, made)
    if each_other:
        own, groups = {names.bodies[link]: poses[link] for link in poses}, _groups(tree)
        pairs = (
            (i, j)
            for i, j in combinations(range(len(links)), 2)
            if _may_touch(tree, groups, links[i], links[j])
        )
        found.add_pairs(parts, pairs, own, lambda i, j: _law("self", mass, made), apart=True)
    if touching and tree.root not in still:
        low = max(depth_below(s, *poses[link]) for link, own in touching.items() for s in own)
        made.start[f"{names.bodies[tree.root]}_z"] = low + inertials[tree.root].com[2]
    found.effects(made)
    yield from found.remarks()


def _law(effect: str, mass: float, made: Mechanism) -> dict[str, Any]:
    """The law of an effect on a robot's mass, whose values are parameters of the scene."""
    stiffness = mass * GRAVITY / DEPTH
    values = (stiffness, math.sqrt(stiffness * mass), FRICTION)
    for (key, (unit, about)), value in zip(ABOUT.items(), values, strict=True):
        number = float(f"{value:.3g}")
        entry = {"value": number, "unit": unit, "about": f"{about} {EFFECTS[effect]}"}
        made.parameters[f"{effect}_{key}"] = entry
    return {"name": effect, **{key: f"{effect}_{key}" for key in ABOUT}}


def _is_free(made: Mechanism) -> bool:
    return any(joint["type"] == "free" for joint in made.joints)


def _groups(tree: Tree) -> dict[str, str]:
    """For each link the link that carries it by fixed joints, or itself."""
    found = dict[str, str]()
    for name in tree.links:
        joint = tree.carried.get(name)
        fixed = joint is not None and joint.kind == "fixed"
        found[name] = found[joint.parent] if joint is not None and fixed else name
    return found


def _may_touch(tree: Tree, groups: Mapping[str, str], first: str, second: str) -> bool:
    """Whether two links are neither fixed to each other nor connected by a joint."""
    a, b = groups[first], groups[second]
    above = [groups[tree.carried[x].parent] if x in tree.carried else "" for x in (a, b)]
    return a != b and above[0] != b and above[1] != a


def _poses(tree: Tree, names: Names, made: Mechanism) -> dict[str, Pose]:
    """The poses of all links at the start, in the root's axes."""
    poses = {tree.root: (np.eye(3), np.zeros(3))}
    for joint in moved(tree):
        turn, at = poses[joint.parent]
        own, slid = _motion(joint, made.start.get(names.joints[joint.name], 0.0))
        poses[joint.child] = (turn @ own, at + turn @ slid)
    return poses


def _motion(joint: Joint, q: float) -> tuple[shapes.Array, shapes.Array]:
    """The pose of a joint's child on its parent at a coordinate."""
    turn, at = np.array(rotation(joint.angles)), np.array(joint.at)
    axis = np.array(joint.axis)
    if joint.kind not in SINGLE or not q:
        return turn, at
    axis = axis / np.linalg.norm(axis)
    if joint.kind == "prismatic":
        return turn, at + turn @ (q * axis)
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return turn @ (np.eye(3) + math.sin(q) * cross + (1 - math.cos(q)) * cross @ cross), at


def _shapes_of(
    link: Element, what: str, meshes: Meshes, found: Contacts
) -> Iterator[tuple[str, list[Table]]]:
    """The shapes of a link's collision elements, each with its kind."""
    for element in link.all("collision"):
        geometry, origin = element.first("geometry"), element.first("origin")
        at, turned = vector(origin, "xyz", what), vector(origin, "rpy", what)
        turn, degrees = rotation(turned), [math.degrees(squared(angle)) for angle in turned]
        for shape in geometry.children if geometry else ():
            tables = list[Table]()
            match shape.tag:
                case "box":
                    half = [size / 2 for size in lengths_of(shape, what)]
                    tables = shapes.box(at, half, degrees)
                case "sphere":
                    tables = shapes.sphere(at, length_of(shape, "radius", what))
                case "cylinder" | "capsule":
                    arm = image(turn, (0.0, 0.0, length_of(shape, "length", what) / 2))
                    start, end = np.subtract(at, arm).tolist(), np.add(at, arm).tolist()
                    kind: Any = shapes.cylinder if shape.tag == "cylinder" else shapes.capsule
                    tables = kind(start, end, length_of(shape, "radius", what))
                case "mesh":
                    corners = meshes.corners(required(shape, "filename", what))
                    if corners is None:
                        found.lost["meshes that are not read"] += 1
                        continue
                    scale = vector(shape, "scale", what, (1.0, 1.0, 1.0))
                    tables = [found.hull(corners * scale @ np.array(turn).T + at)]
                case _:
                    continue
            yield shape.tag, tables
