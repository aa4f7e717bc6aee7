"""From a scene to a model: every name resolved, bodies in a tree, everything checked."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from typing import Literal, TypeVar

from eomgen.effects import Driven, Effect, Gravity
from eomgen.effects.base import ExtraState, Input
from eomgen.errors import SceneError, listed, nearest
from eomgen.joints import Joint, Prismatic, Revolute
from eomgen.joints.base import WORLD, Coordinate
from eomgen.language.base import Table
from eomgen.language.formula import ZERO, Floats, evaluate
from eomgen.language.quantity import (
    Parameter,
    about_slides,
    name_quantities,
    of_joint,
    with_components,
)
from eomgen.model import Body, Model, Point, ways_of
from eomgen.prescribed import check_drive, initial_values, locked_values
from eomgen.scene.chains import written_out
from eomgen.scene.definitions import with_definitions
from eomgen.scene.look import check_look
from eomgen.scene.schema import OUTPUTS, Scene
from eomgen.straighten import checked_inertia, straightened_joint, unit_quaternions

AnyTable = TypeVar("AnyTable", bound=Table)
Given = TypeVar("Given", Input, ExtraState)


def build_model(scene: Scene) -> Model:
    """Resolve a scene's names into a tree of bodies.

    Raises `SceneError`, naming place, value and remedy, if the scene makes no mechanism.
    """
    parameters, known = _scene_parameters(scene)
    motion = _motion(scene)
    scene = with_definitions(scene, motion)
    bodies = _bodies(scene, known, parameters, motion)
    names = {body.name: i for i, body in enumerate(bodies[0])}
    sliding = _sliding(bodies[0], scene.dimensions)
    effects = _effects(scene, bodies[0], sliding, known, parameters, motion)
    points = _points(scene, names, known, parameters, motion)
    inputs = [_at_joint(x, e, sliding) for e in effects for x in e.inputs(scene.dimensions)]
    states = [_at_joint(x, e, sliding) for e in effects for x in e.states(scene.dimensions)]
    coordinates = [c for body in bodies[0] for c in body.positions]
    velocities = [c for body in bodies[0] for c in body.velocities]
    if not velocities:
        raise SceneError("joints: nothing can move; give at least one that is no weld")
    _check_symbols(parameters, coordinates, velocities, inputs, states)
    _check_contacts(effects, list(names))
    locked = locked_values(scene.locked, bodies[0], effects)
    check_look((), scene.camera, scene.dimensions, "camera")
    if scene.camera.follow is not None:
        _known_body(scene.camera.follow, "camera.follow", names)
    model = Model(
        name=scene.name,
        title=scene.title or scene.name,
        dimensions=scene.dimensions,
        parameters=tuple(parameters),
        inputs=tuple(inputs),
        bodies=tuple(bodies[0]),
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
        leave_out=scene.leave_out,
        notices=bodies[1],
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
    needs = {
        **dict.fromkeys(("point_positions", "point_velocities", "point_jacobians"), "points"),
        "input_jacobian": "inputs",
        "parameter_jacobian": "parameters",
        "driving_forces": "driven joints",
    }
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


def _sliding(bodies: Sequence[Body], dimensions: int) -> set[str]:
    """Joints and coordinates that slide."""
    found = {body.joint.name for body in bodies if isinstance(body.joint, Prismatic)}
    for body in bodies:
        pairs = zip(body.positions, body.joint.moves(dimensions), strict=False)
        found |= {c.name for c, move in pairs if move.kind == "slide"}
    return found


def _at_joint(given: Given, effect: Effect, sliding: Collection[str]) -> Given:
    """An input or state of an effect, in the unit and words for its joint if it has one."""
    here = about_slides(effect, sliding)
    if here is None:
        return given
    unit, about = (of_joint(text, here) for text in (given.unit, given.about))
    return replace(given, unit=unit, about=about)


def _scene_parameters(scene: Scene) -> tuple[list[Parameter], dict[str, float]]:
    parameters = []
    for name, entry in scene.parameters.items():
        if isinstance(entry, float | int):
            parameters.append(Parameter(name, float(entry), "", ""))
        else:
            parameters.append(Parameter(name, float(entry.value), entry.unit, entry.about))
    return parameters, {p.name: p.default for p in parameters}


def _check_names(tables: Sequence[tuple[str, str]]) -> None:
    """Names, each with its place, are given once; none is the world's."""
    seen: dict[str, str] = {}
    for name, place in tables:
        if name in seen:
            raise SceneError(
                f"{place}.name: '{name}' is the name of {seen[name]} too; give each its own"
            )
        seen[name] = place
        if name == WORLD and place.startswith("bodies"):
            raise SceneError(f"{place}.name: '{WORLD}' is the ground; choose another name")


def _known_body(name: str, place: str, known: Sequence[str] | dict[str, int]) -> None:
    if name not in known:
        hint = nearest(name, known) or f"; known: {listed(known)}"
        raise SceneError(f"{place}: no body is named '{name}'{hint}")


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
    scene: Scene, known: dict[str, float], parameters: list[Parameter], motion: Sequence[str]
) -> tuple[list[Body], tuple[str, ...]]:
    """Bodies with their joints, parents first and otherwise in the scene's order; and notices."""
    bodies, joints = written_out(scene)
    _check_names([(body.name, place) for body, place in bodies])
    _check_names([(joint.name, place) for joint, place in joints])
    names = {body.name: i for i, (body, _) in enumerate(bodies)}
    holding: dict[str, tuple[Joint, str]] = {}
    for joint, place in joints:
        _known_body(joint.child, f"{place}.child", names)
        if joint.parent != WORLD:
            _known_body(joint.parent, f"{place}.parent", [WORLD, *names])
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
        count = len(parameters)
        body = _named(body, body.name, place, known, parameters, motion)
        own = {p.name: p.default for p in parameters[count:]}
        joint = _named(joint, joint.name, joint_place, known, parameters, motion)
        built.append(
            Body(
                name=name,
                mass=body.mass,
                inertia_com=checked_inertia(body, place, scene.dimensions, {**known, **own}),
                joint=joint,
                parent=-1 if joint.parent == WORLD else index[joint.parent],
                positions=joint.positions(scene.dimensions),
                velocities=joint.velocities(scene.dimensions),
                shapes=body.shapes,
            )
        )
    return built, tuple(dict.fromkeys(notices))


def _named(
    table: AnyTable,
    prefix: str,
    place: str,
    known: dict[str, float],
    parameters: list[Parameter],
    motion: Sequence[str],
    sliding: Collection[str] = (),
) -> AnyTable:
    """A table with its bare numbers as parameters, which are added to `parameters`."""
    fields, new = name_quantities(table, prefix, place, known, motion, sliding)
    parameters += new
    return table.replaced(**fields)


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
    motion: Sequence[str],
) -> list[Point]:
    _check_names([(point.name, f"points[{i}]") for i, point in enumerate(scene.points)])
    points = []
    for i, point in enumerate(scene.points):
        place = f"points[{i}]"
        _known_body(point.body, f"{place}.body", names)
        at = with_components(point.at, ZERO, scene.dimensions, f"{place}.at")
        named = _named(point.replaced(at=at), point.name, place, known, parameters, motion)
        points.append(Point(point.name, names[point.body], named.at))
    return points


def _effects(
    scene: Scene,
    bodies: Sequence[Body],
    sliding: Collection[str],
    known: dict[str, float],
    parameters: list[Parameter],
    motion: Sequence[str],
) -> list[Effect]:
    """Effects with bodies and joints that there are, and vectors of the right length."""
    names = [body.name for body in bodies]
    driven = [b.joint.name for b in bodies if isinstance(b.joint, Revolute | Prismatic)]
    _check_names([(effect.name, f"effects[{i}]") for i, effect in enumerate(scene.effects)])
    ways = ways_of(bodies, scene.dimensions)
    names_of_ways = {b.joint.name: [c.name for c in b.positions] for b in bodies}
    effects: list[Effect] = []
    for i, effect in enumerate(scene.effects):
        place = f"effects[{i}]"
        if isinstance(effect, Gravity) and any(isinstance(other, Gravity) for other in effects):
            raise SceneError(f"{place}.type: a second 'gravity'; give one")
        for name, spot in _names_of(effect, effect.body_fields, place):
            _known_body(name, spot, names)
        for name, spot in _names_of(effect, effect.anchor_fields, place):
            _known_body(name, spot, [WORLD, *names])
        for name, spot in _names_of(effect, effect.point_fields, place):
            _known_point(name, spot, [point.name for point in scene.points])
        for name, spot in _names_of(effect, effect.joint_fields, place):
            _known_joint(name, spot, driven)
        for name, spot in _names_of(effect, effect.way_fields, place):
            if name not in ways:
                hint = nearest(name, ways) or f"; known: {listed(list(ways)) or 'none'}"
                raise SceneError(f"{spot}: no joint that moves is named '{name}'{hint}")
        effect.check_ways(ways, names_of_ways, place)
        vectors = {
            field: with_components(value, ZERO, scene.dimensions, f"{place}.{field}")
            for field in effect.vector_fields
            if isinstance(value := getattr(effect, field), tuple)
        }
        effect = effect.replaced(**vectors).checked(scene.dimensions, place)
        if isinstance(effect, Driven):
            check_drive(effect, place, bodies, effects, known, motion)
        effects.append(_named(effect, effect.name, place, known, parameters, motion, sliding))
        effect.check_values(lambda formula: float(evaluate(formula, known, Floats())), place)
    return effects


def _names_of(effect: Effect, fields: Sequence[str], place: str) -> Iterator[tuple[str, str]]:
    """Each name in some fields, of which some list names or hold tables by them, and its place."""
    for field in fields:
        value = getattr(effect, field)
        if isinstance(value, str):
            if (field, value) not in (("bodies", "all"), ("joints", "all")):
                yield value, f"{place}.{field}"
        elif isinstance(value, dict):
            yield from ((name, f"{place}.{field}.{name}") for name in value)
        elif value is not None:
            yield from ((name, f"{place}.{field}[{i}]") for i, name in enumerate(value))


def _known_point(name: str, place: str, known: Sequence[str]) -> None:
    if name not in known:
        hint = nearest(name, known) or f"; known: {listed(known) or 'none'}"
        raise SceneError(f"{place}: no point is named '{name}'{hint}")


def _known_joint(name: str, place: str, driven: Sequence[str]) -> None:
    if name not in driven:
        hint = nearest(name, driven) or f"; known: {listed(driven) or 'none'}"
        raise SceneError(f"{place}: no revolute or prismatic joint is named '{name}'{hint}")


def _check_symbols(
    parameters: Sequence[Parameter],
    coordinates: Sequence[Coordinate],
    velocities: Sequence[Coordinate],
    inputs: Sequence[Input],
    states: Sequence[ExtraState],
) -> None:
    """No name may stand for two things in the equations."""
    taken = {"t": "time", "pi": "the number π"}
    uses = [(p.name, "a parameter") for p in parameters]
    uses += [(c.name, "a coordinate") for c in coordinates]
    uses += [(c.name, "a velocity") for c in velocities]
    uses += [(c.acceleration, "an acceleration") for c in velocities]
    uses += [(i.name, "an input") for i in inputs]
    uses += [(x.name, "a state") for x in states]
    for name, use in uses:
        if name in taken:
            other = "another" if use == taken[name] else taken[name]
            raise SceneError(
                f"'{name}' would be the name of {use} and of {other}; rename one of them"
            )
        taken[name] = use


def _check_contacts(effects: Sequence[Effect], bodies: Sequence[str]) -> None:
    """No name may stand for two contacts."""
    taken: dict[str, str] = {}
    for effect in effects:
        for name in effect.contact_names(bodies):
            if name in taken:
                raise SceneError(
                    f"'{name}' would be the name of a contact of '{taken[name]}' and of one of "
                    f"'{effect.name}'; rename one of them"
                )
            taken[name] = effect.name
