"""Elaboration of a scene to a model: names are resolved, values checked, bodies put in a tree."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

from eomgen.base.errors import SceneError, check_known
from eomgen.language.conditions import PRINTED, ROUNDING, Condition, of_inertia, require
from eomgen.language.formula import ZERO, Formula
from eomgen.language.quantity import Parameter, with_components
from eomgen.model.bodies import Body, Point, Prescribed, prescribed_of, velocities_of
from eomgen.model.clocks import clocks_of
from eomgen.model.definitions import with_definitions
from eomgen.model.effects import (
    check_contacts,
    constraints_in_force,
    effects_in_force,
    in_units_of,
    inputs_and_states,
    sliding_in,
)
from eomgen.model.frames import Centres, from_centre, joint_from_centres
from eomgen.model.geometry import axis_notices, entries_of_inertia, normalised_joint
from eomgen.model.initial import initial_state
from eomgen.model.inputs import own_inputs, with_held_inputs
from eomgen.model.model import Model
from eomgen.model.names import Bindings, Scope, bind, check_names, joined
from eomgen.model.orientation import oriented
from eomgen.model.prescribed import locked_values
from eomgen.model.tree import Link, links_of, loop_joints
from eomgen.scene.appearance import appearance_of
from eomgen.scene.chains import written_out
from eomgen.scene.constraints import Constraint, loop_joint
from eomgen.scene.effects import Effect
from eomgen.scene.schema import BodyTable, Scene
from eomgen.tables.outputs import OUTPUTS


def elaborate(scene: Scene) -> Model:
    """The model of a scene.

    Raises `SceneError`, naming location, value and remedy, if the scene does not describe a
    mechanism, or if its `[view]` does not fit the mechanism.
    """
    given, (scene, held) = scene, with_held_inputs(scene)
    own = _scene_parameters(scene)
    scope = Scope({p.name: p.default for p in own}, _moving(scene))
    scene = with_definitions(scene, scope.moving)
    n, links = scene.dimensions, links_of(scene)
    bodies, of_bodies = _bodies(links, scope, n)
    scope = replace(scope, sliding=sliding_in(bodies, n))
    effects, of_effects = effects_in_force(scene, bodies, scope)
    points, of_points = _points(scene, bodies, scope)
    constraints, of_constraints = _loops(scene, bodies, scope)
    found = joined([Bindings(own), of_bodies, of_effects, of_points, of_constraints])
    inputs, states = inputs_and_states(scene, effects, scope)
    states = in_units_of(held, given, states, scope)
    clocks_of(effects)  # raises SceneError if what samples has no common clock
    if not any(body.velocities for body in bodies):
        raise SceneError("joints: nothing can move; give at least one that is not a weld")
    _check_symbols(n, found.parameters, links, bodies, effects, scene)
    check_contacts(effects, [body.name for body in bodies])
    locked = locked_values(scene.locked, bodies, effects)
    appearance_of(scene)  # raises SceneError if the mechanism cannot be drawn
    prescribed = prescribed_of(bodies, effects, locked)
    _check_free(scene, bodies, prescribed, bool(constraints))
    start = initial_state(scene.initial, bodies, prescribed)
    lengths = (line for link in links for line in axis_notices(link.joint, link.joint_location))
    model = Model(
        name=scene.name,
        title=scene.title or scene.name,
        dimensions=n,
        parameters=found.parameters,
        conditions=found.conditions,
        inputs=inputs,
        bodies=bodies,
        points=points,
        effects=effects,
        extra=states,
        initial_q=start.q,
        initial_v=start.v,
        outputs=(),
        form=scene.form,
        route=scene.route,
        loops_kept=scene.loops,
        locked=tuple(locked.items()),
        # A locked coordinate is given by its own name, or else in degrees.
        locked_deg=tuple(
            (name, scene.locked[f"{name}_deg"]) for name in locked if name not in scene.locked
        ),
        leave_out=scene.leave_out,
        constraints=constraints,
        held=start.given if constraints else (),
        notices=(
            *scene.remarks,
            *dict.fromkeys([*lengths, *(notice for body in bodies for notice in body.notices)]),
            *start.notices,
            *_notices(effects, {p.name: p.default for p in found.parameters}),
        ),
    )
    return replace(model, outputs=outputs_for(scene.outputs, "outputs[{}]", available_in(model)))


def _check_free(
    scene: Scene, bodies: Sequence[Body], prescribed: Sequence[Prescribed], closed: bool
) -> None:
    """Raise `SceneError` if all coordinates are locked, or there are guesses without loops."""
    if not velocities_of(bodies, prescribed) and all(c.locked for c in prescribed):
        raise SceneError("scene: every coordinate is locked, so nothing moves; leave one free")
    if scene.initial.guess and not closed:
        raise SceneError(
            "initial.guess: is for mechanisms with loops, and this scene has none; give initial.q"
        )


def _notices(effects: Sequence[Effect], values: Mapping[str, float]) -> Iterator[str]:
    return (f"{e.name}.{line}" for e in effects for line in e.notices(values))


def expanded(scene: Scene) -> Scene:
    """The scene with its definitions expanded. Raises `SceneError` as `with_definitions` does."""
    scene, _ = with_held_inputs(scene)
    return with_definitions(scene, _moving(scene))


def outputs_for(
    wanted: Literal["all"] | Sequence[str], location: str, available: Mapping[str, Collection[Any]]
) -> tuple[str, ...]:
    """The outputs to generate, in the order of `OUTPUTS`.

    `wanted` is "all" or names in `OUTPUTS`. "all" stands for the usual ones, without those that
    need what the model lacks: `available` holds what it has of each kind, see `available_in`. Such
    an output asked for by name raises `SceneError`. `location` is a format string for the location
    of a name, by its index.
    """
    needs = {name: spec.needs for name, spec in OUTPUTS.items() if spec.needs}
    if wanted == "all":
        return tuple(
            name
            for name, spec in OUTPUTS.items()
            if spec.usual and (name not in needs or available[needs[name]])
        )
    for i, name in enumerate(wanted):
        if name in needs and not available[needs[name]]:
            raise SceneError(
                f"{location.format(i)}: '{name}' needs {needs[name]}, and there are none"
            )
    return in_order(wanted)


def available_in(model: Model) -> dict[str, Collection[Any]]:
    """What a model has of all that outputs may need."""
    return {
        "points": model.points,
        "inputs": model.inputs,
        "parameters": model.parameters,
        "driven joints": model.driven,
        "constraints": model.constraints,
    }


def in_order(outputs: Collection[str]) -> tuple[str, ...]:
    """The given outputs without duplicates, in the order of `OUTPUTS`."""
    return tuple(name for name in OUTPUTS if name in outputs)


def _scene_parameters(scene: Scene) -> tuple[Parameter, ...]:
    parameters = []
    for name, entry in scene.parameters.items():
        location = f"parameters.{name}"
        if isinstance(entry, float | int):
            parameters.append(Parameter(name, float(entry), "", "", location))
        else:
            parameters.append(
                Parameter(name, float(entry.value), entry.unit, entry.about, location)
            )
    return tuple(parameters)


def _moving(scene: Scene) -> tuple[str, ...]:
    """The names of all variables: time, coordinates, velocities, inputs and extra states."""
    names = ["t"]
    for joint, _ in written_out(scene)[1]:
        if joint.loop:
            continue
        both = (*joint.positions(scene.dimensions), *joint.velocities(scene.dimensions))
        names += [coordinate.name for coordinate in both]
    names += [i.name for i in own_inputs(scene)]
    for effect in scene.effects:
        names += [i.name for i in effect.inputs(scene.dimensions)]
        names += [x.name for x in effect.states(scene.dimensions)]
    return tuple(names)


def _bodies(
    links: Sequence[Link], scope: Scope, dimensions: int
) -> tuple[tuple[Body, ...], Bindings]:
    """The bodies of links, in their order, with their joints; and the bindings of both."""
    bodies, found = list[Body](), list[Bindings]()
    for link in links:
        body, bindings = _body(link, scope, dimensions, {b.name: b.com for b in bodies if b.com})
        bodies.append(body)
        found.append(bindings)
    return tuple(bodies), joined(found)


def _body(link: Link, scope: Scope, dimensions: int, centres: Centres) -> tuple[Body, Bindings]:
    """A body with its joint; `centres` are those of the bodies before it."""
    turned, kept = oriented(link.joint, link.joint_location, dimensions, scope)
    joint = normalised_joint(turned, link.joint_location, dimensions)
    given = link.body
    if "inertia_com" not in given.model_fields_set and joint.needs_inertia:
        raise SceneError(
            f"{link.location}.inertia_com: missing; a body needs it unless it is on a joint of "
            "type 'particle'"
        )
    if given.com:
        at = f"{link.location}.com"
        given = given.replaced(com=with_components(given.com, ZERO, dimensions, at))
    seen = given.replaced(shapes=())  # no parameters: no equation uses shapes
    table, of_body = bind(seen, given.name, link.location, scope)
    inertia_com = entries_of_inertia(table, link.location, dimensions)
    values = of_body.values(scope)
    at = f"{link.location}.inertia_com"
    conditions, notice = _checked_inertia(table, inertia_com, at, values)
    joint, of_joint = bind(joint, joint.name, link.joint_location, scope)
    joint = joint_from_centres(joint, {**centres, **({table.name: table.com} if table.com else {})})
    body = Body(
        name=table.name,
        mass=table.mass,
        inertia_com=inertia_com,
        joint=joint,
        parent=link.parent,
        positions=joint.positions(dimensions),
        velocities=joint.velocities(dimensions),
        com=table.com,
        notices=notice,
    )
    return body, joined([of_body, Bindings(conditions=(*conditions, *kept)), of_joint])


def _checked_inertia(
    body: BodyTable, entries: tuple[Formula, ...], location: str, values: Mapping[str, float]
) -> tuple[tuple[Condition, ...], tuple[str, ...]]:
    """The conditions on an inertia, and a notice if it meets them only within printed digits.

    Raises `SceneError` if it does not, unless the body says that it need not.
    """

    def conditions(rounding: float | None) -> tuple[Condition, ...]:
        return tuple(of_inertia(location, body.name, body.mass, entries, values, rounding))

    if body.inertia_check == "off":
        return conditions(None), ()
    found = conditions(ROUNDING)
    if not any(condition.problem(values) for condition in found):
        return found, ()
    loose = conditions(PRINTED)
    if any(condition.problem(values) for condition in loose):
        require(found, values)
    return loose, (
        f"{location}: a principal moment of body '{body.name}' is larger than the other two "
        "together, by less than 0.1 %; taken as rounding of printed digits",
    )


def _points(
    scene: Scene, bodies: Sequence[Body], scope: Scope
) -> tuple[tuple[Point, ...], Bindings]:
    """The named points and their bindings."""
    check_names([(point.name, f"points[{i}]") for i, point in enumerate(scene.points)])
    index = {body.name: k for k, body in enumerate(bodies)}
    given = {point.name for point in scene.points if point.at}
    points, found = [], []
    for i, point in enumerate(scene.points):
        location = f"points[{i}]"
        check_known(point.body, f"{location}.body", index, "body")
        at = with_components(point.at, ZERO, scene.dimensions, f"{location}.at")
        point, bindings = bind(point.replaced(at=at), point.name, location, scope)
        body = bodies[index[point.body]]
        place = from_centre(point.at, body.com) if point.name in given else point.at
        points.append(Point(point.name, index[point.body], place))
        found.append(bindings)
    return tuple(points), joined(found)


def _loops(
    scene: Scene, bodies: Sequence[Body], scope: Scope
) -> tuple[tuple[Constraint, ...], Bindings]:
    """The constraints of the joints that close loops, then those that the scene lists, and their
    bindings.
    """
    centres = {body.name: body.com for body in bodies if body.com}
    loops, found = list[Constraint](), list[Bindings]()
    for joint, location in loop_joints(scene):
        turned, kept = oriented(joint, location, scene.dimensions, scope)
        joint = normalised_joint(turned, location, scene.dimensions)
        joint, bindings = bind(joint, joint.name, location, scope)
        loops.append(loop_joint(joint_from_centres(joint, centres), location, scene.dimensions))
        found += [bindings, Bindings(conditions=kept)]
    others, of_others = constraints_in_force(scene, bodies, scope)
    joints = [(joint.name, location) for joint, location in loop_joints(scene)]
    check_names([*joints, *((c.name, f"constraints[{i}]") for i, c in enumerate(others))])
    return (*loops, *others), joined([*found, of_others])


def _check_symbols(
    n: int,
    parameters: Sequence[Parameter],
    links: Sequence[Link],
    bodies: Sequence[Body],
    effects: Sequence[Effect],
    scene: Scene,
) -> None:
    """Raise `SceneError`, with both locations, if a symbol of the equations would be ambiguous.

    `n` is the number of dimensions, `bodies` are those of the `links`.
    """
    joints = [(body, link.joint_location) for body, link in zip(bodies, links, strict=True)]
    located = [(effect, f"effects[{i}]") for i, effect in enumerate(effects)]
    uses = [(p.name, "a parameter", p.location) for p in parameters]
    uses += [(c.name, "a coordinate", at) for body, at in joints for c in body.positions]
    uses += [(c.name, "a velocity", at) for body, at in joints for c in body.velocities]
    uses += [(c.acceleration, "an acceleration", at) for b, at in joints for c in b.velocities]
    own = own_inputs(scene)
    uses += [(own[k].name, "an input", f"inputs[{k}]") for k in range(len(own))]
    uses += [(i.name, "an input", at) for effect, at in located for i in effect.inputs(n)]
    uses += [(x.name, "a state", at) for effect, at in located for x in effect.states(n)]
    taken = {"t": ("time", ""), "pi": ("the number π", "")}
    for name, use, location in uses:
        if name in taken:
            other, at = taken[name]
            other = "another" if use == other else other
            raise SceneError(
                f"{location}: '{name}' would be the name of {use} and of {other}"
                f"{f' ({at})' if at else ''}; rename one of them"
            )
        taken[name] = use, location
