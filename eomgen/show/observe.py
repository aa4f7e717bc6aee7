"""From a trajectory to a motion: poses, energies and joint gaps, from the generated code."""

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol, cast

import numpy as np

from eomgen.language.formula import Formula
from eomgen.model.model import Model
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import FloatArray
from eomgen.run.trajectory import Trajectory
from eomgen.scene.appearance import Appearance
from eomgen.scene.effects import elements
from eomgen.scene.joints.base import Primitive
from eomgen.scene.look import number, numbers
from eomgen.show.balance import keeps_energy, works_by_type
from eomgen.show.framing import Framing
from eomgen.show.motion import Anchor, Motion, Plane
from eomgen.show.of_run import fixed_points, leading_bodies, spread, with_run
from eomgen.show.picture import Picture, picture_of
from eomgen.show.view import eye_axes
from eomgen.tables.poses import world_points


class _Joint(Protocol):
    """What all joints except the free one have."""

    name: str
    parent: str
    child: str
    r_parent: tuple[Formula, ...]
    r_child: tuple[Formula, ...]


def observe(
    model: Model,
    module: GeneratedModule,
    trajectory: Trajectory,
    appearance: Appearance,
    inputs: Mapping[str, float] | None = None,
) -> Motion:
    """The motion of a run, to be shown in a figure or page. It uses the default values of the
    model's parameters. `inputs` that are not given are 0. `appearance` is that of the scene.
    """
    columns = trajectory.y.T
    p = {parameter.name: parameter.default for parameter in model.parameters}
    with np.errstate(
        all="ignore"
    ):  # a run that was stopped may hold numbers whose squares overflow
        poses = np.moveaxis(module.body_poses(trajectory.t, columns, p), -1, 0)
        kinetic = module.kinetic_energy(trajectory.t, columns, p)
        potential = module.potential_energy(trajectory.t, columns, p)
        drift = joint_drift(model, poses)
    effects, works = trajectory.work_names, trajectory.works
    if works is not None:
        effects, works = works_by_type(model, effects, works)
    picture = with_run(picture_of(model, appearance, spread(poses)), model, poses)
    drawn = picture.valued(model.defaults, float(trajectory.t[-1]))
    shapes = tuple(body.shapes for body in drawn.bodies)
    camera = appearance.camera
    eye = eye_axes(camera.azimuth_deg, camera.elevation_deg)
    leading = leading_bodies(model)
    return Motion(
        name=model.name,
        title=model.title,
        t=trajectory.t,
        y=trajectory.y,
        states=trajectory.states,
        units=tuple(module.UNITS[name] for name in trajectory.states),
        positions=module.POSITIONS,
        bodies=module.BODIES,
        shapes=shapes,
        joints=tuple(joint.name for _, joint in _joints(model, _holds_a_point)),
        poses=poses,
        kinetic_energy=kinetic,
        potential_energy=potential,
        joint_drift=drift,
        framing=Framing(camera, module.BODIES, leading, shapes, poses, eye, fixed_points(drawn)),
        integrator=trajectory.integrator,
        finished=trajectory.finished,
        message=trajectory.message,
        anchors=_anchors(model, poses.ndim - 1),
        quaternions=tuple(getattr(module, "QUATERNIONS", ())),
        works=works,
        effects=effects,
        planes=planes_of(drawn),
        keeps_energy=keeps_energy(model, inputs or {}),
        picture=picture,
        drawn=drawn,
    )


def planes_of(drawn: Picture) -> tuple[Plane, ...]:
    """The planes of contacts with the world, without repeats."""
    planes = (e for e in drawn.elements if isinstance(e, elements.Plane))
    fixed = (e for e in planes if e.body == elements.WORLD_INDEX)
    return tuple(dict.fromkeys(Plane(numbers(e.normal), number(e.offset)) for e in fixed))


def joint_drift(model: Model, poses: FloatArray) -> FloatArray:
    """Distance between each joint's points on its parent and child, (n, nj), m.

    It covers joints that hold a point, in the order of their bodies, then those of loops. `poses`
    (n, nb, 3) or (n, nb, 3, 4) are as from `body_poses`. Only poses are used, so that it also shows
    joints that come apart in forms that integrate each body's position.
    """
    names = {body.name: k for k, body in enumerate(model.bodies)}
    dimensions = poses.ndim - 1

    def point(body: str, r: Sequence[Formula]) -> FloatArray:
        return world_points(poses, names.get(body, -1), _values(model, r, dimensions))

    gaps = []
    for _, joint in _joints(model, _holds_a_point):
        gap = point(joint.parent, joint.r_parent) - point(joint.child, joint.r_child)
        gap = np.broadcast_to(gap, (len(poses), dimensions))
        gaps.append(np.hypot(np.hypot(gap[..., 0], gap[..., 1]), gap[..., -1] * (dimensions == 3)))
    return np.array(gaps).reshape(len(gaps), len(poses)).T


def _joints(
    model: Model, chosen: Callable[[Sequence[Primitive]], bool]
) -> list[tuple[int, _Joint]]:
    """Joints `chosen` by their moves, except free ones, each with the index of its child body:
    those of the tree, then those that close loops.
    """
    names = {body.name: k for k, body in enumerate(model.bodies)}
    every = [*(body.joint for body in model.bodies), *(loop.joint for loop in model.loops)]
    return [
        (names.get(joint.child, -1), cast(_Joint, joint))
        for joint in every
        if chosen(joint.primitives(model.dimensions))
    ]


def _holds_a_point(primitives: Sequence[Primitive]) -> bool:
    """Whether a joint keeps a point of the parent and one of the child together."""
    return all(primitive.kind != "prismatic" for primitive in primitives)


def _is_marked(primitives: Sequence[Primitive]) -> bool:
    """Whether a picture marks a joint: it allows rotation about a point, or motion along a line."""
    return bool(primitives) and sum(primitive.kind == "prismatic" for primitive in primitives) < 2


def _anchors(model: Model, dimensions: int) -> tuple[Anchor, ...]:
    anchors: list[Anchor] = []
    for k, joint in _joints(model, _is_marked):
        if k < 0:  # a loop joint whose child is the world
            continue
        x, y, *z = _values(model, joint.r_child, dimensions).tolist()
        anchors.append((k, x, y, z[0]) if z else (k, x, y))
    return tuple(anchors)


def _values(model: Model, r: Sequence[Formula], dimensions: int) -> FloatArray:
    """A vector of the scene as numbers; zero if the scene omits it."""
    return np.array([model.value(part) for part in r] if r else [0.0] * dimensions)
