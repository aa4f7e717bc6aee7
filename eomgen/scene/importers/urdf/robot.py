"""A URDF file as the tables of a scene."""

from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

from eomgen.base.errors import listed
from eomgen.base.text import brief
from eomgen.scene.importers.imported import Imported, Wishes
from eomgen.scene.importers.meshes import ELSEWHERE
from eomgen.scene.importers.names import TAKEN, identifiers, renamed, scene_name
from eomgen.scene.importers.parts import SLIDING_SPEED, SPEED
from eomgen.scene.importers.rotations import is_slight
from eomgen.scene.importers.stops import add_stops
from eomgen.scene.importers.urdf.contacts import add_contacts
from eomgen.scene.importers.urdf.joints import (
    Mechanism,
    Names,
    add_joints,
    fixed_base,
    floating_base,
)
from eomgen.scene.importers.urdf.links import ENTRIES, Changes, Inertial, read_inertials
from eomgen.scene.importers.urdf.shapes import Meshes, colours_of, shapes_of
from eomgen.scene.importers.urdf.states import convention_of
from eomgen.scene.importers.urdf.tree import SINGLE, Joint, Tree, moved, read_tree
from eomgen.scene.importers.xml_elements import Element
from eomgen.scene.joints.base import WORLD

GRAVITY = 9.81
OF_JOINTS = ("_dot", "_ddot", "_motor")
"""Endings of names that are made from those of joints."""
OF_BODIES = ("mass", *(f"com_{axis}" for axis in "xyz"), *(f"inertia_com_{e[1:]}" for e in ENTRIES))
"""The same of parameters of bodies."""
KNOWN = {
    "robot": ("link", "joint", "material"),
    "link": ("inertial", "visual", "collision"),
    "joint": ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic"),
}
"""What is read of each element; the rest is listed in a remark."""


def imported(path: Path, robot: Element, wishes: Wishes) -> Imported:
    """The scene of a robot. Raises `SceneError`, one line with the line of the file."""
    if any("xacro" in element.namespace for element in robot.walk()):
        raise robot.error("has xacro macros; expand them first: xacro robot.xacro > robot.urdf")
    read = read_tree(robot)
    tree = _without_world(read) if wishes.floating else read
    names = _names(tree)
    made, remarks = Mechanism(effects=[{"type": "gravity", "g": GRAVITY}]), list[str]()
    meshes = Meshes((path.parent, *wishes.allowed))
    inertials, changes = read_inertials(tree, floating=wishes.floating)
    _add_bodies(tree, inertials, names, made, meshes, colours_of(robot))
    if names.bodies[tree.root] != WORLD:
        base = floating_base if wishes.floating else fixed_base
        made.joints.append(base(tree.root, names))
    add_joints(tree, names, made, _without_mass(tree, inertials))
    driven = any(effect["type"] == "motor" for effect in made.effects)
    loose = any(joint.kind in ("planar", "floating") for joint in moved(tree))
    if not (driven or loose or wishes.floating):
        raise robot.error("nothing can move; let the root move freely with --floating")
    if wishes.stops:
        add_stops(made)  # all start between their limits
    if wishes.contacts or wishes.self_contacts:
        each_other = wishes.self_contacts
        remarks += add_contacts(tree, inertials, names, made, meshes, each_other=each_other)
    remarks += _remarks(robot, tree, names, made)
    remarks += _remarks_on_bodies(tree, meshes, changes, wishes)
    name = scene_name(robot.attributes.get("name", ""), path.stem)
    states = convention_of(read, tree, names, made)
    return Imported(made.tables(name, path.name), tuple(remarks), states)


def _without_world(tree: Tree) -> Tree:
    """The tree without a root link named world that carries one link: that is what moves freely."""
    below = [joint for joint in moved(tree) if joint.parent == tree.root]
    if tree.root != WORLD:
        return tree
    if len(below) != 1 or below[0].kind not in ("fixed", "floating"):
        raise tree.links[tree.root].error(
            f"the root link is '{WORLD}', the ground, so it cannot move freely; give it one fixed "
            "joint to the robot's base, or leave --floating out"
        )
    links = {name: link for name, link in tree.links.items() if name != WORLD}
    carried = {name: joint for name, joint in tree.carried.items() if joint is not below[0]}
    return Tree(below[0].child, links, carried)


def _names(tree: Tree) -> Names:
    """Names of bodies and joints. A root link named world is the world of the scene."""
    bodies = {WORLD: WORLD} if tree.root == WORLD else {}
    bodies |= identifiers((name for name in tree.links if name not in bodies), "link")
    taken = TAKEN | {f"{body}_{ending}" for body in bodies.values() for ending in OF_BODIES}
    joints = identifiers((joint.name for joint in moved(tree)), "joint", taken, OF_JOINTS)
    return Names(bodies, joints)


def _without_mass(tree: Tree, inertials: Mapping[str, Inertial]) -> set[str]:
    """The links that neither have nor carry any mass."""
    heavy = set[str]()
    for name in reversed(list(tree.links)):
        if inertials[name].mass:
            heavy.add(name)
        if name in heavy and name in tree.carried:
            heavy.add(tree.carried[name].parent)
    return set(tree.links) - heavy


def _add_bodies(
    tree: Tree,
    inertials: Mapping[str, Inertial],
    names: Names,
    made: Mechanism,
    meshes: Meshes,
    colours: Mapping[str, str],
) -> None:
    """The bodies of the links, with their shapes."""
    for name, element in tree.links.items():
        if names.bodies[name] == WORLD:
            continue
        table = inertials[name].table(names.bodies[name])
        if shapes := shapes_of(element, f"link '{brief(name)}'", colours, meshes):
            table["shapes"] = shapes
        made.bodies.append(table)


def _remarks(robot: Element, tree: Tree, names: Names, made: Mechanism) -> Iterator[str]:
    """What has no counterpart, and what was changed, of joints and the robot."""
    left = Counter(
        f"<{part.tag}> of a {element.tag}" if element.tag != "robot" else f"<{part.tag}>"
        for element in (robot, *robot.all("link"), *robot.all("joint"))
        for part in element.children
        if part.tag not in KNOWN[element.tag]
    )
    if left:
        yield f"left out: {listed(f'{count} {tag}' for tag, count in left.items())}"
    joints = moved(tree)
    single = [joint for joint in joints if joint.kind in SINGLE]
    if any(_has(joint, key) for joint in single for key in ("effort", "velocity")):
        yield (
            "left out: bounds of efforts and velocities of joints; each motor is an input without "
            "bounds"
        )
    if any(joint.limits for joint in single) and not any("low" in e for e in made.effects):
        yield (
            "a coordinate beyond the limits of its joint is reported, not prevented; import with "
            "--stops adds rigid stops"
        )
    if slight := [joint for joint in joints if any(map(is_slight, joint.at))]:
        yield f"rounding errors in origins count as 0: {_names_of(slight)}"
    if made.unlimited:
        yield (
            "left out: limits whose lower bound is not below the upper, of "
            f"{_listed(made.unlimited)}"
        )
    if made.clipped:
        yield f"0 is beyond the limits of {_listed(made.clipped)}, which start between them"
    if any("coulomb" in effect for effect in made.effects):
        yield f"friction of joints is smoothed within {SPEED:g} rad/s or m/s: {SLIDING_SPEED}"
    if made.held:
        yield f"held, because nothing resists joints that carry no mass: {_listed(made.held)}"
    lost = [joint for joint in joints if joint.mimic and joint.kind not in SINGLE]
    if lost:
        yield f"left out: mimic of joints that are no hinge or slide: {_names_of(lost)}"
    changed = [*renamed(dict(names.bodies)), *renamed(dict(names.joints))]
    if changed:
        yield f"renamed: {listed(changed)}"


def _remarks_on_bodies(
    tree: Tree, meshes: Meshes, changes: Changes, wishes: Wishes
) -> Iterator[str]:
    """The same of links."""
    if changes.strange:
        yield f"no body has the inertia of {_listed(changes.strange)}; taken as it is"
    if changes.rounded:
        rounded = _listed(changes.rounded)
        yield f"rounding errors in inertias or centres of mass count as 0: {rounded}"
    if changes.lent:
        lent = _listed(changes.lent)
        yield f"inertias of links without mass count with what carries them: {lent}"
    if changes.still:
        yield f"left out: inertias of links that cannot move: {_listed(changes.still)}"
    if not (wishes.contacts or wishes.self_contacts) and any(
        link.first("collision") for link in tree.links.values()
    ):
        yield (
            "left out: collision geometry; import with --contacts lets it touch the ground, with "
            "--self-contacts itself, too"
        )
    if meshes.drawn:
        yield f"{meshes.drawn} meshes are drawn as the boxes around them"
    for reason in dict.fromkeys(meshes.missing.values()):
        names = [name for name, why in meshes.missing.items() if why == reason]
        hint = "; import with --allow DIR reads those in another folder"
        yield (
            f"left out: {len(names)} mesh{'es' * (len(names) > 1)}, '{brief(names[0])}' "
            f"{'for one ' * (len(names) > 1)}{reason}{hint * (reason in ELSEWHERE)}"
        )


def _has(joint: Joint, key: str) -> bool:
    limit = joint.element.first("limit")
    return limit is not None and key in limit.attributes


def _names_of(joints: list[Joint]) -> str:
    return _listed([joint.name for joint in joints])


def _listed(names: list[str]) -> str:
    return listed(f"'{brief(name)}'" for name in names)
