"""A model as a tree of frames, with one joint primitive between each frame and its parent.

A joint with several primitives is a chain of frames, all but the last massless. A weld adds no
frame, and neither does a locked coordinate: the body is on its parent's frame. The axes of a frame
are those of its body, rotated so that the axis of the primitive is a coordinate axis. A joint whose
orientation is given by formulas of parameters has a fixed frame for it, before its others.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

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
from eomgen.model.model import Body, Model
from eomgen.model.orientation import rows_of
from eomgen.scalars import exact
from eomgen.scalars.exact import EYE, ZERO, Matrix, Real
from eomgen.scalars.floats import FloatScalars
from eomgen.scalars.protocol import Scalar, Scalars
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
    locked = dict(model.locked)
    nv = len(model.velocities)
    for index in model.joint_indices:
        body = index.body
        frame, axes, angle, at = -1, EYE, ZERO, zeros(scalars)
        if body.parent >= 0:
            parent = mounts[body.parent]
            frame, axes, angle, at = parent.frame, parent.axes, parent.angle, parent.at
        joint, point, armature = body.joint, zeros(scalars), scalars.number(0.0)
        if joint.holds:
            at = add(at, times(constant(axes, scalars), vector(joint.r_parent)))
            axes = exact.product(axes, exact.orientation(joint.orientation_deg))
            if model.dimensions == 2:
                assert isinstance(joint.orientation_deg, float | int)
                angle = exact.total(angle, exact.radians(joint.orientation_deg))
            point = vector(joint.r_child)
            if isinstance(joint, WithRotor):
                armature = joint.reflected_inertia(value)
            if joint.orientation is not None:
                held = _held(rows_of(joint.orientation), value, scalars)
                place = {"parent": frame, "offset": at, "fixed": axes, "angle": angle}
                drafts.append(replace(held, name=f"{body.name}_orientation", **place))
                frame, axes, angle, at = len(drafts) - 1, EYE, ZERO, zeros(scalars)
        primitives = joint.primitives(model.dimensions)
        for i, primitive in enumerate(primitives):
            to_axis, k = _to_coordinate_axis(primitive)
            name = body.positions[i].name
            if name in locked and primitive.kind == "prismatic":
                offset = exact.image_of_axis(exact.product(axes, to_axis), k, locked[name])
                at = add(at, _numbers(offset, scalars))
                continue
            if name in locked:
                held = model.locked_angle(name)
                back = exact.product(exact.rotation_about(k, held), exact.transposed(to_axis))
                axes = exact.product(axes, exact.product(to_axis, back))
                angle = exact.total(angle, held if primitive.axis[2] > 0 else exact.opposite(held))
                continue
            tilt = exact.angle_of(to_axis[0][0], to_axis[1][0])
            spins = primitive.kind == "spherical"
            v = index.spin if spins else index.v[i : i + 1]
            drafts.append(
                Frame(
                    name=body.name if i == len(primitives) - 1 else f"{body.name}_{i + 1}",
                    parent=frame,
                    offset=at,
                    fixed=exact.product(axes, to_axis),
                    kind=primitive.kind,
                    axis=k,
                    angle=exact.total(angle, tilt),
                    lead=ZERO,
                    q=index.quaternion if spins else index.q[i : i + 1],
                    v=v,
                    armature=armature,
                    rigid=_nothing(scalars),
                    driven=v[0] >= nv,
                )
            )
            frame, at = len(drafts) - 1, zeros(scalars)
            axes, angle = exact.transposed(to_axis), exact.opposite(tilt)
        at = sub(at, times(constant(axes, scalars), point))
        mounts.append(
            Mount(
                frame,
                axes,
                angle,
                at,
                point,
                value(body.mass),
                _inertia(body, [value(entry) for entry in body.inertia_com], scalars),
            )
        )
    return drafts, mounts


def _held(
    rows: Sequence[Sequence[Formula]], value: Callable[[Formula], Scalar], scalars: Scalars
) -> Frame:
    """A frame without name, in the axes of its parent, but for a rotation by formulas."""
    return Frame(
        name="",
        parent=-1,
        offset=zeros(scalars),
        fixed=EYE,
        kind="fixed",
        axis=2,
        angle=ZERO,
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
