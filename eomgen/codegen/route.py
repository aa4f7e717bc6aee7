"""Which route a model's equations take, and why."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from eomgen.codegen.from_recursion import Recording, from_recursion
from eomgen.codegen.system import System
from eomgen.derivation.supported import why_not_closed, why_not_pins, why_not_tried
from eomgen.dynamics.digits import ALL, Route, digits_lost
from eomgen.dynamics.instant import Axes
from eomgen.dynamics.moving import Values
from eomgen.errors import SceneError
from eomgen.model.model import Model
from eomgen.program.passes import optimise
from eomgen.program.program import Output, Program, cost, finish, interpreter
from eomgen.program.tape import TIME
from eomgen.scalars.floats import ArrayScalars

MOST_LOST = 4.0
"""Decimal digits of v̇ that a route may lose at ordinary states and still be taken by itself."""

SPARE = 1.0
"""Digits that the last of all routes may lose at some state more than at those it was judged at."""
ENOUGH = 10
"""Digits of v̇ of which nothing is said if so many are right."""
FEWEST = 6
"""Digits of v̇ that must be right, be it said; a scene of which fewer would be is refused."""

MOST_FACTORING = 20_000
"""Operations of factoring alone beyond which `ldl` is not tried only to be compared."""


@dataclass(frozen=True)
class Candidate:
    """A route with the operations of its `derivative`, or None and why it was not tried.

    It is `refused` if it loses too many digits.
    """

    route: str
    operations: int | None
    words: str
    refused: bool = False


@dataclass(frozen=True)
class Routed:
    """A system, and the routes it was chosen from. So many `digits` of accelerations are right, if
    fewer than `ENOUGH`; then its user must be told.
    """

    system: System
    candidates: tuple[Candidate, ...]
    digits: int | None = None

    def notices(self) -> list[str]:
        """What its user must be told."""
        if self.digits is None:
            return []
        return [
            "bodies and joints so uneven cost every route digits; by the best, 'orthogonal', "
            f"{self.digits} of {ALL:.0f} digits of accelerations are right"
        ]

    def explanation(self) -> list[str]:
        """Lines for a reader: each route, its operations, and why the one taken was taken."""
        lines = []
        for candidate in self.candidates:
            count = "-" if candidate.operations is None else str(candidate.operations)
            taken = " <- taken" if candidate.route == self.system.route else ""
            lines.append(f"{candidate.route:<10}{count:>6}  {candidate.words}{taken}".rstrip())
        return lines


@dataclass(frozen=True)
class Tried:
    """A route recorded, and the steps that its derivative takes, alone and after all passes."""

    record: Recording
    program: Program


def routed(model: Model, *, jacobian: bool = True, closed: bool = True) -> Routed:
    """The system of a model by the route it names, or by the one of the fewest operations that
    keeps its digits; with the derivative's Jacobian or without. Without `closed` that is not tried
    of itself, which takes a second or two.

    Raises `SceneError` if it names one that is not for it.
    """
    velocity = model.form == "velocity"
    why_not = why_not_closed(model) if velocity else why_not_pins(model)
    if not velocity or model.route == "closed":
        if why_not:
            asked = "route: 'closed'" if velocity else f"form: '{model.form}'"
            raise SceneError(f"{asked} needs the closed form, and {why_not}; leave it out")
        if model.route not in ("auto", "closed"):
            raise SceneError(
                f"route: '{model.route}' is for form = 'velocity'; the form '{model.form}' comes "
                "from the closed form"
            )
        words = "named" if model.route == "closed" else f"form '{model.form}' comes from it alone"
        return _taken(_closed(model, jacobian), words)
    if model.route != "auto":
        return _taken(from_recursion(recorded(model, model.route), jacobian=jacobian), "named")
    return _chosen(model, why_not, jacobian, closed)


def _chosen(model: Model, why_not: str, jacobian: bool, closed: bool) -> Routed:
    """The route of the fewest operations that keeps its digits."""
    candidates, routes = [], dict[str, Route]()
    system: System | None = None
    if words := why_not or why_not_tried(model):
        candidates.append(Candidate("closed", None, words))
    elif closed:
        system = _closed(model, jacobian)
        candidates.append(_candidate("closed", _operations(system)))
        routes["closed"] = _route(model, _alone(system.program), None)
    # Beside the closed form, which is counted as its module has it, the others are, too: among all
    # outputs. That takes little time where a closed form is tried.
    count = _operations_alone if system is None else _operations_in_module
    tried = {"aba": _tried(model, "aba")}
    aba, least = count(tried["aba"]), least_factoring(model)
    candidates.append(_candidate("aba", aba))
    if least > aba:
        words = f"not tried: factoring alone takes {least} operations"
        candidates.append(Candidate("ldl", None, words))
    else:
        tried["ldl"] = _tried(model, "ldl")
        candidates.append(_candidate("ldl", count(tried["ldl"])))
    routes |= {name: _route(model, t.program, t.record.dynamics.axes) for name, t in tried.items()}
    weighed, digits = _weighed(candidates, digits_lost(model, routes)), None
    if not _kept(weighed):
        last = tried["orthogonal"] = _tried(model, "orthogonal")
        routes["orthogonal"] = _route(model, last.program, "own")
        lost = digits_lost(model, routes, closely=True)
        weighed = _weighed(candidates, lost)
        if not _kept(weighed):
            words = (
                f"keeps digits that bodies and joints take from others, {lost['aba']:.0f} of aba"
            )
            weighed.append(Candidate("orthogonal", count(last), words))
            digits = _right(lost["orthogonal"])
    best = min(_kept(weighed), key=lambda c: c.operations or 0)
    if system is None or best.route != "closed":
        system = from_recursion(tried[best.route].record, jacobian=jacobian)
    return Routed(system, tuple(weighed), digits)


def _right(lost: float) -> int | None:
    """The digits that are right where the last of all routes loses so many; None if `ENOUGH`.
    Raises `SceneError` if too few are left.
    """
    right = max(0, math.floor(ALL - lost - SPARE))
    if right < FEWEST:
        raise SceneError(
            "route: bodies and joints so uneven cost every route digits; by the best, "
            f"'orthogonal', only {right} of {ALL:.0f} digits of accelerations would be right; make "
            "them less uneven, or give route = 'orthogonal' to take it all the same"
        )
    return right if right < ENOUGH else None


def recorded(model: Model, route: str) -> Recording:
    """A model on a tape by a recursion, in the axes that take the fewest operations.

    In the plane those are the world's, in which angles add up, unless bodies that turn carry
    slides; in space they are the frames' own.
    """
    return _tried(model, route).record


def _tried(model: Model, route: str) -> Tried:
    """The same, with its steps."""
    axes: list[Axes | None] = [None]
    if (
        route != "orthogonal"
        and model.dimensions == 2
        and any(
            move.kind == "slide"
            for body in model.bodies
            if body.parent >= 0
            for move in body.joint.moves(2)
        )
    ):
        axes.append("own")
    found = []
    for own in axes:
        record = Recording(model, route, axes=own)
        outputs = {"derivative": _output(node.index for node in record.rates)}
        found.append(Tried(record, optimise(finish(record.tape, outputs, ()))))
    return min(found, key=_operations_alone)


def _output(nodes: Iterable[int]) -> Output:
    found = tuple(nodes)
    return Output((len(found),), found)


def _alone(program: Program) -> Program:
    """The steps that a derivative takes alone and after all passes."""
    outputs = {"derivative": program.outputs["derivative"]}
    return optimise(replace(program, outputs=outputs, checks=()))


def least_factoring(model: Model) -> int:
    """Operations of LᵀDL at least: for each velocity a division and a product and a difference for
    every pair of velocities that carry it.
    """
    return sum(above + above * (above + 1) for above in model.carriers)


def why_not_compared(model: Model, route: str) -> str:
    """What keeps a route from being made beside the one taken, in a few words; "" if nothing."""
    if model.form != "velocity":
        return f"the form '{model.form}' comes from the closed form alone"
    if route == "closed":
        return why_not_closed(model) or why_not_tried(model)
    least = least_factoring(model)
    if route == "ldl" and least > MOST_FACTORING:
        return f"not tried: factoring alone takes {least} operations"
    return ""


def _closed(model: Model, jacobian: bool) -> System:
    # Imported here because SymPy takes longer to load than everything else together.
    if why_not_pins(model):
        from eomgen.codegen.from_general import from_general
        from eomgen.derivation.general.derive import derive_general

        return from_general(derive_general(model), jacobian=jacobian)
    from eomgen.codegen.from_equations import from_equations
    from eomgen.derivation.closed import derive

    return from_equations(derive(model), jacobian=jacobian)


def _taken(system: System, words: str) -> Routed:
    return Routed(system, (Candidate(system.route, _operations(system), words),))


def _weighed(candidates: Sequence[Candidate], lost: Mapping[str, float]) -> list[Candidate]:
    """Those that were tried and lose too many digits are refused."""
    weighed = []
    for candidate in candidates:
        if candidate.operations is not None and (digits := lost[candidate.route]) > MOST_LOST:
            words = f"{candidate.words}; would lose {digits:.0f} digits"
            candidate = replace(candidate, words=words, refused=True)
        weighed.append(candidate)
    return weighed


def _kept(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Those that may be taken."""
    return [c for c in candidates if c.operations is not None and not c.refused]


def _route(model: Model, program: Program, axes: Axes | None) -> Route:
    """How a program in velocity form computes v̇, of one state or of several."""
    run = interpreter(program, "derivative", ArrayScalars())
    names = [c.name for c in (*model.coordinates, *model.velocities)]
    first = len(model.coordinates)

    def found(values: Values) -> Sequence[float]:
        given = {**values.parameters, **values.inputs, **values.states, TIME: 0.0}
        given |= dict(zip(names, (*values.q, *values.v), strict=True))
        return run(given)[first : first + len(model.velocities)]

    return Route(found, axes)


def _candidate(route: str, operations: int) -> Candidate:
    return Candidate(route, operations, "operations a call of derivative")


def _operations(system: System) -> int:
    return cost(system.program, "derivative")["total"]


def _operations_alone(tried: Tried) -> int:
    """Of the derivative, computed alone."""
    return cost(tried.program, "derivative")["total"]


def _operations_in_module(tried: Tried) -> int:
    """Of the derivative, beside all other outputs."""
    again = recorded(tried.record.model, tried.record.route)
    return _operations(from_recursion(again, jacobian=False))
