"""Coordinates and velocities of a URDF's joints, in a scene and in Pinocchio.

Pinocchio takes joints depth first, those of a link by name. Its joints that mimic others are free.
"""

from collections.abc import Iterator

from eomgen.scene.importers.conventions import Convention, Frame, JointStates, convention
from eomgen.scene.importers.rotations import EYE, to_axis
from eomgen.scene.importers.urdf.joints import Mechanism, Names
from eomgen.scene.importers.urdf.tree import SINGLE, Joint, Tree, moved
from eomgen.scene.joints.base import WORLD

IN_BODY: Frame = "origin in the body"


def convention_of(read: Tree, tree: Tree, names: Names, made: Mechanism) -> Convention:
    """The convention of Pinocchio for a robot.

    `read` is the tree as in the file, `tree` the one that became the parts `made`.
    """
    paths: dict[str, tuple[str, ...]] = {tree.root: ()}
    found = dict[tuple[str, ...], JointStates]()
    root = names.bodies[tree.root]
    if any(joint["type"] == "free" for joint in made.joints):
        (com,) = (body["com"] for body in made.bodies if body["name"] == root)
        found[()] = JointStates.free(root, root, IN_BODY, root, tuple(com))
    for joint in moved(tree):
        path = paths[joint.child] = (*paths[joint.parent], joint.name)
        if joint.kind != "fixed":
            found[path] = _states(joint, names)
    by_name = [states for _, states in sorted(found.items(), key=lambda item: item[0])]
    obstacle = next(_obstacles(read, tree), "")
    return convention("Pinocchio", list(found.values()), made.locked, by_name, obstacle)


def _states(joint: Joint, names: Names) -> JointStates:
    name, body = names.joints[joint.name], names.bodies[joint.child]
    if joint.kind in SINGLE:
        return JointStates.single(name, "cosine and sine" if joint.kind == "continuous" else "same")
    if joint.kind == "floating":
        return JointStates.free(f"{body}_point", name, IN_BODY)
    positions = (f"{name}_x", f"{name}_y", f"{name}_angle")
    return JointStates(positions, tuple(f"{x}_dot" for x in positions), "plane in the body")


def _obstacles(read: Tree, tree: Tree) -> Iterator[str]:
    """Why Pinocchio's robot moves otherwise."""
    if tree.root != read.root:
        joint = read.carried[tree.root]
        if joint.kind == "fixed" or any(joint.at) or any(joint.angles):
            yield (
                f"lets the link '{WORLD}' move with the robot; take that link and its joint out "
                "of the file"
            )
    for joint in moved(tree):
        if joint.kind == "planar" and to_axis(joint.axis) != EYE:
            yield f"takes the axis of planar joints as z, and that of '{joint.name}' is another"
