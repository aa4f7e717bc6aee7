"""The inputs of a scene: those that it names itself, and those of its effects."""

from collections.abc import Collection, Mapping

from eomgen.base.errors import SceneError, check_known, listed, nearest
from eomgen.language.formula import CONSTANTS, Formula, Name, meant, names_in
from eomgen.scalars.functions import FUNCTIONS
from eomgen.scene.chains import written_out
from eomgen.scene.effects import Effect
from eomgen.scene.effects.base import Input
from eomgen.scene.joints import Joint
from eomgen.scene.joints.base import Coordinate
from eomgen.scene.schema import InputTable, Scene


def own_inputs(scene: Scene) -> tuple[Input, ...]:
    """The inputs that a scene names itself, for its formulas."""
    tables = (x if isinstance(x, InputTable) else InputTable(name=x) for x in scene.inputs)
    return tuple(Input(x.name, x.unit, x.about, x.default) for x in tables)


def all_inputs(scene: Scene) -> tuple[Input, ...]:
    """All inputs of a scene, in the order of its model."""
    effects = (i for effect in scene.effects for i in effect.inputs(scene.dimensions))
    return (*own_inputs(scene), *effects)


def with_formulas(scene: Scene, formulas: Mapping[str, Formula], argument: str) -> Scene:
    """The scene with formulas of time, the motion and parameters in place of some inputs.

    `argument` names these formulas in messages. Raises `SceneError` for a name that no formula of
    the scene may use.
    """
    if not formulas:
        return scene
    known = ["t", *scene.parameters, *scene.definitions, *CONSTANTS]
    known += [c.name for joint, _ in written_out(scene)[1] for c in _moving(joint, scene)]
    known += [i.name for i in all_inputs(scene) if i.name not in formulas]
    for name, formula in formulas.items():
        for word in names_in(formula):
            if word not in known:
                hint = meant(formula, known) or nearest(word, (*known, *FUNCTIONS))
                hint = hint or f"; known: {listed(known)}"
                raise SceneError(f"{argument} {name}: unknown name '{word}'{hint}")
    scene = _without(scene, formulas)
    return scene.replaced(definitions={**scene.definitions, **formulas})


def with_held_inputs(scene: Scene) -> tuple[Scene, dict[str, str]]:
    """The scene without inputs that its effects hold as states between samples, and for each of
    these the effect. Formulas then mean the states.

    Raises `SceneError` for a name that is no input, or an input that two effects hold.
    """
    held: dict[str, str] = {}
    known = [i.name for i in all_inputs(scene)]
    for i, effect in enumerate(scene.effects):
        for name in sampling.inputs if (sampling := effect.sampling()) else ():
            location = f"effects[{i}].inputs.{name}"
            check_known(name, location, known, "input")
            if name in held:
                raise SceneError(
                    f"{location}: '{held[name]}' drives it, too; let one controller drive it"
                )
            held[name] = effect.name
    return (_without(scene, held) if held else scene), held


def _without(scene: Scene, gone: Collection[str]) -> Scene:
    """The scene without some inputs: effects name what has their names instead."""
    left = tuple(
        InputTable(name=i.name, unit=i.unit.partition(" | ")[0], about="", default=i.default)
        for i in all_inputs(scene)
        if i.name not in gone
    )
    effects = tuple(_with_names(effect, gone, scene.dimensions) for effect in scene.effects)
    kept = {i.name for effect in effects for i in effect.inputs(scene.dimensions)}
    inputs = tuple(table for table in left if table.name not in kept)
    return scene.replaced(effects=effects, inputs=inputs)


def _moving(joint: Joint, scene: Scene) -> tuple[Coordinate, ...]:
    """The coordinates and velocities of a joint."""
    return (*joint.positions(scene.dimensions), *joint.velocities(scene.dimensions))


def _with_names(effect: Effect, given: Collection[str], dimensions: int) -> Effect:
    """An effect that names its inputs in formulas, if one of them is given."""
    inputs = effect.inputs(dimensions)
    if not any(i.name in given for i in inputs):
        return effect
    names = tuple(Name(i.name) for i in inputs)
    return effect.replaced(**{effect.input_field: names if len(names) > 1 else names[0]})
