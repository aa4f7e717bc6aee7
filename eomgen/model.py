"""The model: a scene whose every name is resolved; bodies in a tree, parents before children."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import TypeGuard

from eomgen.effects import Effect, ExternalForce, Gravity, Motor
from eomgen.effects.base import Input
from eomgen.errors import SceneError, nearest
from eomgen.joints import Joint, Revolute
from eomgen.joints.base import WORLD, Coordinate
from eomgen.language.formula import Constant, Floats, Formula, evaluate
from eomgen.language.quantity import Parameter, name_quantities
from eomgen.scene.look import Camera, Shape
from eomgen.scene.schema import OUTPUTS, SHOWN, BodyTable, Form, Scene, Simulation


@dataclass(frozen=True)
class Body:
    """A body and the joint that holds it. `parent` is an index into the bodies, -1 the world."""

    name: str
    mass: Formula
    inertia_com: Formula
    joint: Joint
    parent: int
    coordinates: tuple[Coordinate, ...]
    shapes: tuple[Shape, ...]


@dataclass(frozen=True)
class Model:
    """A mechanism with everything that acts on it; see `build_model`."""

    name: str
    title: str
    parameters: tuple[Parameter, ...]
    inputs: tuple[Input, ...]
    bodies: tuple[Body, ...]
    effects: tuple[Effect, ...]
    initial_q: tuple[float, ...]
    initial_v: tuple[float, ...]
    outputs: tuple[str, ...]
    form: Form
    simulation: Simulation
    camera: Camera

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """All coordinates, in the order of `q`."""
        return tuple(c for body in self.bodies for c in body.coordinates)

    @property
    def turning(self) -> tuple[int, ...]:
        """For each body the index of the coordinate that turns it: the last one of its joint."""
        return tuple(accumulate((len(body.coordinates) for body in self.bodies), initial=-1))[1:]

    @property
    def defaults(self) -> dict[str, float]:
        """Parameter values of the scene, by name."""
        return {p.name: p.default for p in self.parameters}

    def quantities(self) -> Iterator[Formula]:
        """Every quantity of bodies, joints and effects, in order."""
        for body in self.bodies:
            yield from (body.mass, body.inertia_com)
        for table in (*(body.joint for body in self.bodies), *self.effects):
            for field in type(table).model_fields:
                value = getattr(table, field)
                for part in value if isinstance(value, tuple) else (value,):
                    if isinstance(part, Formula):
                        yield part

    def with_parameters(self, values: Mapping[str, float]) -> "Model":
        """The same model with other values for some parameters."""
        parameters = (replace(p, default=values.get(p.name, p.default)) for p in self.parameters)
        return replace(self, parameters=tuple(parameters))

    def value(self, formula: Formula) -> float:
        """A quantity's value at the scene's parameters."""
        return float(evaluate(formula, self.defaults, Floats()))


def build_model(scene: Scene) -> Model:
    """Resolve a scene's names into a tree of bodies.

    Raises `SceneError`, naming place, value and remedy, if the scene makes no mechanism.
    """
    parameters, known = _scene_parameters(scene)
    _check_names(scene)
    bodies = _bodies(scene, known, parameters)
    effects = _effects(scene, known, parameters)
    coordinates = [c for body in bodies for c in body.coordinates]
    inputs = [i for effect in effects for i in effect.inputs()]
    _check_symbols(parameters, coordinates, inputs)
    if scene.camera.follow is not None:
        _known_body(scene.camera.follow, "camera.follow", [body.name for body in bodies])
    wanted = OUTPUTS if scene.outputs == "all" else (*scene.outputs, *SHOWN)
    model = Model(
        name=scene.name,
        title=scene.title or scene.name,
        parameters=tuple(parameters),
        inputs=tuple(inputs),
        bodies=tuple(bodies),
        effects=tuple(effects),
        initial_q=_initial(scene.initial.q, coordinates, "initial.q", rates=False),
        initial_v=_initial(scene.initial.v, coordinates, "initial.v", rates=True),
        outputs=tuple(name for name in OUTPUTS if name in wanted),
        form=scene.form,
        simulation=scene.simulation,
        camera=scene.camera,
    )
    _check_regular(model)
    return model


def _scene_parameters(scene: Scene) -> tuple[list[Parameter], dict[str, float]]:
    parameters = []
    for name, entry in scene.parameters.items():
        if isinstance(entry, float | int):
            parameters.append(Parameter(name, float(entry), "", ""))
        else:
            parameters.append(Parameter(name, float(entry.value), entry.unit, entry.about))
    return parameters, {p.name: p.default for p in parameters}


def _check_names(scene: Scene) -> None:
    for kind, tables in (
        ("bodies", scene.bodies),
        ("joints", scene.joints),
        ("effects", scene.effects),
    ):
        seen: dict[str, int] = {}
        for i, table in enumerate(tables):
            if table.name in seen:
                raise SceneError(
                    f"{kind}[{i}].name: '{table.name}' is the name of {kind}[{seen[table.name]}] "
                    "too; give each its own"
                )
            seen[table.name] = i
            if kind == "bodies" and table.name == WORLD:
                raise SceneError(f"{kind}[{i}].name: '{WORLD}' is the ground; choose another name")


def _known_body(name: str, place: str, known: Sequence[str]) -> None:
    if name not in known:
        hint = nearest(name, known) or f"; known: {', '.join(known)}"
        raise SceneError(f"{place}: no body is named '{name}'{hint}")


def _bodies(scene: Scene, known: dict[str, float], parameters: list[Parameter]) -> list[Body]:
    """Bodies with their joints, parents first and otherwise in the scene's order."""
    names = [body.name for body in scene.bodies]
    holding: dict[str, tuple[int, Joint]] = {}
    for i, joint in enumerate(scene.joints):
        _known_body(joint.child, f"joints[{i}].child", names)
        if joint.parent != WORLD:
            _known_body(joint.parent, f"joints[{i}].parent", [WORLD, *names])
        if joint.child in holding:
            other = holding[joint.child][0]
            raise SceneError(
                f"joints[{i}].child: '{joint.child}' is the child of joints[{other}] too; "
                "in a tree each body has one joint to its parent"
            )
        holding[joint.child] = (i, joint)
    for i, body in enumerate(scene.bodies):
        if body.name not in holding:
            raise SceneError(
                f"bodies[{i}].name: '{body.name}' is attached to nothing; "
                "give it a joint, of type 'free' if nothing holds it"
            )
    order: dict[str, int] = {}
    while len(order) < len(names):
        ready = [n for n in names if n not in order and holding[n][1].parent in {WORLD, *order}]
        if not ready:
            stuck = next(n for n in names if n not in order)
            i, joint = holding[stuck]
            raise SceneError(
                f"joints[{i}].parent: '{joint.parent}' hangs on its own child '{stuck}': "
                "the joints make a cycle; let one tree start at the world"
            )
        for name in ready:
            order[name] = len(order)
    return [
        _body(
            scene.bodies[names.index(name)],
            names.index(name),
            *holding[name],
            order,
            known,
            parameters,
        )
        for name in order
    ]


def _body(
    table: BodyTable,
    body_index: int,
    joint_index: int,
    joint: Joint,
    order: dict[str, int],
    known: dict[str, float],
    parameters: list[Parameter],
) -> Body:
    fields, new = name_quantities(table, table.name, f"bodies[{body_index}]", known)
    parameters += new
    table = table.replaced(**fields)
    fields, new = name_quantities(joint, joint.name, f"joints[{joint_index}]", known)
    parameters += new
    joint = joint.replaced(**fields)
    return Body(
        name=table.name,
        mass=table.mass,
        inertia_com=table.inertia_com,
        joint=joint,
        parent=-1 if joint.parent == WORLD else order[joint.parent],
        coordinates=joint.named_coordinates(),
        shapes=table.shapes,
    )


def _effects(scene: Scene, known: dict[str, float], parameters: list[Parameter]) -> list[Effect]:
    bodies = [body.name for body in scene.bodies]
    revolute = [joint.name for joint in scene.joints if isinstance(joint, Revolute)]
    effects: list[Effect] = []
    for i, effect in enumerate(scene.effects):
        match effect:
            case Gravity() if any(isinstance(other, Gravity) for other in effects):
                raise SceneError(f"effects[{i}].type: a second 'gravity'; give one")
            case ExternalForce():
                _known_body(effect.body, f"effects[{i}].body", bodies)
            case Motor() if effect.joint not in revolute:
                hint = nearest(effect.joint, revolute) or f"; known: {', '.join(revolute)}"
                raise SceneError(
                    f"effects[{i}].joint: no revolute joint is named '{effect.joint}'{hint}"
                )
        fields, new = name_quantities(effect, effect.name, f"effects[{i}]", known)
        parameters += new
        effects.append(effect.replaced(**fields))
    return effects


def _check_symbols(
    parameters: Sequence[Parameter],
    coordinates: Sequence[Coordinate],
    inputs: Sequence[Input],
) -> None:
    """No name may stand for two things in the equations."""
    taken = {"t": "time", "pi": "the number π"}
    uses = [(p.name, "a parameter") for p in parameters]
    uses += [(c.name, "a coordinate") for c in coordinates]
    uses += [(c.rate, "a velocity") for c in coordinates]
    uses += [(f"{c.name}_ddot", "an acceleration") for c in coordinates]
    uses += [(i.name, "an input") for i in inputs]
    for name, use in uses:
        if name in taken:
            raise SceneError(
                f"'{name}' would be the name of {use} and of {taken[name]}; rename one of them"
            )
        taken[name] = use


def _initial(
    given: Sequence[float] | dict[str, float],
    coordinates: Sequence[Coordinate],
    place: str,
    *,
    rates: bool,
) -> tuple[float, ...]:
    names = [c.rate if rates else c.name for c in coordinates]
    if not isinstance(given, dict):
        if len(given) != len(names):
            raise SceneError(
                f"{place}: has {len(given)} numbers for {len(names)} coordinates; "
                f"give one each for {', '.join(names)}"
            )
        return tuple(float(x) for x in given)
    values = dict.fromkeys(names, 0.0)
    degrees = {f"{n}_deg": n for n, c in zip(names, coordinates, strict=True) if c.unit == "rad"}
    for key, value in given.items():
        if key in values:
            values[key] = float(value)
        elif key in degrees:
            if degrees[key] in given:
                raise SceneError(f"{place}.{key}: {degrees[key]} is given too; give one of them")
            values[degrees[key]] = math.radians(value)
        else:
            hint = nearest(key, names) or f"; known: {', '.join(names)}"
            raise SceneError(f"{place}.{key}: no coordinate has this name{hint}")
    return tuple(values.values())


def _check_regular(model: Model) -> None:
    """Refuse a point mass that can spin freely: its inertia about what holds it is zero."""
    for body in model.bodies:
        if model.value(body.inertia_com) > 0:
            continue
        joint = body.joint
        if not off_centre(joint) or all(model.value(r) == 0.0 for r in joint.r_child):
            raise SceneError(
                f"body '{body.name}': inertia_com is 0 and nothing resists its rotation; "
                "give it an inertia > 0, or hold it away from its centre of mass"
            )


def off_centre(joint: Joint) -> TypeGuard[Revolute]:
    """Whether a joint holds its child away from the centre of mass, as its structure says."""
    return isinstance(joint, Revolute) and not all(is_zero(r) for r in joint.r_child)


def is_zero(formula: Formula) -> bool:
    """Whether a quantity is a bare 0: structure, no parameter."""
    return isinstance(formula, Constant) and formula.value == 0.0
