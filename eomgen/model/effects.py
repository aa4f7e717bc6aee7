"""Elaboration of effects: checks the bodies, joints and points that they name, binds quantities."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

from eomgen.base.errors import SceneError, check_known
from eomgen.language.base import Table
from eomgen.language.conditions import require
from eomgen.language.formula import ZERO, names_in
from eomgen.language.quantity import about_slides, of_joint, with_components
from eomgen.model.bodies import Body, dofs_of
from eomgen.model.frames import effect_from_centres
from eomgen.model.inputs import own_inputs
from eomgen.model.names import Bindings, Scope, bind, check_names, joined
from eomgen.model.prescribed import check_drive
from eomgen.model.ways import TreeWays
from eomgen.scene.constraints import ConstraintTable
from eomgen.scene.effects import Effect
from eomgen.scene.effects.base import EffectTable, ExtraState, Input
from eomgen.scene.joints.base import WORLD
from eomgen.scene.schema import Scene

Given = TypeVar("Given", Input, ExtraState)


def sliding_in(bodies: Sequence[Body], dimensions: int) -> frozenset[str]:
    """The names of joints with prismatic primitives only, and of prismatic coordinates."""
    found: list[str] = []
    for body in bodies:
        kinds = [primitive.kind for primitive in body.joint.primitives(dimensions)]
        found += [body.joint.name] * (set(kinds) == {"prismatic"})
        pairs = zip(body.positions, kinds, strict=False)
        found += [coordinate.name for coordinate, kind in pairs if kind == "prismatic"]
    return frozenset(found)


def inputs_and_states(
    scene: Scene, effects: Iterable[Effect], scope: Scope
) -> tuple[tuple[Input, ...], tuple[ExtraState, ...]]:
    """The inputs of a scene and its effects, and their extra states, in the units of the joints at
    which they act.
    """
    dimensions = scene.dimensions
    inputs, states = [*own_inputs(scene)], list[ExtraState]()
    for effect in effects:
        inputs += [_at_joint(x, effect, scope.sliding) for x in effect.inputs(dimensions)]
        states += [_at_joint(x, effect, scope.sliding) for x in effect.states(dimensions)]
    return tuple(inputs), tuple(states)


def in_units_of(
    held: Collection[str], scene: Scene, states: Sequence[ExtraState], scope: Scope
) -> tuple[ExtraState, ...]:
    """The states, of which those that hold inputs of the scene have their units and defaults."""
    inputs, _ = inputs_and_states(scene, scene.effects if held else (), scope)
    known = {i.name: i for i in inputs if i.name in held}
    for sampling in filter(None, (effect.sampling() for effect in scene.effects)):
        known |= {x: known[n] for n, due in sampling.due.items() if n in known for x in due}
    return tuple(
        replace(x, unit=known[x.name].unit, initial=known[x.name].default) if x.name in known else x
        for x in states
    )


def _at_joint(given: Given, effect: Effect, sliding: Collection[str]) -> Given:
    """An input or extra state with the unit and description for the effect's joint, if any."""
    slides = about_slides(effect, sliding)
    if slides is None:
        return given
    unit, about = (of_joint(text, slides) for text in (given.unit, given.about))
    return replace(given, unit=unit, about=about)


def effects_in_force(
    scene: Scene, bodies: Sequence[Body], scope: Scope
) -> tuple[tuple[Effect, ...], Bindings]:
    """The effects of a scene, checked and with named quantities, and their bindings.

    Vectors that the scene leaves out become zeros. Raises `SceneError`, naming the location, for an
    effect that names something unknown or cannot act on what it names.
    """
    check_names([(effect.name, f"effects[{i}]") for i, effect in enumerate(scene.effects)])
    resolver = _Resolver(scene, bodies, scope)
    effects: list[Effect] = []
    found: list[Bindings] = []
    for i, given in enumerate(scene.effects):
        location = f"effects[{i}]"
        if given.single and any(other.type == given.type for other in effects):
            raise SceneError(f"{location}.type: a second '{given.type}'; give only one")
        effect, bindings = resolver.resolved(given, location, effects)
        found.append(bindings)
        effects.append(effect)
    return tuple(effects), joined(found)


def constraints_in_force(
    scene: Scene, bodies: Sequence[Body], scope: Scope
) -> tuple[tuple[ConstraintTable, ...], Bindings]:
    """The constraints that a scene lists, likewise."""
    location = "constraints[{}]"
    check_names([(c.name, location.format(i)) for i, c in enumerate(scene.constraints)])
    resolver = _Resolver(scene, bodies, scope)
    pairs = [resolver.resolved(c, location.format(i), ()) for i, c in enumerate(scene.constraints)]
    for i, (constraint, _) in enumerate(pairs):
        _check_formulas(constraint, location.format(i), bodies, scope)
    ways = TreeWays(bodies, scene.dimensions)
    placed = tuple(c.placed(ways, location.format(i)) for i, (c, _) in enumerate(pairs))
    return placed, joined(bindings for _, bindings in pairs)


def _check_formulas(
    constraint: ConstraintTable, location: str, bodies: Sequence[Body], scope: Scope
) -> None:
    """Check that the formulas of a constraint are of what they restrict, t and parameters."""
    coordinates = [c.name for body in bodies for c in body.positions]
    velocities = [c.name for body in bodies for c in body.velocities]
    for key in constraint.coordinate_fields:
        check_known(getattr(constraint, key), f"{location}.{key}", coordinates, "coordinate")
    for key, also in (("equals", []), ("position", []), ("velocity", velocities)):
        formula = getattr(constraint, key, None)
        for name in [] if formula is None else names_in(formula):
            if name in scope.moving and name not in ("t", *coordinates, *also):
                raise SceneError(
                    f"{location}.{key}: '{name}' is no coordinate{' or velocity' if also else ''}; "
                    "a constraint takes these, t and parameters"
                )


AnyEffect = TypeVar("AnyEffect", bound=EffectTable)


class _Resolver:
    """Resolves the names of effects in a scene and its bodies."""

    def __init__(self, scene: Scene, bodies: Sequence[Body], scope: Scope) -> None:
        self._scene, self._bodies, self._scope = scene, bodies, scope
        self._dofs = dofs_of(bodies, scene.dimensions)
        self._dof_names = {b.joint.name: [c.name for c in b.positions] for b in bodies}
        self._known = _known_names(scene, bodies, self._dofs)
        self._names = [body.name for body in bodies]
        self._centres = {body.name: body.com for body in bodies if body.com}
        self._types = {b.joint.name: b.joint.type for b in bodies}

    def resolved(
        self, effect: AnyEffect, location: str, before: Sequence[Effect]
    ) -> tuple[AnyEffect, Bindings]:
        """An effect after those `before` it, with all it names known, and its bindings."""
        dimensions, given = self._scene.dimensions, effect.model_fields_set
        _check_names_in(effect, location, self._known, self._types)
        effect.check_dofs(self._dofs, self._dof_names, location)
        vectors = {
            field: with_components(value, ZERO, dimensions, f"{location}.{field}")
            for field in effect.vector_fields
            if isinstance(value := getattr(effect, field), tuple)
        }
        effect = effect.replaced(**vectors).checked(dimensions, location)
        if drive := effect.prescribes():
            check_drive(drive, location, self._bodies, before, self._scope)
        effect, bindings = bind(effect, effect.name, location, self._scope)
        effect = effect_from_centres(effect, given, self._names, self._centres, location)
        conditions = tuple(effect.conditions(location))
        require(conditions, bindings.values(self._scope))
        return effect, joined([bindings, Bindings(conditions=conditions)])


def check_contacts(effects: Sequence[Effect], bodies: Sequence[str]) -> None:
    """Raise `SceneError` if two contacts would have the same name."""
    taken: dict[str, str] = {}
    for effect in effects:
        for name in effect.contact_names(bodies):
            if name in taken:
                raise SceneError(
                    f"'{name}' would be the name of a contact of '{taken[name]}' and of one of "
                    f"'{effect.name}'; rename one of them"
                )
            taken[name] = effect.name


def _known_names(
    scene: Scene, bodies: Sequence[Body], dofs: Mapping[str, object]
) -> dict[str, tuple[str, Collection[str]]]:
    """For each kind of `EffectTable.…_fields` what its fields name, and the names that exist."""
    single = [b.joint.name for b in bodies if len(b.positions) == 1]
    names = [body.name for body in bodies]
    return {
        "body_fields": ("body", dict.fromkeys(names)),
        "anchor_fields": ("body", dict.fromkeys([WORLD, *names])),
        "point_fields": ("point", dict.fromkeys(point.name for point in scene.points)),
        "joint_fields": ("revolute or prismatic joint", dict.fromkeys(single)),
        "dof_fields": ("joint that moves", dofs),
    }


def _check_names_in(
    effect: EffectTable,
    location: str,
    known: Mapping[str, tuple[str, Collection[str]]],
    types: Mapping[str, str],
) -> None:
    """Raise `SceneError` for an unknown name in an effect, or a joint of a type it cannot act on.

    `types` maps the names of joints to their types.
    """
    for fields, (what, names) in known.items():
        for name, spot in _names_in(effect, getattr(effect, fields), location):
            if "joint" in what and name in types and name not in names:
                one = what if fields == "joint_fields" else f"{what} and is not free"
                raise SceneError(
                    f"{spot}: '{name}' is a {types[name]} joint, which '{effect.type_name}' does "
                    f"not act on; name a {one}"
                )
            check_known(name, spot, names, what)


def _names_in(
    effect: EffectTable, fields: Sequence[str], location: str
) -> Iterator[tuple[str, str]]:
    """Each name that some fields hold, with its location. A field is a name, a list, a table by
    names, or a list or a table of tables that name a `body`.
    """
    for field in fields:
        value = getattr(effect, field)
        if isinstance(value, str):
            if (field, value) not in (("bodies", "all"), ("joints", "all")):
                yield value, f"{location}.{field}"
        elif isinstance(value, dict):
            for key, inner in value.items():
                at, within = f"{location}.{field}.{key}", isinstance(inner, Table)
                yield (inner.body, f"{at}.body") if within else (key, at)
        elif value is not None:
            for i, entry in enumerate(value):
                at, within = f"{location}.{field}[{i}]", isinstance(entry, Table)
                yield (entry.body, f"{at}.body") if within else (entry, at)
