"""Links and joints of a URDF file, read and put in a tree."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from eomgen.base.errors import SceneError, nearest
from eomgen.base.text import brief
from eomgen.scene.importers.attributes import child, number, required, vector
from eomgen.scene.importers.vectors import Vector
from eomgen.scene.importers.xml_elements import Element

KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
SINGLE = ("revolute", "continuous", "prismatic")
"""Kinds of joints with one coordinate."""
MOST = 900
"""Greatest number of links; a scene takes 1000 bodies, and some joints need one more."""


@dataclass(frozen=True)
class Mimic:
    """A joint's coordinate is `multiplier` times that of joint `of`, plus `offset`."""

    of: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class Joint:
    """A joint: the pose of its axes in the parent link's, and what moves.

    limits      lower and upper; None without them
    damping     N m s/rad or N s/m
    friction    Coulomb friction, N m or N
    """

    name: str
    kind: str
    parent: str
    child: str
    at: Vector
    angles: Vector
    axis: Vector
    limits: tuple[float, float] | None
    damping: float
    friction: float
    mimic: Mimic | None
    element: Element


@dataclass(frozen=True)
class Tree:
    """The links by name, depth first, with the joints of a link in the order of the file; and the
    joint that carries each.
    """

    root: str
    links: Mapping[str, Element]
    carried: Mapping[str, Joint]

    @cached_property
    def _joints(self) -> Mapping[str, Joint]:
        return {joint.name: joint for joint in self.carried.values()}

    def joint(self, name: str) -> Joint:
        """The joint of a name."""
        return self._joints[name]


def read_tree(robot: Element) -> Tree:
    """The tree of a robot. Raises `SceneError` for the first mistake."""
    links: dict[str, Element] = {}
    for element in robot.all("link"):
        name = required(element, "name", "a link")
        if name in links:
            raise _twice(name, links[name], element, "link")
        links[name] = element
    if not links:
        raise robot.error("has no links; give a robot with <link> and <joint>")
    if len(links) > MOST:
        raise robot.error(f"has {len(links)} links; at most {MOST} are allowed")
    joints: dict[str, Joint] = {}
    carried: dict[str, Joint] = {}
    for element in robot.all("joint"):
        joint = _joint(element)
        if joint.name in joints:
            raise _twice(joint.name, joints[joint.name].element, element, "joint")
        for tag, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in links:
                hint = nearest(link, links) or "; name one of the links"
                raise element.error(
                    f"joint '{brief(joint.name)}': no {tag} link is named '{brief(link)}'{hint}"
                )
        if joint.child in carried:
            other = carried[joint.child].name
            raise element.error(
                f"joint '{brief(joint.name)}': its child link '{brief(joint.child)}' is carried by "
                f"joint '{brief(other)}' already; a URDF has no loops"
            )
        joints[joint.name] = carried[joint.child] = joint
    _check_mimics(joints)
    return _ordered(robot, links, carried)


def _twice(name: str, first: Element, second: Element, what: str) -> SceneError:
    return second.error(
        f"{what} '{brief(name)}' is given twice, also in line {first.line}; give each its own name"
    )


def _joint(element: Element) -> Joint:
    name = required(element, "name", "a joint")
    what = f"joint '{brief(name)}'"
    kind = required(element, "type", what)
    if kind not in KINDS:
        hint = nearest(kind, KINDS) or f"; known: {', '.join(KINDS)}"
        raise element.error(f"{what}: unknown type '{brief(kind)}'{hint}")
    origin = element.first("origin")
    axis = vector(element.first("axis"), "xyz", what, (1.0, 0.0, 0.0))
    if kind not in ("fixed", "floating") and not any(axis):
        raise element.error(f"{what}: <axis> xyz has no length; give a direction")
    damping, friction = (
        number(dynamics, key, what, 0.0) if (dynamics := element.first("dynamics")) else 0.0
        for key in ("damping", "friction")
    )
    for key, value in (("damping", damping), ("friction", friction)):
        if value < 0:
            raise element.error(f"{what}: {key} {value:g} is negative; give a number >= 0")
    return Joint(
        name,
        kind,
        required(child(element, "parent", what), "link", what),
        required(child(element, "child", what), "link", what),
        vector(origin, "xyz", what),
        vector(origin, "rpy", what),
        axis,
        _limits(element, kind, what),
        damping,
        friction,
        _mimic(element, what),
        element,
    )


def _limits(element: Element, kind: str, what: str) -> tuple[float, float] | None:
    limit = element.first("limit")
    if limit is None or kind not in ("revolute", "prismatic"):
        return None
    return (number(limit, "lower", what, 0.0), number(limit, "upper", what, 0.0))


def _mimic(element: Element, what: str) -> Mimic | None:
    mimic = element.first("mimic")
    if mimic is None:
        return None
    return Mimic(
        required(mimic, "joint", what),
        number(mimic, "multiplier", what, 1.0),
        number(mimic, "offset", what, 0.0),
    )


def _check_mimics(joints: Mapping[str, Joint]) -> None:
    """Raise `SceneError` for a joint that mimics one that does not exist, or itself."""
    for joint in joints.values():
        seen, now = [joint.name], joint
        while now.mimic is not None:
            what = f"joint '{brief(now.name)}'"
            if now.mimic.of not in joints:
                hint = nearest(now.mimic.of, joints) or "; name one of the joints"
                raise now.element.error(
                    f"{what}: mimics '{brief(now.mimic.of)}', which is no joint{hint}"
                )
            now = joints[now.mimic.of]
            if now.name in seen:
                raise joint.element.error(
                    f"joint '{brief(joint.name)}': mimics itself, through "
                    f"{len(seen)} joint{'s' * (len(seen) > 1)}; let one of them move freely"
                )
            seen.append(now.name)


def _ordered(robot: Element, links: Mapping[str, Element], carried: Mapping[str, Joint]) -> Tree:
    """The tree with each link followed by all that it carries, in the order of the joints.

    Raises `SceneError` unless it has one root.
    """
    roots = [name for name in links if name not in carried]
    if not roots:
        raise robot.error("has no root: its joints form a circle; leave one link without a parent")
    if len(roots) > 1:
        first, second = (f"'{brief(name)}'" for name in roots[:2])
        raise links[roots[1]].error(
            f"has {len(roots)} links without a parent, {first} and {second}"
            f"{' and more' * (len(roots) > 2)}; connect them by joints, a tree has one root"
        )
    children: dict[str, list[str]] = {}
    for name, joint in carried.items():
        children.setdefault(joint.parent, []).append(name)
    order, pending = dict[str, None](), [roots[0]]
    while pending:
        name = pending.pop()
        order[name] = None
        pending += reversed(children.get(name, ()))
    if len(order) < len(links):
        lost = next(name for name in links if name not in order)
        raise links[lost].error(
            f"link '{brief(lost)}' is not connected to the root '{brief(roots[0])}': joints form a "
            "circle; a tree has none"
        )
    return Tree(roots[0], {name: links[name] for name in order}, carried)


def moved(tree: Tree) -> Sequence[Joint]:
    """The joints in the order of the links that they carry."""
    return [tree.carried[name] for name in tree.links if name != tree.root]
