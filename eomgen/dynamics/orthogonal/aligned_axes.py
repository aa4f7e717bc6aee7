"""Axes of frames on ball joints, with one axis along the arm to the heaviest child.

The force of a heavy child acts at its joint. It has no moment about the arm to that joint. In any
other axes this zero would be a difference of products, and their rounding would exceed the light
inertia about the arm. Along a coordinate axis the zero is exact. Two heavy children have no moment
about the line between their joints. An axis can lie along one of these lines only: the one about
which the inertia is smaller beside the other moments.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from eomgen.dynamics.tree.forces import Wrench
from eomgen.dynamics.tree.kinematics import Link
from eomgen.dynamics.tree.rotations import (
    AxisRotation,
    ComposedRotation,
    IdentityRotation,
    Rotation,
)
from eomgen.dynamics.tree.solids import Ranks, Solid
from eomgen.dynamics.tree.vectors import AXES, Vec, add, sub, zeros
from eomgen.scalars.protocol import Scalar, Scalars


@dataclass(frozen=True)
class AlignedTree:
    """Links and their bodies in such axes.

    rotations  from these axes to the frames' own
    between    arms of links from the heaviest link on the same frame, where an axis is along them
    along      for each frame the axis that is along the heaviest child's arm, None if none is
    """

    links: tuple[Link, ...]
    carried: tuple[Solid | None, ...]
    rotations: tuple[Rotation, ...]
    between: Mapping[int, Vec]
    along: tuple[int | None, ...]

    def into(
        self, wrenches: Sequence[Wrench], tau: Sequence[Scalar]
    ) -> tuple[list[Wrench], list[Scalar]]:
        """Wrenches and generalised forces of the frames' own axes in the aligned axes."""
        pairs = zip(self.rotations, wrenches, strict=True)
        rotated = [Wrench(rotation.into(f.moment), rotation.into(f.force)) for rotation, f in pairs]
        found = list(tau)
        for rotation, link in zip(self.rotations, self.links, strict=True):
            if not isinstance(rotation, IdentityRotation):
                x, y, z = link.v
                found[x], found[y], found[z] = rotation.into((tau[x], tau[y], tau[z]))
        return rotated, found

    def out(self, rates: Sequence[Scalar]) -> list[Scalar]:
        """v̇ of the aligned axes as that of the frames' own axes."""
        found = list(rates)
        for rotation, link in zip(self.rotations, self.links, strict=True):
            if not isinstance(rotation, IdentityRotation):
                x, y, z = link.v
                found[x], found[y], found[z] = rotation.out((rates[x], rates[y], rates[z]))
        return found


def align_axes(
    links: Sequence[Link],
    carried: Sequence[Solid | None],
    ranks: Ranks,
    scalars: Scalars,
) -> AlignedTree:
    """Align the axes of frames on ball joints with the arms that `ranks` names. Frames on other
    joints keep their axes.
    """
    rotations: list[Rotation] = [IdentityRotation() for _ in links]
    heaviest, between = ranks.heaviest, dict[int, Vec]()
    aligned: list[int | None] = [None] * len(links)
    arms = {k: link.arm for k, link in enumerate(links)}
    for k, link in enumerate(links):
        child, spins = heaviest[k], [axis.angular for axis, _ in link.free] == [True] * 3
        # After massless frames the joint may be free in all directions: inertia acts along the arm.
        loose = link.parent >= 0 and carried[link.parent] is None
        other = ranks.beside[k]
        if child >= 0 and spins and other >= 0:
            rotations[k], between[other] = _along(sub(links[other].arm, links[child].arm), scalars)
            arms[child] = rotations[k].into(links[child].arm)
            arms[other] = add(arms[child], between[other])
        elif child >= 0 and spins and not loose:
            rotations[k], arms[child] = _along(links[child].arm, scalars)
            aligned[k] = next((j for j in AXES if not scalars.is_zero(arms[child][j])), None)
    found, bodies = [], []
    for k, link in enumerate(links):
        base = rotations[link.parent] if link.parent >= 0 else IdentityRotation()
        rotation = link.rotation
        if not isinstance(base, IdentityRotation):
            rotation = ComposedRotation(_back(base), rotation)
            if k not in (heaviest[link.parent], ranks.beside[link.parent]):
                arms[k] = base.into(link.arm)
        body = carried[k]
        if not isinstance(rotations[k], IdentityRotation):
            rotation = ComposedRotation(rotation, rotations[k])
            if body is not None:
                inertia = _back(rotations[k]).out_symmetric(body.inertia)
                body = replace(body, centre=rotations[k].into(body.centre), inertia=inertia)
        found.append(replace(link, rotation=rotation, arm=arms[k]))
        bodies.append(body)
    return AlignedTree(tuple(found), tuple(bodies), tuple(rotations), between, tuple(aligned))


def _along(arm: Vec, scalars: Scalars) -> tuple[Rotation, Vec]:
    """A rotation that brings a coordinate axis to an arm, and the arm on that axis."""
    nonzero = [j for j in AXES if not scalars.is_zero(arm[j])]
    if len(nonzero) < 2:
        return IdentityRotation(), arm
    zero = scalars.number(0.0)
    if len(nonzero) == 3:
        first, flat = _along((arm[0], arm[1], zero), scalars)
        second, left = _along((flat[0], zero, arm[2]), scalars)
        return ComposedRotation(first, second), left
    # A rotation about the third axis brings axis i, the next after it, to the arm.
    (k,) = (j for j in AXES if j not in nonzero)
    i, j = (k + 1) % 3, (k + 2) % 3
    length = scalars.call("sqrt", arm[i] * arm[i] + arm[j] * arm[j])
    # If a parameter makes the arm 0, the axes stay.
    none = scalars.number(1.0) - scalars.call("step", length)
    c, s = (arm[i] + none) / (length + none), arm[j] / (length + none)
    along = list(zeros(scalars))
    along[i] = length
    return AxisRotation(k, c, s, scalars.number(2.0) * c), (along[0], along[1], along[2])


def _back(rotation: Rotation) -> Rotation:
    if isinstance(rotation, ComposedRotation):
        return ComposedRotation(_back(rotation.inner), _back(rotation.outer))
    return replace(rotation, s=-rotation.s) if isinstance(rotation, AxisRotation) else rotation
