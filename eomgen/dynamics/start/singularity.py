"""Whether the mass matrix is singular: checked in numbers, before code is written."""

import math
import random
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from eomgen.base.errors import SceneError
from eomgen.dynamics.tree.articulated import (
    ArticulatedInertia,
    eliminated,
    inertia_along,
    joined,
    moved_to_parent,
    rigid_body_inertia,
)
from eomgen.dynamics.tree.composite import composite_bodies
from eomgen.dynamics.tree.kinematics import Axes, tree_kinematics
from eomgen.dynamics.tree.linkage import make_linkage
from eomgen.dynamics.tree.vectors import Mat
from eomgen.language.formula import Constant, Formula
from eomgen.model.bodies import Body
from eomgen.model.model import Model
from eomgen.scalars.exact import exactly
from eomgen.scalars.floats import ArrayScalars
from eomgen.scalars.protocol import Scalars
from eomgen.scene.joints.base import Geared, WithRotor

Array = npt.NDArray[np.float64]

TRIALS = 3
TOGETHER = 4096
"""Poses that are evaluated together. This bounds the memory for a long run."""
VANISHED = 1e-12
"""A pivot below this part of its diagonal entry may be rounding."""
NOTHING = 1e-300
"""A pivot below this part is 0 in the digits of `exact`: axes 1e-100 from parallel leave more."""
UNDERFLOW = 1e-290
"""A pivot below this is 0 in doubles."""


def check_nonsingular(model: Model) -> None:
    """Raise `SceneError`, naming the body and what to change, if the mass matrix is singular.

    M is singular if some motion moves no mass, whatever the masses are. So all masses are set to 1,
    which avoids rounding. The pivots of the articulated-body algorithm are checked at seeded random
    poses: one that is 0 there is 0 at almost all poses. A pivot in doubt is computed in extended
    precision.
    """
    count = len(model.coordinates) + len(model.driven)
    even, poses = _evened(model), _seeded(random.Random(20), count)
    if not _vanishing(_pivots(even, poses, ArrayScalars()), VANISHED):
        return
    # Imported here, since a regular model does not need it, nor does a run.
    from eomgen.scalars.extended import Bits

    with exactly():
        (first, *_), bits = poses, Bits()
        pose = np.array([[bits.number(x) for x in first.tolist()]], dtype=object)
        vanishing = _vanishing(_pivots(even, pose, bits, NOTHING), NOTHING)
    if vanishing:
        raise SceneError(_singular(model, vanishing[0]))


def _vanishing(pivots: Mapping[int, tuple[Array, Array]], share: float) -> list[int]:
    """The velocities, last first, whose pivots are below a part of their entries at all poses."""
    return [
        i
        for i, (pivot, entry) in sorted(pivots.items(), reverse=True)
        if not ((pivot > share * entry) & (pivot > UNDERFLOW)).any()
    ]


def relative_pivots(model: Model, poses: Array) -> dict[int, Array]:
    """For each velocity its articulated-body pivot at n poses (n, nq), relative to the greatest at
    any of these and a few seeded poses: (n,). 1 where all of it is rounding, as with arms of 1e9 m.

    As in `check_nonsingular` all masses are 1: a heavy body on a light one is not a gimbal lock. In
    gimbal lock, axes are in line, some motion moves no mass, and its pivot is 0: M is singular.
    """
    some = _seeded(random.Random(20), len(model.coordinates))
    even, asked = _evened(model), np.concatenate([poses, some])
    parts = np.array_split(asked, math.ceil(len(asked) / TOGETHER))
    found = [_pivots(even, part, ArrayScalars()) for part in parts]
    shares = {}
    for i in found[0]:
        pivot, entry = (np.concatenate([pivots[i][n] for pivots in found]) for n in (0, 1))
        largest = pivot.max()
        if largest < VANISHED * entry.max():  # rounding at every pose
            shares[i] = np.ones(len(poses))
        else:
            shares[i] = pivot[: len(poses)] / largest if largest > 0 else np.zeros(len(poses))
    return shares


def why_unresisted(model: Model, i: int) -> tuple[str, str]:
    """A message that velocity `i` has almost no inertia: the reason, and what to change."""
    body = next(index.body for index in model.joint_indices if i in index.v)
    where = f"'{model.velocities[i].name}' of joint '{body.joint.name}'"
    if model.dimensions == 3:
        return (
            f"next to nothing resists {where}, gimbal lock: a turn about its axis moves no mass",
            "give it inertia, or take a joint of type 'ball'",
        )
    return f"next to nothing resists {where}: it moves no mass", "give it some, or keep away"


def _seeded(rng: random.Random, count: int) -> Array:
    return np.array([[rng.uniform(-1.5, 1.5) for _ in range(count)] for _ in range(TRIALS)])


def _evened(model: Model) -> Model:
    """The model with masses of 1."""
    return replace(model, bodies=tuple(_evened_body(body, model) for body in model.bodies))


def _evened_body(body: Body, model: Model) -> Body:
    """A body with mass, inertia and rotor inertia of size 1 where they are not 0."""

    def size(formula: Formula, unit: float = 1.0) -> Constant:
        return Constant(model.value(formula) / unit if unit else 0.0)

    entries = [abs(model.value(entry)) for entry in body.inertia_com]
    joint = body.joint
    if isinstance(joint, WithRotor):
        rotor = Constant(float(model.value(joint.reflected_inertia) > 0))
        joint = joint.replaced(motor_inertia=rotor)
        if isinstance(joint, Geared):
            joint = joint.replaced(gear_ratio=None)
    return replace(
        body,
        mass=Constant(float(model.value(body.mass) > 0)),
        inertia_com=tuple(size(entry, max(entries)) for entry in body.inertia_com),
        joint=joint,
    )


def _pivots(
    model: Model, poses: Array, scalars: Scalars, vanished: float = VANISHED
) -> dict[int, tuple[Array, Array]]:
    """For each velocity its pivots and its diagonal entries of M at n poses (n, nq), (n,) each. An
    axis with a pivot of 0 is not eliminated. With scalars that are not arrays, n is 1.
    """
    linkage = make_linkage(model, model.defaults, scalars)
    axes: Axes = "world" if model.dimensions == 2 else "own"
    coordinates = [x if len(x) > 1 else x[0] for x in poses.T]
    kinematics = tree_kinematics(linkage, coordinates, axes, scalars)
    bodies = composite_bodies(kinematics, scalars)
    sums = [rigid_body_inertia(link, 0.0) for link in kinematics.links]
    pivots: dict[int, tuple[Array, Array]] = {}
    for k in reversed(range(len(sums))):
        link, left = kinematics.links[k], sums[k]
        whole = rigid_body_inertia(replace(link, rigid=bodies[k]), 0.0)
        for axis, i in link.free:
            pivot, entry = (
                np.broadcast_to(inertia_along(p, axis) + link.armature, len(poses))
                for p in (left, whole)
            )
            pivots[i] = (pivot, entry)
            frees = (entry > 0) & (pivot >= vanished * entry)
            if frees.any():
                with np.errstate(all="ignore"):
                    left = _where(frees, eliminated(left, axis, link, scalars)[1], left)
        if link.parent >= 0:
            moved = moved_to_parent(link, left, scalars)
            sums[link.parent] = joined(sums[link.parent], moved)
    return pivots


def _where(
    here: npt.NDArray[np.bool_], a: ArticulatedInertia, b: ArticulatedInertia
) -> ArticulatedInertia:
    """One inertia at some of the poses, another at the rest."""
    if here.all():
        return a

    def chosen(x: Mat, y: Mat) -> Any:
        rows = zip(x, y, strict=True)
        return tuple(tuple(np.where(here, *ab) for ab in zip(*row, strict=True)) for row in rows)

    return ArticulatedInertia(chosen(a.J, b.J), chosen(a.G, b.G), chosen(a.H, b.H))


def _singular(model: Model, i: int) -> str:
    name = model.velocities[i].name
    body = next(index.body for index in model.joint_indices if i in index.v)
    found = (
        f"body '{body.name}': nothing resists '{name}', neither its mass or inertia nor what it "
        "carries"
    )
    if model.constraints:
        return (
            f"{found}, once the loops are cut; give it some, a millionth of its neighbours' will do"
        )
    return f"{found}; give it some, or a joint that does not move so"
