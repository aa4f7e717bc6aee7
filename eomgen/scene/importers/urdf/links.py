"""Masses and inertias of links."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from eomgen.base.text import brief
from eomgen.scene.importers.attributes import child, number, vector
from eomgen.scene.importers.rotations import cleaned, is_slight, rotated_inertia, rotation
from eomgen.scene.importers.urdf.tree import Tree
from eomgen.scene.importers.vectors import ORIGIN, Vector
from eomgen.scene.importers.xml_elements import Element
from eomgen.scene.joints.base import WORLD

Array = npt.NDArray[np.float64]

ENTRIES = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
TOLERANCE = 2e-4
"""Part of the trace by which a principal moment may exceed the other two; scenes allow more."""
ROUNDING = 1e-15
"""Entries of an inertia below this, m², times the mass are rounding errors of 0."""


@dataclass(frozen=True)
class Inertial:
    """Mass, centre of mass and inertia about it, all in the link's axes.

    entries  xx, yy, zz, xy, xz, yz
    moments  the principal moments, in ascending order
    """

    mass: float = 0.0
    com: Vector = ORIGIN
    entries: tuple[float, ...] = (0.0,) * 6
    moments: tuple[float, ...] = (0.0,) * 3

    @property
    def is_strange(self) -> bool:
        """Whether no body can have this inertia."""
        low, middle, high = self.moments
        return high - low - middle > TOLERANCE * (low + middle + high) or low < 0

    def table(self, name: str) -> dict[str, Any]:
        """The table of a body in its own axes."""
        xx, yy, zz, *products = self.entries
        found: dict[str, Any] = {"name": name, "mass": self.mass, "com": list(self.com)}
        found["inertia_com"] = [xx, yy, zz, *(products if any(products) else ())]
        return found | ({"inertia_check": "off"} if self.is_strange else {})


@dataclass
class Changes:
    """Links whose inertia was changed or left out, or taken as it is though no body has it."""

    rounded: list[str] = field(default_factory=list)
    lent: list[str] = field(default_factory=list)
    still: list[str] = field(default_factory=list)
    strange: list[str] = field(default_factory=list)


def read_inertials(tree: Tree, *, floating: bool) -> tuple[dict[str, Inertial], Changes]:
    """The inertias of all links by name; none is negative together with what is fixed to it.

    A link without mass may have an inertia if it cannot move, where it is left out, as all of the
    world is, or is fixed to one with mass, which then has it: the motion is the same. The root
    moves if it is `floating`. Raises `SceneError` for what is missing or negative.
    """
    found, changes = dict[str, Inertial](), Changes()
    still = set[str]() if floating else {tree.root}
    for name, element in tree.links.items():
        joint = tree.carried.get(name)
        if joint is not None and joint.kind == "fixed" and joint.parent in still:
            still.add(name)
        found[name] = _read(element, name, changes)
    for name in reversed(list(tree.links)):
        is_idle = found[name].mass == 0 and any(found[name].entries)
        if name in still and (is_idle or (name == WORLD and found[name].mass)):
            found[name] = Inertial(com=found[name].com)
            changes.still.append(name)
        elif is_idle:
            _lend(tree, name, found)
            changes.lent.append(name)
    changes.strange += [name for name, inertial in found.items() if inertial.is_strange]
    for name in changes.strange:
        if found[name].moments[0] < 0:
            _check_group(tree, name, found)
    return found, changes


def _read(element: Element, name: str, changes: Changes) -> Inertial:
    inertial, what = element.first("inertial"), f"link '{brief(name)}'"
    if inertial is None:
        return Inertial()
    mass = number(child(inertial, "mass", what), "value", what)
    if mass < 0:
        raise inertial.error(f"{what}: its mass {mass:g} is negative; give a number >= 0")
    given = child(inertial, "inertia", what)
    entries = [number(given, key, what, 0.0 if key[1] != key[2] else None) for key in ENTRIES]
    given_com = vector(inertial.first("origin"), "xyz", what)
    whole = [0.0 if abs(x) < ROUNDING * mass else x for x in entries]
    if whole != entries or any(map(is_slight, given_com)):
        changes.rounded.append(name)
    entries = whole
    for key, moment in zip(ENTRIES[:3], entries, strict=False):
        if moment < 0:
            raise given.error(f"{what}: {key} {moment:g} is negative; give a number >= 0")
    origin = inertial.first("origin")
    turned = rotated_inertia(entries, rotation(vector(origin, "rpy", what)))
    x, y, z = cleaned(given_com)
    return _with(Inertial(mass, (x, y, z)), turned)


def _with(inertial: Inertial, entries: Sequence[float]) -> Inertial:
    """An inertial with other entries."""
    scale = max(map(abs, entries)) or 1.0
    moments = np.linalg.eigvalsh(_matrix(entries) / scale)
    slight = 1e-12 * float(moments[-1])
    values = [0.0 if -slight <= float(x) < 0 else float(x) * scale for x in moments]
    return replace(inertial, entries=tuple(entries), moments=tuple(values))


def _matrix(entries: Sequence[float]) -> Array:
    xx, yy, zz, xy, xz, yz = entries
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _lend(tree: Tree, name: str, found: dict[str, Inertial]) -> None:
    """Count the inertia of a link without mass with the link that it is fixed to."""
    joint = tree.carried.get(name)
    if joint is None or joint.kind != "fixed":
        raise tree.links[name].error(
            f"link '{brief(name)}': has an inertia but no mass; give it a mass, or no inertia"
        )
    turned = rotated_inertia(found[name].entries, rotation(joint.angles))
    carrier = found[joint.parent]
    total = [a + b for a, b in zip(carrier.entries, turned, strict=True)]
    found[name] = Inertial(com=found[name].com)
    found[joint.parent] = _with(carrier, total)


def _check_group(tree: Tree, name: str, found: Mapping[str, Inertial]) -> None:
    """Raise `SceneError` if the inertia of all links that are fixed to one another is negative."""
    top = name
    while top in tree.carried and tree.carried[top].kind == "fixed":
        top = tree.carried[top].parent
    poses: dict[str, tuple[Array, Array]] = {top: (np.eye(3), np.zeros(3))}
    for other in tree.links:
        joint = tree.carried.get(other)
        if joint is not None and joint.kind == "fixed" and joint.parent in poses:
            turn, at = poses[joint.parent]
            poses[other] = turn @ np.array(rotation(joint.angles)), at + turn @ np.array(joint.at)
    masses = {other: found[other].mass for other in poses}
    centres = {other: at + turn @ np.array(found[other].com) for other, (turn, at) in poses.items()}
    mass = sum(masses.values())
    middle = sum(masses[other] * centres[other] for other in poses) / (mass or 1.0)
    total = np.zeros((3, 3))
    for other, (turn, _) in poses.items():
        arm = centres[other] - middle
        total += turn @ _matrix(found[other].entries) @ turn.T
        total += masses[other] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    if np.linalg.eigvalsh(total)[0] < 0:
        raise tree.links[name].error(
            f"link '{brief(name)}': its inertia has a principal moment of "
            f"{found[name].moments[0]:.3g} kg m^2, which is negative; correct the entries"
        )
