"""Variants of a scene: without some effects, or with what it omits on purpose."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Literal

from eomgen.dynamics.start.assembly import assembled
from eomgen.language.base import formulas_in
from eomgen.language.formula import names_in
from eomgen.language.rates import with_rates
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.scalars.floats import FloatScalars
from eomgen.scene.effects import Effect
from eomgen.scene.schema import Scene

Kind = Literal["effect", "mechanism", "left out"]
"""What the variant changes: an effect that acts, a part of the mechanism itself, or something that
the scene omits on purpose and the variant has."""


@dataclass(frozen=True)
class Variant:
    """A scene with one change, which leaves its bodies as they are.

    label      the change, as text
    model      the changed model; None if other effects depend on what is removed
    needed_by  names of effects whose formulas use an input or a state of what is removed
    """

    label: str
    model: Model | None
    kind: Kind = "effect"
    needed_by: tuple[str, ...] = ()


def variants(scene: Scene, *, each: bool = False) -> tuple[Variant, ...]:
    """The scene without each of its parts, and with each of its deliberate omissions."""
    return (*without_effects(scene, each=each), *without_velocity_forces(scene), *complete(scene))


def without_velocity_forces(scene: Scene) -> tuple[Variant, ...]:
    """The scene without V of M v̇ + V + G = F, if it has V and that can be left out."""
    if scene.leave_out or scene.form != "velocity" or scene.route == "closed":
        return ()
    changed = scene.replaced(leave_out=("velocity_forces",))
    return (Variant("velocity forces", assembled(elaborate(counted(changed))), "mechanism"),)


def complete(scene: Scene) -> tuple[Variant, ...]:
    """The scene with what it omits: velocity forces, and the motion of locked coordinates, which
    then start at their locked values.
    """
    found = []
    if scene.leave_out:
        found.append(("velocity forces", scene.replaced(leave_out=())))
    if scene.locked:
        count = len(scene.locked)
        label = f"{count} locked coordinate" + "s" * (count > 1)
        found.append((label, _started(scene, (None,)).replaced(locked={})))
    return tuple(Variant(label, assembled(elaborate(counted(s))), "left out") for label, s in found)


def _started(scene: Scene, by: Collection[str | None]) -> Scene:
    """The scene with initial values for coordinates driven by some effects, or locked (None)."""
    model = assembled(elaborate(counted(scene)))
    q = dict(zip((c.name for c in model.coordinates), model.initial_q, strict=True))
    v = dict(zip((c.name for c in model.velocities), model.initial_v, strict=True))
    for c in (c for c in model.prescribed if c.by in by):
        value, rate, _ = with_rates(c.value, model.defaults, 0.0, FloatScalars())
        q[c.position.name], v[c.velocity.name] = float(value), float(rate)
    return scene.replaced(initial=scene.initial.replaced(q=q, v=v, guess={}))


def counted(scene: Scene) -> Scene:
    """The scene with no output but the poses, which are needed to compare motions."""
    return scene.replaced(outputs=("body_poses",))


def without_effects(scene: Scene, *, each: bool = False) -> tuple[Variant, ...]:
    """The scene without each type of effect, or with `each` without each single effect, in order.

    Each model is built anew, so that parameters, inputs and states of the effect go with it.
    """
    groups: dict[str, list[Effect]] = {}
    for effect in scene.effects:
        groups.setdefault(effect.name if each else effect.type, []).append(effect)
    return tuple(_without(scene, group) for group in groups.values())


def bare(scene: Scene) -> Model:
    """The mechanism without any effect."""
    return assembled(elaborate(counted(removed(scene, scene.effects))))


def removed(scene: Scene, effects: Sequence[Effect]) -> Scene:
    """The scene without some effects; joints that they drove keep their initial values."""
    drives = [effect.name for effect in effects if effect.prescribes()]
    if drives:
        scene = _started(scene, drives)
    return scene.replaced(effects=tuple(e for e in scene.effects if e not in effects))


def _without(scene: Scene, group: Sequence[Effect]) -> Variant:
    rest = removed(scene, group)
    brought = {i.name for effect in group for i in effect.inputs(scene.dimensions)}
    brought |= {x.name for effect in group for x in effect.states(scene.dimensions)}
    needed_by = tuple(e.name for e in rest.effects if brought.intersection(_names(e)))
    model = None if needed_by else assembled(elaborate(counted(rest)))
    return Variant(_label(group), model, needed_by=needed_by)


def _label(group: Sequence[Effect]) -> str:
    """`2 drag`, `drag (air)`, `gravity`."""
    kind, name = group[0].type, group[0].name
    if len(group) > 1:
        return f"{len(group)} {kind}"
    return kind if name == kind else f"{kind} ({name})"


def _names(effect: Effect) -> Iterator[str]:
    """Every name in the formulas of an effect."""
    return chain.from_iterable(map(names_in, formulas_in(effect)))
