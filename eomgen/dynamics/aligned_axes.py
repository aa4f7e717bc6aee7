"""Axes of frames on ball joints along the line to the heaviest thing that they carry.

A heavy point pulls along that line and turns the frame about it by nothing at all, which sums of
products would hide in their rounding: along a coordinate axis the lever is no number, but absent.
So it is with two such points: neither turns the frame about the line between them. Axes can be
along one line only, and are along that whose turn is the lighter beside what turns it otherwise.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from eomgen.dynamics.forces import Wrench
from eomgen.dynamics.kinematics import Link
from eomgen.dynamics.rotations import AxisRotation, ComposedRotation, IdentityRotation, Rotation
from eomgen.dynamics.solids import Ranks, Solid
from eomgen.dynamics.vectors import AXES, Vec, add, sub, zeros
from eomgen.scalars.protocol import Scalar, Scalars


@dataclass(frozen=True)
class AlignedTree:
    """Links and what they carry in such axes; `rotations` lead from these to the frames' own.
    `between` has the arms of links from the heaviest on the same frame, where axes are along those;
    `along` the axis of each frame that is along the arm of the heaviest, if one is.
    """

    links: tuple[Link, ...]
    carried: tuple[Solid | None, ...]
    rotations: tuple[Rotation, ...]
    between: Mapping[int, Vec]
    along: tuple[int | None, ...]

    def into(
        self, wrenches: Sequence[Wrench], tau: Sequence[Scalar]
    ) -> tuple[list[Wrench], list[Scalar]]:
        """Wrenches on the frames, and what acts on the velocities."""
        pairs = zip(self.rotations, wrenches, strict=True)
        rotated = [Wrench(rotation.into(f.moment), rotation.into(f.force)) for rotation, f in pairs]
        found = list(tau)
        for rotation, link in zip(self.rotations, self.links, strict=True):
            if not isinstance(rotation, IdentityRotation):
                x, y, z = link.v
                found[x], found[y], found[z] = rotation.into((tau[x], tau[y], tau[z]))
        return rotated, found

    def out(self, rates: Sequence[Scalar]) -> list[Scalar]:
        """Rates of the velocities as they are asked for."""
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
    """Links, and what they carry, where `ranks` tell which links each has to look at. Frames on
    other joints keep their axes.
    """
    rotations: list[Rotation] = [IdentityRotation() for _ in links]
    heaviest, between = ranks.heaviest, dict[int, Vec]()
    ways: list[int | None] = [None] * len(links)
    arms = {k: link.arm for k, link in enumerate(links)}
    for k, link in enumerate(links):
        child, spins = heaviest[k], [axis.angular for axis, _ in link.free] == [True] * 3
        # What is free to move in all ways, by frames of no mass before, resists along that line.
        loose = link.parent >= 0 and carried[link.parent] is None
        other = ranks.beside[k]
        if child >= 0 and spins and other >= 0:
            rotations[k], between[other] = _along(sub(links[other].arm, links[child].arm), scalars)
            arms[child] = rotations[k].into(links[child].arm)
            arms[other] = add(arms[child], between[other])
        elif child >= 0 and spins and not loose:
            rotations[k], arms[child] = _along(links[child].arm, scalars)
            ways[k] = next((j for j in AXES if not scalars.is_zero(arms[child][j])), None)
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
    return AlignedTree(tuple(found), tuple(bodies), tuple(rotations), between, tuple(ways))


def _along(arm: Vec, scalars: Scalars) -> tuple[Rotation, Vec]:
    """A rotation that brings a coordinate axis to an arm, and the arm on that axis."""
    ways = [j for j in AXES if not scalars.is_zero(arm[j])]
    if len(ways) < 2:
        return IdentityRotation(), arm
    zero = scalars.number(0.0)
    if len(ways) == 3:
        first, flat = _along((arm[0], arm[1], zero), scalars)
        second, left = _along((flat[0], zero, arm[2]), scalars)
        return ComposedRotation(first, second), left
    # A turn about the third axis brings axis i, the next after it, to the arm.
    (k,) = (j for j in AXES if j not in ways)
    i, j = (k + 1) % 3, (k + 2) % 3
    length = scalars.call("sqrt", arm[i] * arm[i] + arm[j] * arm[j])
    # An arm that a user makes 0 keeps its axes.
    none = scalars.number(1.0) - scalars.call("step", length)
    c, s = (arm[i] + none) / (length + none), arm[j] / (length + none)
    along = list(zeros(scalars))
    along[i] = length
    return AxisRotation(k, c, s, scalars.number(2.0) * c), (along[0], along[1], along[2])


def _back(rotation: Rotation) -> Rotation:
    if isinstance(rotation, ComposedRotation):
        return ComposedRotation(_back(rotation.inner), _back(rotation.outer))
    return replace(rotation, s=-rotation.s) if isinstance(rotation, AxisRotation) else rotation
