"""The kinematic tree: each body has one joint to its parent, and parents precede children."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

from eomgen.base.errors import SceneError, check_known
from eomgen.model.names import check_names
from eomgen.scene.chains import written_out
from eomgen.scene.joints import Joint
from eomgen.scene.joints.base import WORLD
from eomgen.scene.schema import BodyTable, Scene

OF_COORDINATES = ("coordinate", "coordinates", "motor_inertia", "gear_ratio", "limits")
"""Keys of joints that are about their coordinates."""


@dataclass(frozen=True)
class Link:
    """A body and the joint to its parent, each with its location in the scene; `parent` is the
    index of the parent's link, -1 for the world.
    """

    body: BodyTable
    location: str
    joint: Joint
    joint_location: str
    parent: int


def links_of(scene: Scene) -> tuple[Link, ...]:
    """The links of a scene and its chains, in the order of its bodies, but each after its parent.

    Raises `SceneError` for duplicate or unknown names, and unless the joints that close no loop
    form a tree whose root is the world.
    """
    bodies, joints = written_out(scene)
    check_names([(body.name, location) for body, location in bodies])
    check_names([(joint.name, location) for joint, location in joints])
    locations = {body.name: location for body, location in bodies}
    parent_joint = _parent_joints(locations, [pair for pair in joints if not pair[0].loop])
    order = _parents_first(locations, parent_joint)
    index = {name: k for k, name in enumerate(order, start=-1)}
    tables = {body.name: body for body, _ in bodies}
    return tuple(
        Link(
            tables[name], locations[name], *parent_joint[name], index[parent_joint[name][0].parent]
        )
        for name in order[1:]
    )


def loop_joints(scene: Scene) -> list[tuple[Joint, str]]:
    """The joints that close loops, each with its location.

    Raises `SceneError` for an unknown body, or a body held to itself.
    """
    bodies, joints = written_out(scene)
    anchors = dict.fromkeys([WORLD, *(body.name for body, _ in bodies)])
    found = list[tuple[Joint, str]]()
    for joint, location in joints:
        if not joint.loop:
            continue
        for key, name in (("parent", joint.parent), ("child", joint.child)):
            check_known(name, f"{location}.{key}", anchors, "body")
        for key in OF_COORDINATES:
            if key in joint.model_fields_set:
                raise SceneError(
                    f"{location}.{key}: a joint with loop = true has no coordinates, so this has "
                    "no effect; leave it out, or close the loop with another joint"
                )
        if joint.parent == joint.child:
            raise SceneError(
                f"{location}.child: '{joint.child}' is also the parent; a loop joint holds two "
                "bodies together"
            )
        found.append((joint, location))
    return found


def _parent_joints(
    bodies: Mapping[str, str], joints: Sequence[tuple[Joint, str]]
) -> dict[str, tuple[Joint, str]]:
    """For each body the joint to its parent and that joint's location.

    `bodies` maps the names of bodies to their locations.
    """
    parent_joint: dict[str, tuple[Joint, str]] = {}
    anchors: Collection[str] = dict.fromkeys([WORLD, *bodies])
    for joint, location in joints:
        if joint.child == WORLD:
            raise SceneError(
                f"{location}.child: '{WORLD}' is the ground, which has no parent; name it as the "
                "parent, or give the joint loop = true if it closes a loop"
            )
        check_known(joint.child, f"{location}.child", bodies, "body")
        if joint.parent != WORLD:
            check_known(joint.parent, f"{location}.parent", anchors, "body")
        if joint.child in parent_joint:
            other = parent_joint[joint.child][1]
            raise SceneError(
                f"{location}.child: '{joint.child}' is the child of {other} too; "
                "in a tree each body has one joint to its parent; give one of the two loop = true"
            )
        parent_joint[joint.child] = (joint, location)
    for name, location in bodies.items():
        if name not in parent_joint:
            raise SceneError(
                f"{location}.name: '{name}' has no joint; "
                "give it one, of type 'free' if it moves freely"
            )
    return parent_joint


def _parents_first(
    bodies: Iterable[str], parent_joint: Mapping[str, tuple[Joint, str]]
) -> list[str]:
    """The world and all bodies in their order, but each after its parent.

    Raises `SceneError` for a cycle.
    """
    found: dict[str, None] = {WORLD: None}
    for name in bodies:
        path: dict[str, None] = {}
        while name not in found:
            if name in path:
                joint, location = parent_joint[name]
                raise SceneError(
                    f"{location}.parent: '{joint.parent}' is itself a descendant of the child "
                    f"'{name}': the joints make a cycle; give one of them loop = true, and connect "
                    "one of its bodies to the world"
                )
            path[name] = None
            name = parent_joint[name][0].parent
        found |= dict.fromkeys(reversed(path))
    return list(found)
