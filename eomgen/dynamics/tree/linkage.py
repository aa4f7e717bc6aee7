"""A model as a tree of frames, with one joint primitive between each frame and its parent.

A joint with several primitives is a chain of frames, all but the last massless. A weld adds no
frame, and neither does a locked coordinate: the body is on its parent's frame. The axes of a frame
are those of its body, rotated so that the axis of the primitive is a coordinate axis. A joint whose
orientation is given by formulas of parameters has a fixed frame for it, before its others.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from eomgen.dynamics.tree.axes import (
    is_graded,
    is_straight,
    with_simple_axes,
    with_simple_origins,
)
from eomgen.dynamics.tree.frames import Frame, Linkage, Mount, Rigid, joined
from eomgen.dynamics.tree.rotations import held_rotation
from eomgen.dynamics.tree.vectors import (
    ENTRIES,
    Symmetric,
    Vec,
    add,
    congruent,
    constant,
    in_space,
    no_matrix,
    plus,
    scale,
    sub,
    symmetric,
    times,
    zeros,
)
from eomgen.language.formula import Formula, evaluate
from eomgen.model.bodies import Body
from eomgen.model.model import Model
from eomgen.model.orientation import rows_of
from eomgen.scalars import exact
from eomgen.scalars.exact import EYE, ZERO, Matrix, Real
from eomgen.scalars.floats import FloatScalars
from eomgen.scalars.protocol import Scalar, Scalars
from eomgen.scene.joints import Joint
from eomgen.scene.joints.base import Primitive, WithRotor


def make_linkage(model: Model, parameters: Mapping[str, Scalar], scalars: Scalars) -> Linkage:
    """The frames and mounts of a model, over given values of its parameters."""
    frames, mounts = _drafted(model, parameters, scalars)
    graded = not all(is_straight(frame.fixed) for frame in frames) and _is_graded(model)
    if model.dimensions == 3:
        frames, mounts = with_simple_axes(frames, mounts, scalars, graded=graded)
    frames, mounts = with_simple_origins(frames, mounts, scalars, graded=graded)
    rigids = [_nothing(scalars)] * len(frames)
    for mount in mounts:
        if mount.frame >= 0:
            rigids[mount.frame] = joined(rigids[mount.frame], _about_origin(mount, model, scalars))
    finished = (
        replace(frame, rigid=_named(rigid, frame.name, scalars))
        for frame, rigid in zip(frames, rigids, strict=True)
    )
    return Linkage(tuple(finished), tuple(mounts), model.dimensions == 2)


def _is_graded(model: Model) -> bool:
    """Whether the geometry, or a direction of gravity, has slight components (see `axes`)."""
    floats = FloatScalars()
    frames, mounts = _drafted(model, model.defaults, floats)
    directions = (getattr(e, key) for e in model.effects for key in e.direction_fields)
    return is_graded(frames, mounts, [in_space(d, floats) for d in directions if d])


def _drafted(
    model: Model, parameters: Mapping[str, Scalar], scalars: Scalars
) -> tuple[list[Frame], list[Mount]]:
    """Frames without mass, and mounts."""

    def value(formula: Formula) -> Scalar:
        return evaluate(formula, parameters, scalars)

    def vector(parts: tuple[Formula, ...]) -> Vec:
        return in_space([value(part) for part in parts], scalars)

    drafts: list[Frame] = []
    mounts: list[Mount] = []
    nv = len(model.velocities)
    for index in model.joint_indices:
        body = index.body
        joint, point, armature = body.joint, zeros(scalars), scalars.number(0.0)
        place = _place_of(mounts[body.parent]) if body.parent >= 0 else _origin(-1, scalars)
        if joint.holds:
            place = _at_joint(place, joint, vector(joint.r_parent), model.dimensions, scalars)
            point = vector(joint.r_child)
            if isinstance(joint, WithRotor):
                armature = value(joint.reflected_inertia)
            if joint.orientation is not None:
                drafts.append(_held(place, body, rows_of(joint.orientation), value, scalars))
                place = _origin(len(drafts) - 1, scalars)
        primitives = joint.primitives(model.dimensions)
        for i, primitive in enumerate(primitives):
            name = body.positions[i].name
            if name in dict(model.locked):
                place = _locked(place, primitive, name, model, scalars)
                continue
            to_axis, k = _to_coordinate_axis(primitive)
            tilt = exact.angle_of(to_axis[0][0], to_axis[1][0])
            spins = primitive.kind == "spherical"
            v = index.spin if spins else index.v[i : i + 1]
            drafts.append(
                Frame(
                    name=body.name if i == len(primitives) - 1 else f"{body.name}_{i + 1}",
                    parent=place.frame,
                    offset=place.at,
                    fixed=exact.product(place.axes, to_axis),
                    kind=primitive.kind,
                    axis=k,
                    angle=exact.total(place.angle, tilt),
                    lead=ZERO,
                    q=index.quaternion if spins else index.q[i : i + 1],
                    v=v,
                    armature=armature,
                    rigid=_nothing(scalars),
                    driven=v[0] >= nv,
                )
            )
            axes, angle = exact.transposed(to_axis), exact.opposite(tilt)
            place = _Place(len(drafts) - 1, axes, angle, zeros(scalars))
        at = sub(place.at, times(constant(place.axes, scalars), point))
        mass, entries = value(body.mass), [value(entry) for entry in body.inertia_com]
        inertia = _inertia(body, entries, scalars)
        mounts.append(Mount(place.frame, place.axes, place.angle, at, point, mass, inertia))
    return drafts, mounts


@dataclass(frozen=True)
class _Place:
    """A point `at` on a frame with axes; see `Mount`."""

    frame: int
    axes: Matrix
    angle: Real
    at: Vec


def _origin(frame: int, scalars: Scalars) -> _Place:
    """That of a frame, or of the world."""
    return _Place(frame, EYE, ZERO, zeros(scalars))


def _place_of(mount: Mount) -> _Place:
    """A body's centre of mass."""
    return _Place(mount.frame, mount.axes, mount.angle, mount.at)


def _at_joint(place: _Place, joint: Joint, r: Vec, dimensions: int, scalars: Scalars) -> _Place:
    """The place of a joint, at `r` from its parent's, with its fixed orientation."""
    angle = place.angle
    if dimensions == 2:
        assert isinstance(joint.orientation_deg, float | int)
        angle = exact.total(angle, exact.radians(joint.orientation_deg))
    axes = exact.product(place.axes, exact.orientation(joint.orientation_deg))
    at = add(place.at, times(constant(place.axes, scalars), r))
    return replace(place, axes=axes, angle=angle, at=at)


def _locked(
    place: _Place, primitive: Primitive, name: str, model: Model, scalars: Scalars
) -> _Place:
    """The place behind a locked coordinate."""
    to_axis, k = _to_coordinate_axis(primitive)
    if primitive.kind == "prismatic":
        length = dict(model.locked)[name]
        offset = exact.image_of_axis(exact.product(place.axes, to_axis), k, length)
        return replace(place, at=add(place.at, _numbers(offset, scalars)))
    held = model.locked_angle(name)
    back = exact.product(exact.rotation_about(k, held), exact.transposed(to_axis))
    axes = exact.product(place.axes, exact.product(to_axis, back))
    turned = held if primitive.axis[2] > 0 else exact.opposite(held)
    return replace(place, axes=axes, angle=exact.total(place.angle, turned))


def _held(
    place: _Place,
    body: Body,
    rows: Sequence[Sequence[Formula]],
    value: Callable[[Formula], Scalar],
    scalars: Scalars,
) -> Frame:
    """A frame at a place, rotated by formulas."""
    return Frame(
        name=f"{body.name}_orientation",
        parent=place.frame,
        offset=place.at,
        fixed=place.axes,
        kind="fixed",
        axis=2,
        angle=place.angle,
        lead=ZERO,
        q=(),
        v=(),
        armature=scalars.number(0.0),
        rigid=_nothing(scalars),
        driven=False,
        held=held_rotation(rows, value, scalars),
        turn=value(rows[0][0]),
    )


def _numbers(vector: Sequence[Real], scalars: Scalars) -> Vec:
    x, y, z = (scalars.number(part) for part in vector)
    return (x, y, z)


def _inertia(body: Body, entries: list[Scalar], scalars: Scalars) -> Symmetric:
    zero = scalars.number(0.0)
    if len(entries) == 1:  # in the plane only the moment about z is used
        entries = [zero, zero, entries[0], zero, zero, zero]
    return symmetric(entries)


def _nothing(scalars: Scalars) -> Rigid:
    return Rigid(scalars.number(0.0), zeros(scalars), no_matrix(scalars))


def _about_origin(mount: Mount, model: Model, scalars: Scalars) -> Rigid:
    """Mass, first moment and inertia of a body about the origin of its frame (parallel axes)."""
    m, (x, y, z) = mount.mass, mount.at
    zero = scalars.number(0.0)
    first = scale(m, mount.at)
    if model.dimensions == 2:
        moved = symmetric([zero, zero, first[0] * x + first[1] * y, zero, zero, zero])
        return Rigid(m, first, plus(mount.inertia, moved))
    xx, yy, zz = first[0] * x, first[1] * y, first[2] * z
    moved = symmetric(
        [yy + zz, xx + zz, xx + yy, -(first[0] * y), -(first[0] * z), -(first[1] * z)]
    )
    rotated = congruent(constant(mount.axes, scalars), mount.inertia)
    return Rigid(m, first, plus(rotated, moved))


def _named(rigid: Rigid, name: str, scalars: Scalars) -> Rigid:
    """The same, with names for its numbers in a program."""
    m = scalars.named(rigid.mass, f"mass_{name}")
    first = [
        scalars.named(h, f"moment_{name}_{axis}")
        for h, axis in zip(rigid.first_moment, "xyz", strict=True)
    ]
    entries = [
        scalars.named(rigid.inertia[i][j], f"inertia_{name}_{'xyz'[i]}{'xyz'[j]}")
        for i, j in ENTRIES
    ]
    return Rigid(m, (first[0], first[1], first[2]), symmetric(entries))


def _to_coordinate_axis(primitive: Primitive) -> tuple[Matrix, int]:
    """A rotation R and a coordinate axis k, with R e_k along the primitive's axis."""
    return (EYE, 2) if primitive.kind == "spherical" else exact.to_axis(primitive.axis)
