"""What a scene may be without, and the scene without it."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from eomgen.language.base import Table
from eomgen.language.formula import Apply, Constant, Name, names_in
from eomgen.language.rates import with_rates
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.scalars.floats import FloatScalars
from eomgen.scene.effects import Driven, Effect
from eomgen.scene.schema import Scene

Kind = Literal["effect", "mechanism", "left out"]
"""An effect in force; what belongs to the mechanism itself; what the scene leaves out on purpose,
and the variant has."""


@dataclass(frozen=True)
class Variant:
    """A scene changed in one thing, which leaves its bodies as they are.

    label      what is changed, for a reader
    model      the changed one; None if the rest would not stand without: then see `needed_by`
    needed_by  names of effects whose formulas name an input or a state of what is left out
    """

    label: str
    model: Model | None
    kind: Kind = "effect"
    needed_by: tuple[str, ...] = ()


def variants(scene: Scene, *, each: bool = False) -> tuple[Variant, ...]:
    """Everything that the scene may be without, and all that it leaves out on purpose."""
    return (*without_effects(scene, each=each), *without_velocity_forces(scene), *complete(scene))


def without_velocity_forces(scene: Scene) -> tuple[Variant, ...]:
    """The scene without V of M v̇ + V + G = F, where it has V and can be without."""
    if scene.leave_out or scene.form != "velocity" or scene.route == "closed":
        return ()
    changed = scene.replaced(leave_out=("velocity_forces",))
    return (Variant("velocity forces", elaborate(counted(changed)), "mechanism"),)


def complete(scene: Scene) -> tuple[Variant, ...]:
    """The scene with what it leaves out: velocity forces, and the motion of locked coordinates,
    which then start as they are locked.
    """
    found = []
    if scene.leave_out:
        found.append(("velocity forces", scene.replaced(leave_out=())))
    if scene.locked:
        count = len(scene.locked)
        label = f"{count} locked coordinate" + "s" * (count > 1)
        found.append((label, _started(scene, (None,)).replaced(locked={})))
    return tuple(Variant(label, elaborate(counted(s)), "left out") for label, s in found)


def _started(scene: Scene, by: Collection[str | None]) -> Scene:
    """The scene with the start of coordinates driven by some effects, or locked (None), too."""
    model = elaborate(counted(scene))
    q = dict(zip((c.name for c in model.coordinates), model.initial_q, strict=True))
    v = dict(zip((c.name for c in model.velocities), model.initial_v, strict=True))
    for c in (c for c in model.prescribed if c.by in by):
        value, rate, _ = with_rates(c.value, model.defaults, 0.0, FloatScalars())
        q[c.position.name], v[c.velocity.name] = float(value), float(rate)
    return scene.replaced(initial=scene.initial.replaced(q=q, v=v))


def counted(scene: Scene) -> Scene:
    """The scene with no outputs but places, which are needed to compare motions."""
    return scene.replaced(outputs=("body_poses",))


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
    return elaborate(counted(removed(scene, scene.effects)))


def removed(scene: Scene, effects: Sequence[Effect]) -> Scene:
    """The scene without some effects; joints that were driven start as they were driven."""
    drives = [effect.name for effect in effects if isinstance(effect, Driven)]
    if drives:
        scene = _started(scene, drives)
    return scene.replaced(effects=tuple(e for e in scene.effects if e not in effects))


def _without(scene: Scene, group: Sequence[Effect]) -> Variant:
    rest = removed(scene, group)
    brought = {i.name for effect in group for i in effect.inputs(scene.dimensions)}
    brought |= {x.name for effect in group for x in effect.states(scene.dimensions)}
    needed_by = tuple(e.name for e in rest.effects if brought.intersection(_names(e)))
    model = None if needed_by else elaborate(counted(rest))
    return Variant(_label(group), model, needed_by=needed_by)


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
