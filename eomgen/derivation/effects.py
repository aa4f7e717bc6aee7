"""What each effect adds to F: its own code, run over symbols that a person reads."""

import inspect
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import sympy as sp

from eomgen.derivation.dots import dotted
from eomgen.derivation.mechanism import AXES, NamingMechanism, Notes, SamplingMechanism, sampled
from eomgen.derivation.steps import Definition, Equation
from eomgen.derivation.symbols import OF_SCENE, Expr, names_of_scene, of_scene, real
from eomgen.language.formula import Name
from eomgen.language.quantity import of_joint
from eomgen.model.dependence import is_plain
from eomgen.model.effects import sliding_in
from eomgen.model.model import Model
from eomgen.scene.effects import Effect
from eomgen.scene.effects.base import (
    Contact,
    EffectTable,
    ExtraState,
    Input,
    JointLoad,
    Load,
    Mechanism,
    Vector,
)
from eomgen.scene.joints.base import WORLD

AnyLoad = Load | JointLoad


@dataclass(frozen=True)
class DerivedEffect:
    """One effect by its formulas.

    definitions  symbols that its formulas use, each over those before it, its forces last
    loads        its loads, with those symbols as their components
    kept         whether the derivation has it as it is, since nothing in it depends on the motion
    rates        its extra states' symbols, and their time derivatives
    contacts     its rigid contacts
    bodies       the bodies whose pose or motion it uses
    slides       whether the joints on which it acts are prismatic; None for some of them, or none
    samples      what samples give its extra states
    """

    effect: Effect
    definitions: tuple[Definition, ...]
    loads: tuple[AnyLoad, ...]
    kept: bool
    rates: tuple[Definition, ...]
    contacts: tuple[Contact, ...]
    bodies: tuple[str, ...]
    slides: bool | None = None
    samples: tuple[Definition, ...] = ()

    @property
    def falls(self) -> bool:
        """Whether its loads are one acceleration of all bodies; those of constraints are not."""
        return self.kept and self.effect.uniform

    @property
    def words(self) -> str:
        """What the effect is, in a sentence or two, without the keys of its table."""
        kind = type(self.effect)
        if kind.told and (" | " not in kind.told or self.slides is not None):
            return of_joint(kind.told, bool(self.slides))
        return inspect.cleandoc(kind.__doc__ or "").partition("\n\n")[0]


def derived_effects(model: Model) -> tuple[DerivedEffect, ...]:
    """All effects of a model, in order; drives are constraints and have no formula of their own."""
    return tuple(_derived(model, effect) for effect in model.effects if not effect.prescribes())


def _derived(model: Model, effect: Effect) -> DerivedEffect:
    notes = Notes(effect.name)
    _run(model, effect, notes)
    notes = Notes(effect.name, totals=notes.counts)
    loads, states, contacts = _run(model, effect, notes)
    moving = notes.bodies or notes.definitions or any(map(_moves(model), _forces(loads)))
    kept = is_plain(effect, model) and not moving and not contacts
    definitions = list(notes.definitions)
    if not kept:
        loads = named_loads(model, effect.name, loads, definitions)
    rates = tuple(
        (real(dotted(state.name)), rate)
        for state, rate in zip(effect.states(model.dimensions), states, strict=True)
    )
    sliding = sliding_in(model.bodies, model.dimensions)
    slide = {_subject(model, load) in sliding for load in loads if isinstance(load, JointLoad)}
    slides = next(iter(slide)) if len(slide) == 1 else None
    bodies = tuple(notes.bodies)
    return DerivedEffect(
        effect,
        tuple(definitions),
        tuple(loads),
        kept,
        rates,
        contacts,
        bodies,
        slides,
        _samples(model, effect),
    )


def _samples(model: Model, effect: Effect) -> tuple[Definition, ...]:
    """What a sample gives each state that it sets, after the symbols that this uses."""
    if (sampling := effect.sampling()) is None:
        return ()
    notes = Notes(effect.name)
    mechanism: Any = SamplingMechanism(model, notes)
    noise = {name: real(f"n_{name}") for name in sampling.noisy}
    names = (*sampling.sets, *sampling.holds)
    found = effect.samples(mechanism, noise)
    given = ((sampled(name), x) for name, x in zip(names, found, strict=True))
    return (*notes.definitions, *given)


def _run(
    model: Model, effect: Effect, notes: Notes
) -> tuple[list[AnyLoad], tuple[Expr, ...], tuple[Contact, ...]]:
    mechanism: Any = NamingMechanism(model, notes)
    loads = [x for x in effect.loads(mechanism) if isinstance(x, JointLoad) or x.body != WORLD]
    return loads, effect.rates(mechanism), effect.contacts(mechanism)


def _forces(loads: Iterable[AnyLoad]) -> Iterator[Expr]:
    for load in loads:
        yield from (load.force,) if isinstance(load, JointLoad) else (*load.force, *load.torque)


def _moves(model: Model) -> Any:
    still = {of_scene(name) for name in names_of_scene(model)}
    return lambda force: bool(getattr(force, "free_symbols", set()) - still)


def named_loads(
    model: Model, name: str, loads: Sequence[AnyLoad], definitions: list[Definition]
) -> list[AnyLoad]:
    """The loads with a symbol for each component, which joins the definitions."""
    count = Counter(_subject(model, load) for load in loads)
    seen: Counter[str] = Counter()
    found: list[AnyLoad] = []

    def symbol(text: str, value: Expr) -> Expr:
        if value == 0:
            return value
        definitions.append((real(text), value))
        return real(text)

    for load in loads:
        subject = _subject(model, load)
        seen[subject] += 1
        index = f"{name},{subject}" if len(count) > 1 or isinstance(load, Load) else name
        index += f",{seen[subject]}" if count[subject] > 1 else ""
        if isinstance(load, JointLoad):
            found.append(replace(load, force=symbol(f"tau_{index}", load.force)))
            continue
        force = tuple(
            symbol(f"f_{index},{axis}", f) for axis, f in zip(AXES, load.force, strict=False)
        )
        if len(load.torque) == 1:
            torque: Vector = (symbol(f"t_{index}", load.torque[0]),)
        else:
            pairs = zip(AXES, load.torque, strict=False)
            torque = tuple(symbol(f"t_{index},{axis}", t) for axis, t in pairs)
        found.append(replace(load, force=force, torque=torque, in_body=None))
    return found


def _subject(model: Model, load: AnyLoad) -> str:
    """What a load acts on: a body, or a coordinate."""
    if isinstance(load, Load):
        return load.body
    body = next(body for body in model.bodies if body.joint.name == load.joint)
    return body.velocities[load.coordinate].name.removesuffix("_dot")


def equations_of(definitions: Sequence[Definition]) -> list[Equation]:
    """Definitions as equations: components of one vector together, as columns."""
    found: list[Equation] = []
    i = 0
    while i < len(definitions):
        base, comma, axis = definitions[i][0].name.rpartition(",")
        j = i + 1
        if comma and axis in AXES:
            while j < len(definitions) and definitions[j][0].name.rpartition(",")[0] == base:
                j += 1
        group = definitions[i:j]
        if len(group) == 1:
            found.append(Equation(*group[0]))
        else:
            left, right = (sp.Matrix([pair[k] for pair in group]) for k in (0, 1))
            found.append(Equation(left, right))
        i = j
    return found


class StandIn(EffectTable):
    """Stands in for an effect that depends on the motion: its loads are inputs of these names.

    M, V and G do not depend on them, and F is linear in them.
    """

    derived: Any

    @property
    def type(self) -> str:
        """The type of the effect itself."""
        return str(self.derived.effect.type)

    def inputs(self, dimensions: int) -> tuple[Input, ...]:
        """Each force that is not 0."""
        parts = (f for f in _forces(self.derived.loads) if f != 0)
        return tuple(Input(OF_SCENE + f.name, "", "") for f in parts)

    def loads(self, mechanism: Mechanism) -> Iterator[AnyLoad]:
        """The loads, at the points of the effect."""

        def given(value: Expr) -> Expr:
            return value if value == 0 else mechanism.input(OF_SCENE + value.name)

        def fixed(value: Expr) -> Expr:
            names = {s: s.name.removesuffix(OF_SCENE) for s in getattr(value, "free_symbols", ())}
            known = {s: mechanism.value(Name(name)) for s, name in names.items()}
            return value.xreplace(known) if known else value

        for load in self.derived.loads:
            if isinstance(load, JointLoad):
                yield replace(load, force=given(load.force))
                continue
            force, torque = (tuple(map(given, x)) for x in (load.force, load.torque))
            yield replace(load, force=force, torque=torque, at=tuple(map(fixed, load.at)))


def with_symbols(model: Model, derived: Sequence[DerivedEffect]) -> Model:
    """The model with a stand-in for each effect that depends on the motion."""
    effects: list[Any] = []
    inputs = list(model.inputs)
    by_name = {d.effect.name: d for d in derived}
    for effect in model.effects:
        found = by_name.get(effect.name)
        if found is None or found.kept:
            effects.append(effect)
            continue
        stand_in = StandIn(name=effect.name, derived=found)
        effects.append(stand_in)
        inputs += stand_in.inputs(model.dimensions)
    states: tuple[ExtraState, ...] = ()
    return replace(model, effects=tuple(effects), inputs=tuple(inputs), extra=states)
