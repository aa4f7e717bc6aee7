"""From a scene to a model: every name resolved, bodies in a tree, everything checked."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Literal

from eomgen.errors import SceneError
from eomgen.language.conditions import Condition, of_inertia, require
from eomgen.language.formula import ZERO
from eomgen.language.quantity import Parameter, with_components
from eomgen.model.acting import acting_effects, at_joint, check_contacts, sliding_in
from eomgen.model.chains import written_out
from eomgen.model.definitions import with_definitions
from eomgen.model.geometry import entries_of_inertia, straightened_joint, unit_quaternions
from eomgen.model.model import Body, Model, Point
from eomgen.model.names import check_known, check_names, named
from eomgen.model.prescribed import initial_values, locked_values
from eomgen.outputs import OUTPUTS
from eomgen.scene.effects import Effect
from eomgen.scene.joints import Joint
from eomgen.scene.joints.base import WORLD
from eomgen.scene.look import check_look
from eomgen.scene.schema import Scene


def elaborate(scene: Scene) -> Model:
    """Resolve a scene's names into a tree of bodies.

    Raises `SceneError`, naming place, value and remedy, if the scene makes no mechanism.
    """
    parameters, known = _scene_parameters(scene)
    motion = _motion(scene)
    scene = with_definitions(scene, motion)
    conditions: list[Condition] = []
    bodies, notices = _bodies(scene, known, parameters, conditions, motion)
    names = {body.name: i for i, body in enumerate(bodies)}
    sliding = sliding_in(bodies, scene.dimensions)
    effects = acting_effects(scene, bodies, sliding, known, parameters, conditions, motion)
    points = _points(scene, names, known, parameters, conditions, motion)
    inputs = [at_joint(x, e, sliding) for e in effects for x in e.inputs(scene.dimensions)]
    states = [at_joint(x, e, sliding) for e in effects for x in e.states(scene.dimensions)]
    if not any(body.velocities for body in bodies):
        raise SceneError("joints: nothing can move; give at least one that is no weld")
    _check_symbols(scene, parameters, bodies, effects)
    check_contacts(effects, list(names))
    locked = locked_values(scene.locked, bodies, effects)
    check_look((), scene.camera, scene.dimensions, "camera")
    if scene.camera.follow is not None:
        check_known(scene.camera.follow, "camera.follow", names, "body")
    model = Model(
        name=scene.name,
        title=scene.title or scene.name,
        dimensions=scene.dimensions,
        parameters=tuple(parameters),
        conditions=tuple(conditions),
        inputs=tuple(inputs),
        bodies=tuple(bodies),
        points=tuple(points),
        effects=tuple(effects),
        states=tuple(states),
        initial_q=(),
        initial_v=(),
        outputs=(),
        form=scene.form,
        route=scene.route,
        simulation=scene.simulation,
        camera=scene.camera,
        locked=tuple(locked.items()),
        # What is not there by its own name is there in degrees.
        locked_deg=tuple(
            (name, scene.locked[f"{name}_deg"]) for name in locked if name not in scene.locked
        ),
        leave_out=scene.leave_out,
        notices=notices,
    )
    if not model.velocities:
        raise SceneError(
            "scene: every coordinate is driven or locked, so there is no motion to find; "
            "leave one free"
        )
    q, v = scene.initial.q, scene.initial.v
    model = replace(
        model,
        initial_q=initial_values(q, model.coordinates, "initial.q", model.prescribed),
        initial_v=initial_values(v, model.velocities, "initial.v", model.prescribed),
        outputs=outputs_for(
            scene.outputs, "outputs[{}]", scene.points, inputs, parameters, model.driven
        ),
    )
    return unit_quaternions(model, q)


def outputs_for(
    wanted: Literal["all"] | Sequence[str],
    place: str,
    points: Collection[object],
    inputs: Collection[object],
    parameters: Collection[object],
    driven: Collection[object],
) -> tuple[str, ...]:
    """What is to be generated, in the order of `OUTPUTS`; "all" is all that there can be.

    `wanted` holds names in `OUTPUTS`; `place` says where the one of number `{}` was asked for.
    """
    needs = {name: spec.needs for name, spec in OUTPUTS.items() if spec.needs}
    there = {
        "points": points,
        "inputs": inputs,
        "parameters": parameters,
        "driven joints": driven,
    }
    if wanted == "all":
        return tuple(name for name in OUTPUTS if name not in needs or there[needs[name]])
    for i, name in enumerate(wanted):
        if name in needs and not there[needs[name]]:
            raise SceneError(
                f"{place.format(i)}: '{name}' is about {needs[name]}, and there are none"
            )
    return in_order(wanted)


def in_order(outputs: Collection[str]) -> tuple[str, ...]:
    """Outputs, each once, in the order of `OUTPUTS`."""
    return tuple(name for name in OUTPUTS if name in outputs)


def _scene_parameters(scene: Scene) -> tuple[list[Parameter], dict[str, float]]:
    parameters = []
    for name, entry in scene.parameters.items():
        place = f"parameters.{name}"
        if isinstance(entry, float | int):
            parameters.append(Parameter(name, float(entry), "", "", place))
        else:
            parameters.append(Parameter(name, float(entry.value), entry.unit, entry.about, place))
    return parameters, {p.name: p.default for p in parameters}


def _motion(scene: Scene) -> list[str]:
    """Names of what changes while a scene moves: time, coordinates, velocities, inputs, states."""
    names = ["t"]
    for joint, _ in written_out(scene)[1]:
        both = (*joint.positions(scene.dimensions), *joint.velocities(scene.dimensions))
        names += [coordinate.name for coordinate in both]
    for effect in scene.effects:
        names += [i.name for i in effect.inputs(scene.dimensions)]
        names += [x.name for x in effect.states(scene.dimensions)]
    return names


def _bodies(
    scene: Scene,
    known: dict[str, float],
    parameters: list[Parameter],
    conditions: list[Condition],
    motion: Sequence[str],
) -> tuple[list[Body], tuple[str, ...]]:
    """Bodies with their joints, parents first and otherwise in the scene's order; and notices."""
    bodies, joints = written_out(scene)
    check_names([(body.name, place) for body, place in bodies])
    check_names([(joint.name, place) for joint, place in joints])
    names = {body.name: i for i, (body, _) in enumerate(bodies)}
    anchors = dict.fromkeys([WORLD, *names])
    holding: dict[str, tuple[Joint, str]] = {}
    for joint, place in joints:
        if joint.child == WORLD:
            raise SceneError(
                f"{place}.child: '{WORLD}' is the ground, which hangs on nothing; name it as the "
                "parent, and give no body a second joint: loops are not closed"
            )
        check_known(joint.child, f"{place}.child", names, "body")
        if joint.parent != WORLD:
            check_known(joint.parent, f"{place}.parent", anchors, "body")
        if joint.child in holding:
            raise SceneError(
                f"{place}.child: '{joint.child}' is the child of {holding[joint.child][1]} too; "
                "in a tree each body has one joint to its parent"
            )
        holding[joint.child] = (joint, place)
    for body, place in bodies:
        if body.name not in holding:
            raise SceneError(
                f"{place}.name: '{body.name}' is attached to nothing; "
                "give it a joint, of type 'free' if nothing holds it"
            )
    depth = _depths(holding)
    order = sorted(names, key=lambda name: (depth[name], names[name]))
    index = {name: k for k, name in enumerate(order)}
    built: list[Body] = []
    notices: list[str] = []
    for name in order:
        body, place = bodies[names[name]]
        joint, joint_place = holding[name]
        joint = straightened_joint(joint, joint_place, scene.dimensions, notices)
        check_look(body.shapes, None, scene.dimensions, place)
        body = named(body, body.name, place, known, parameters, conditions, motion)
        inertia_com = entries_of_inertia(body, place, scene.dimensions)
        values = {**known, **{p.name: p.default for p in parameters}}
        at = f"{place}.inertia_com"
        sound = list(of_inertia(at, body.name, body.mass, inertia_com, values))
        require(sound, values)
        conditions += sound
        joint = named(joint, joint.name, joint_place, known, parameters, conditions, motion)
        built.append(
            Body(
                name=name,
                mass=body.mass,
                inertia_com=inertia_com,
                joint=joint,
                parent=-1 if joint.parent == WORLD else index[joint.parent],
                positions=joint.positions(scene.dimensions),
                velocities=joint.velocities(scene.dimensions),
                shapes=body.shapes,
            )
        )
    return built, tuple(dict.fromkeys(notices))


def _depths(holding: dict[str, tuple[Joint, str]]) -> dict[str, int]:
    """How many joints lie between each body and the world. Raises `SceneError` for a cycle."""
    depth: dict[str, int] = {WORLD: 0}
    for start in holding:
        path: dict[str, None] = {}
        name = start
        while name not in depth:
            if name in path:
                joint, place = holding[name]
                raise SceneError(
                    f"{place}.parent: '{joint.parent}' hangs on its own child '{name}': "
                    "the joints make a cycle; let one tree start at the world"
                )
            path[name] = None
            name = holding[name][0].parent
        for name in reversed(path):
            depth[name] = depth[holding[name][0].parent] + 1
    return depth


def _points(
    scene: Scene,
    names: dict[str, int],
    known: dict[str, float],
    parameters: list[Parameter],
    conditions: list[Condition],
    motion: Sequence[str],
) -> list[Point]:
    check_names([(point.name, f"points[{i}]") for i, point in enumerate(scene.points)])
    points = []
    for i, point in enumerate(scene.points):
        place = f"points[{i}]"
        check_known(point.body, f"{place}.body", names, "body")
        at = with_components(point.at, ZERO, scene.dimensions, f"{place}.at")
        point = point.replaced(at=at)
        point = named(point, point.name, place, known, parameters, conditions, motion)
        points.append(Point(point.name, names[point.body], point.at))
    return points


def _check_symbols(
    scene: Scene,
    parameters: Sequence[Parameter],
    bodies: Sequence[Body],
    effects: Sequence[Effect],
) -> None:
    """No name may stand for two things in the equations. Raises `SceneError` with both places."""
    places = {joint.name: place for joint, place in written_out(scene)[1]}
    moving = [(body, places[body.joint.name]) for body in bodies]
    acting = [(effect, f"effects[{i}]") for i, effect in enumerate(effects)]
    n = scene.dimensions
    uses = [(p.name, "a parameter", p.place) for p in parameters]
    uses += [(c.name, "a coordinate", at) for body, at in moving for c in body.positions]
    uses += [(c.name, "a velocity", at) for body, at in moving for c in body.velocities]
    uses += [(c.acceleration, "an acceleration", at) for b, at in moving for c in b.velocities]
    uses += [(i.name, "an input", at) for effect, at in acting for i in effect.inputs(n)]
    uses += [(x.name, "a state", at) for effect, at in acting for x in effect.states(n)]
    taken = {"t": ("time", ""), "pi": ("the number π", "")}
    for name, use, place in uses:
        if name in taken:
            other, at = taken[name]
            other = "another" if use == other else other
            raise SceneError(
                f"{place}: '{name}' would be the name of {use} and of {other}"
                f"{f' ({at})' if at else ''}; rename one of them"
            )
        taken[name] = use, place
