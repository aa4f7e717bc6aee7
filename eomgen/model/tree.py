"""The tree that joints make of bodies: one joint holds each, parents come before children."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from eomgen.errors import SceneError, check_known
from eomgen.model.names import check_names
from eomgen.scene.chains import written_out
from eomgen.scene.joints import Joint
from eomgen.scene.joints.base import WORLD
from eomgen.scene.schema import BodyTable, Scene


@dataclass(frozen=True)
class Link:
    """A body and the joint that holds it, each with its place in the scene; `parent` is the number
    of the link that it hangs on, -1 the world.
    """

    body: BodyTable
    location: str
    joint: Joint
    joint_place: str
    parent: int


def links_of(scene: Scene) -> tuple[Link, ...]:
    """The links of a scene and its chains: parents first, and otherwise in the scene's order.

    Raises `SceneError` for names that are given twice or not at all, and unless each body hangs on
    the world by one joint after another.
    """
    bodies, joints = written_out(scene)
    check_names([(body.name, location) for body, location in bodies])
    check_names([(joint.name, location) for joint, location in joints])
    locations = {body.name: location for body, location in bodies}
    holding = _holding(locations, joints)
    depth = _depths(holding)
    order = sorted(bodies, key=lambda body: depth[body[0].name])
    index = {WORLD: -1, **{body.name: k for k, (body, _) in enumerate(order)}}
    return tuple(
        Link(body, location, *holding[body.name], index[holding[body.name][0].parent])
        for body, location in order
    )


def _holding(
    bodies: Mapping[str, str], joints: Sequence[tuple[Joint, str]]
) -> dict[str, tuple[Joint, str]]:
    """The joint that holds each body, with its place; `bodies` have theirs by name."""
    holding: dict[str, tuple[Joint, str]] = {}
    anchors: Collection[str] = dict.fromkeys([WORLD, *bodies])
    for joint, location in joints:
        if joint.child == WORLD:
            raise SceneError(
                f"{location}.child: '{WORLD}' is the ground, which hangs on nothing; name it as "
                "the "
                "parent, and give no body a second joint: loops are not closed"
            )
        check_known(joint.child, f"{location}.child", bodies, "body")
        if joint.parent != WORLD:
            check_known(joint.parent, f"{location}.parent", anchors, "body")
        if joint.child in holding:
            raise SceneError(
                f"{location}.child: '{joint.child}' is the child of {holding[joint.child][1]} too; "
                "in a tree each body has one joint to its parent"
            )
        holding[joint.child] = (joint, location)
    for name, location in bodies.items():
        if name not in holding:
            raise SceneError(
                f"{location}.name: '{name}' is attached to nothing; "
                "give it a joint, of type 'free' if nothing holds it"
            )
    return holding


def _depths(holding: Mapping[str, tuple[Joint, str]]) -> dict[str, int]:
    """How many joints lie between each body and the world. Raises `SceneError` for a cycle."""
    depth: dict[str, int] = {WORLD: 0}
    for start in holding:
        path: dict[str, None] = {}
        name = start
        while name not in depth:
            if name in path:
                joint, location = holding[name]
                raise SceneError(
                    f"{location}.parent: '{joint.parent}' hangs on its own child '{name}': "
                    "the joints make a cycle; let one tree start at the world"
                )
            path[name] = None
            name = holding[name][0].parent
        for name in reversed(path):
            depth[name] = depth[holding[name][0].parent] + 1
    return depth
