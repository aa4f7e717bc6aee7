"""What a scene may be without, and the scene without it."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from eomgen.build import build_model
from eomgen.effects import Effect
from eomgen.language.base import Table
from eomgen.language.formula import Apply, Constant, Name, names_in
from eomgen.model import Model
from eomgen.scene.schema import Scene


@dataclass(frozen=True)
class Variant:
    """A scene changed in one thing.

    label      what is changed, for a reader
    model      the changed one; None if the rest would not stand without: then see `needed_by`
    needed_by  names of effects whose formulas name an input or a state of what is left out
    left_out   False: the scene has it and the variant has not; True: the scene leaves it out on
               purpose, and the variant has it
    """

    label: str
    model: Model | None
    needed_by: tuple[str, ...] = ()
    left_out: bool = False


Change = Callable[[Scene], Scene]
"""A scene with one thing changed."""


def counted(scene: Scene) -> Scene:
    """The scene with no outputs but places, which are needed to compare motions."""
    return scene.replaced(outputs=("body_poses",))


def changed(scene: Scene, label: str, change: Change, *, left_out: bool = False) -> Variant:
    """A scene after any change that leaves its bodies and their names as they are."""
    return Variant(label, build_model(counted(change(scene))), left_out=left_out)


def without_effects(scene: Scene, *, each: bool = False) -> tuple[Variant, ...]:
    """The scene without each type of effect, or with `each` without each single one, in order.

    Built anew from the scene, so that parameters, inputs and states go with their effect.
    """
    groups: dict[str, list[Effect]] = {}
    for effect in scene.effects:
        groups.setdefault(effect.name if each else effect.type, []).append(effect)
    return tuple(_without(scene, group) for group in groups.values())


def bare(scene: Scene) -> Model:
    """The mechanism without any effect."""
    return build_model(counted(scene.replaced(effects=())))


def _without(scene: Scene, group: Sequence[Effect]) -> Variant:
    kept = tuple(effect for effect in scene.effects if effect not in group)
    brought = {i.name for effect in group for i in effect.inputs(scene.dimensions)}
    brought |= {x.name for effect in group for x in effect.states(scene.dimensions)}
    needed_by = tuple(e.name for e in kept if brought.intersection(_names(e)))
    model = None if needed_by else build_model(counted(scene.replaced(effects=kept)))
    return Variant(_label(group), model, needed_by)


def _label(group: Sequence[Effect]) -> str:
    """`2 drag`, `drag (air)`, `gravity`."""
    kind, name = group[0].type, group[0].name
    if len(group) > 1:
        return f"{len(group)} {kind}"
    return kind if name == kind else f"{kind} ({name})"


def _names(value: Any) -> Iterator[str]:
    """Every name in the formulas of a table and of those inside it."""
    if isinstance(value, Constant | Name | Apply):
        yield from names_in(value)
    elif isinstance(value, Table):
        for field in type(value).model_fields:
            yield from _names(getattr(value, field))
    elif isinstance(value, dict):
        for part in value.values():
            yield from _names(part)
    elif isinstance(value, tuple):
        for part in value:
            yield from _names(part)
