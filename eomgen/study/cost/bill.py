"""The cost of each effect of a scene: operations, time, states, inputs; and its effect on motion.

Operations are those of `derivative`, counted in modules with no output but the bodies' poses.
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import inf

from eomgen.base.displays import Displayed
from eomgen.base.frozen import Frozen
from eomgen.codegen.choice import routes_of, why_not_compared
from eomgen.dynamics.start.assembly import assembled
from eomgen.dynamics.start.singularity import check_nonsingular
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.pipeline import compile_program, python_module
from eomgen.run.module import GeneratedModule, as_problem, load_module
from eomgen.run.progress import Progress
from eomgen.scene.schema import Route, Scene, Simulation
from eomgen.study.cost.omission import Change, Run, change, extent, run
from eomgen.study.cost.variants import Kind, Variant, bare, counted
from eomgen.study.timing import least_and_spread

MOTION = 10.0
"""Default wall time of all motions together, s."""
AT_CONTACTS = ("gaps", "gap_rates", "impact", "held")


@dataclass(frozen=True)
class Item:
    """The cost of one part of the scene, or of one that it omits on purpose: see `Kind`.

    operations, seconds  that it adds, or would add, to a call of `derivative`
    spread               of the times whose difference `seconds` is, s: see `Bill.spread`
    states, inputs       that it adds; negative if it removes states, as a driven joint does
    route                of the equations without it, or with it if it is omitted
    needed_by            effects that depend on it: its own cost is then unknown
    change               how omitting it changes the motion; None if that was not asked for
    """

    label: str
    kind: Kind
    operations: int = 0
    seconds: float = 0.0
    spread: float = 0.0
    states: int = 0
    inputs: int = 0
    route: str = ""
    needed_by: tuple[str, ...] = ()
    change: Change | None = None


@dataclass(frozen=True)
class RouteCost:
    """A route: operations and time, s, of a call of `derivative`; or None, and why not."""

    route: str
    operations: int | None
    seconds: float | None
    words: str


@dataclass(frozen=True, repr=False)
class Bill(Frozen, Displayed):
    """The cost of the whole scene and of its parts; `bare` is the mechanism without any effect.

    `route` and `bare_route` are those of their equations. `extent` is that of the scene's motion,
    m, or None if no motion was asked for. `spread` is how much times of the same call vary on this
    machine, s: a smaller difference means nothing. `at_contacts` are the operations of functions
    for rigid contacts, by name; they are not part of `derivative`. `stopped` says that an interrupt
    ended the motions, of which there is then none, or is "".
    """

    shown = ("route", "operations", "items", "routes", "extent", "stopped")

    name: str
    route: str
    operations: int
    seconds: float
    spread: float
    bare_route: str
    bare_operations: int
    bare_seconds: float
    items: tuple[Item, ...]
    routes: tuple[RouteCost, ...]
    t_end: float
    extent: float | None
    at_contacts: Mapping[str, int]
    stopped: str = ""

    @property
    def shared(self) -> tuple[int, float, float]:
        """Operations and time, s, that belong to no single effect, and the spread of that time.

        Effects share work: if two need the velocity of one point it is computed once, and stays
        when one of them is removed. The same holds for the cost of another route that only the bare
        mechanism admits. Negative if one effect costs more beside another than alone.
        """
        items = [item for item in self.items if item.kind == "effect"]
        return (
            self.operations - self.bare_operations - sum(item.operations for item in items),
            self.seconds - self.bare_seconds - sum(item.seconds for item in items),
            self.spread + sum(item.spread for item in items),
        )


@dataclass(frozen=True)
class _Made:
    """A model compiled and timed."""

    model: Model
    module: GeneratedModule
    route: str
    operations: int
    seconds: float = 0.0
    spread: float = 0.0


def bill(
    scene: Scene,
    parts: Sequence[Variant],
    *,
    motion: float = MOTION,
    progress: Progress = lambda fraction: None,
) -> Bill:
    """Compile a scene whole, in each of its variants, and bare. Count their operations, time them,
    and simulate them within `motion` seconds of wall time together; 0 for no simulation. `parts`
    are `variants(scene)` or some of them.

    Raises `SceneError` or `RunError` if the scene cannot be compiled or evaluated at its start.
    """
    whole = _compiled(assembled(elaborate(counted(scene))))
    tries = {route: _try(whole, route) for route in routes_of(whole.model)}
    models = [bare(scene), *(part.model for part in parts), *(m for m, _ in tries.values())]
    made: list[_Made | None] = [whole]
    for model in models:
        progress(0.5 * len(made) / (1 + len(models)))
        made.append(None if model is None else _compiled(model))
    progress(0.5)
    timed = _timed(made)
    whole, without = _there(timed[0]), _there(timed[1])
    cost = whole.module.COST
    changed, other_routes = timed[2 : 2 + len(parts)], timed[2 + len(parts) :]
    size: float | None = None
    changes: list[Change | None] = [None] * len(parts)
    stopped = ""
    if motion:
        reported = partial(_part_of, progress, 1.5, 2.5)
        try:
            size, changes = _changes(whole, parts, changed, scene.simulation, motion, reported)
        except KeyboardInterrupt:
            stopped = "interrupted; motions are not compared"
    return Bill(
        name=whole.model.name,
        route=whole.route,
        operations=whole.operations,
        seconds=whole.seconds,
        spread=whole.spread,
        bare_route=without.route,
        bare_operations=without.operations,
        bare_seconds=without.seconds,
        items=tuple(_item(whole, *part) for part in zip(parts, changed, changes, strict=True)),
        routes=tuple(
            _route_cost(route, words, whole if route == whole.route else other)
            for (route, (_, words)), other in zip(tries.items(), other_routes, strict=True)
        ),
        t_end=scene.simulation.t_end,
        extent=size,
        at_contacts={name: cost[name]["total"] for name in AT_CONTACTS if name in cost},
        stopped=stopped,
    )


def difference(seconds: float, spread: float) -> str:
    """A difference of times in µs as text; an upper bound if it is within the spread."""
    text = f"{1e6 * seconds:.1f}"
    return text if abs(seconds) > spread and float(text) else f"< {max(1e6 * spread, 0.1):.1f}"


def _there(made: _Made | None) -> _Made:
    assert made is not None
    return made


def _compiled(model: Model) -> _Made:
    """Raises `SceneError` or `RunError` if it cannot be compiled or evaluated at its start."""
    check_nonsingular(model)
    system = compile_program(model, jacobian=False).system
    module = load_module(python_module(system), model.name)
    as_problem(module)
    return _Made(model, module, system.route, module.COST["derivative"]["total"])


def _try(whole: _Made, route: Route) -> tuple[Model | None, str]:
    """The model with another route, or None and why not."""
    if route == whole.route:
        return None, "taken"
    why_not = why_not_compared(whole.model, route)
    return (None, why_not) if why_not else (replace(whole.model, route=route), "")


def _route_cost(route: str, words: str, made: _Made | None) -> RouteCost:
    if made is None:
        return RouteCost(route, None, None, words)
    return RouteCost(route, made.operations, made.seconds, words)


def _item(whole: _Made, part: Variant, other: _Made | None, change: Change | None) -> Item:
    """The difference between two modules: what the fuller one has more than the other."""
    if other is None:
        return Item(part.label, part.kind, needed_by=part.needed_by)
    more, less = (other, whole) if part.kind == "left out" else (whole, other)
    return Item(
        part.label,
        part.kind,
        more.operations - less.operations,
        more.seconds - less.seconds,
        more.spread + less.spread,
        len(more.module.STATES) - len(less.module.STATES),
        len(more.model.inputs) - len(less.model.inputs),
        route=other.route,
        change=change,
    )


def _timed(made: Sequence[_Made | None]) -> list[_Made | None]:
    """The same with the least time of a call, s, and its spread."""
    found = iter(least_and_spread([_call(one.module) for one in made if one is not None]))
    timed = []
    for one in made:
        if one is not None:
            seconds, spread = next(found)
            one = replace(one, seconds=seconds, spread=spread)
        timed.append(one)
    return timed


def _call(module: GeneratedModule) -> Callable[[], object]:
    start = module.initial_state()
    return lambda: module.derivative(0.0, start)


def _changes(
    whole: _Made,
    parts: Sequence[Variant],
    changed: Sequence[_Made | None],
    wanted: Simulation,
    seconds: float,
    progress: Progress,
) -> tuple[float, list[Change | None]]:
    """The extent of the scene's motion, m, and how far each variant's motion departs from it.

    The runs share the time allowed; none goes beyond the end of the scene's run.
    """
    count = 1 + sum(made is not None for made in changed)
    shares = _shares(seconds, count)
    done = 0

    def ran(made: _Made, until: float) -> Run:
        nonlocal done
        before, done = done, done + 1
        reported = partial(_part_of, progress, before, count)
        return run(wanted, made.module, next(shares), until, reported)

    base = ran(whole, inf)
    size = extent(whole.model, base)
    found: list[Change | None] = []
    for part, made in zip(parts, changed, strict=True):
        if made is None:
            found.append(None)
            continue
        other = ran(made, float(base.t[-1]))
        # The change by an omission on purpose is relative to the complete motion.
        complete = extent(made.model, other) if part.kind == "left out" else size
        found.append(change(whole.model, base, other, complete))
    return size, found


def _part_of(progress: Progress, done: float, count: float, fraction: float) -> None:
    progress((done + fraction) / count)


def _shares(total: float, count: int) -> Iterator[float]:
    """An equal share of the time, s, for each; what one does not use goes to those after it."""
    due = time.perf_counter() + total
    for left in range(count, 0, -1):
        yield max(0.0, due - time.perf_counter()) / left
