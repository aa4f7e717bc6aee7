"""What each effect of a scene costs: operations, time, states and inputs, with it and without."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from eomgen.model import Model
from eomgen.pipeline import generate
from eomgen.run.module import GeneratedModule, load_module

ROUNDS = 7
CALLS = 200


@dataclass(frozen=True)
class Item:
    """One effect: operations of `derivative` that it adds, and time of a call in s that it adds."""

    name: str
    type: str
    operations: int
    seconds: float
    states: int
    inputs: int


@dataclass(frozen=True)
class Bill:
    """The whole and its items; `bare` is the mechanism without any effect.

    What the items add up to differs from the whole where effects share work: two that ask for the
    velocity of one point pay for it once.
    """

    name: str
    operations: int
    seconds: float
    bare_operations: int
    bare_seconds: float
    items: tuple[Item, ...]
    routes: tuple[str, ...]


def bill(model: Model) -> Bill:
    """Generate the scene whole, without each effect, and bare; count and time them in turn."""
    models = [model, _with(model, ()), *(_without(model, i) for i in range(len(model.effects)))]
    generated = [generate(_light(m)) for m in models]
    modules = [load_module(g.module, model.name) for g in generated]
    times = _times([_call(module) for module in modules])
    counts = [module.COST["derivative"]["total"] for module in modules]
    items = tuple(
        Item(
            effect.name,
            effect.type,
            counts[0] - counts[2 + i],
            times[0] - times[2 + i],
            len(effect.states(model.dimensions)),
            len(effect.inputs(model.dimensions)),
        )
        for i, effect in enumerate(model.effects)
    )
    return Bill(
        model.name,
        counts[0],
        times[0],
        counts[1],
        times[1],
        items,
        generated[0].explanation,
    )


def _without(model: Model, i: int) -> Model:
    return _with(model, tuple(effect for k, effect in enumerate(model.effects) if k != i))


def _with(model: Model, effects: Sequence[object]) -> Model:
    """The model under some of its effects only."""
    kept = tuple(effect for effect in model.effects if effect in effects)
    inputs = {i.name for effect in kept for i in effect.inputs(model.dimensions)}
    states = {x.name for effect in kept for x in effect.states(model.dimensions)}
    return replace(
        model,
        effects=kept,
        inputs=tuple(i for i in model.inputs if i.name in inputs),
        states=tuple(x for x in model.states if x.name in states),
    )


def _light(model: Model) -> Model:
    """Without outputs that only cost time to generate."""
    return replace(model, outputs=("kinetic_energy", "potential_energy", "body_poses"))


def _call(module: GeneratedModule) -> Callable[[], object]:
    start = module.initial_state()
    return lambda: module.derivative(0.0, start)


def _times(calls: Sequence[Callable[[], object]]) -> list[float]:
    """Least time of a call in s, all taken in turn, so that a busy machine is busy for all."""
    least = [float("inf")] * len(calls)
    for _ in range(ROUNDS):
        for k, call in enumerate(calls):
            begin = time.perf_counter()
            for _ in range(CALLS):
                call()
            least[k] = min(least[k], (time.perf_counter() - begin) / CALLS)
    return least
