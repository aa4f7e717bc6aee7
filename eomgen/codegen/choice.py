"""Which route a model's equations take, and why."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from eomgen.codegen.derive import Derived, derive, record
from eomgen.codegen.system import optimised
from eomgen.derivation.supported import why_not_closed, why_not_tried
from eomgen.dynamics.digits import ALL, Route, digits_lost
from eomgen.dynamics.mechanism_state import Values
from eomgen.errors import SceneError
from eomgen.model.model import Model
from eomgen.program.passes import optimise
from eomgen.program.program import Program, cost, interpreter
from eomgen.program.tape import TIME
from eomgen.routes import ROUTES
from eomgen.scalars.floats import ArrayScalars

MOST_LOST = 4.0
"""Decimal digits of v̇ that a route may lose at ordinary states and still be chosen by `auto`."""

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
class Choice:
    """The equations of the route that was chosen, and the routes it was chosen from. So many
    `digits` of accelerations are right, if fewer than `ENOUGH`; then the report must say so.
    """

    derived: Derived
    candidates: tuple[Candidate, ...]
    digits: int | None = None

    def notices(self) -> list[str]:
        """What the report must say of it."""
        if self.digits is None:
            return []
        return [
            "bodies and joints so uneven cost every route digits; by the best, "
            f"'{self.derived.route}', {self.digits} of {ALL:.0f} digits of accelerations are right"
        ]


def choose(model: Model, *, closed: bool = True) -> Choice:
    """The equations of a model by the route it names, or by the one of the fewest operations that
    keeps its digits. Without `closed`, symbolic routes are tried only if named; they take a second
    or two.

    Raises `SceneError` if the route named is not for the model, or if all lose too many digits.
    """
    if model.route != "auto":
        return _only(model, model.route, "named")
    if model.form != "velocity":
        return _only(model, "closed", f"form '{model.form}' comes from it alone")
    candidates, tried = _tried(model, closed)
    routes = {name: _route(model, attempt) for name, attempt in tried.items()}
    weighed, digits = _weighed(candidates, digits_lost(model, routes)), None
    if not _kept(weighed):
        last = next(name for name, spec in ROUTES.items() if spec.last)
        tried[last] = _recursive(derive(model, last))
        routes[last] = _route(model, tried[last])
        lost = digits_lost(model, routes, closely=True)
        weighed = _weighed(candidates, lost)
        if not _kept(weighed):
            words = (
                f"keeps digits that bodies and joints take from others, {lost['aba']:.0f} of aba"
            )
            weighed.append(Candidate(last, _operations(tried[last].alone), words))
            digits = _right(lost[last])
    best = min(_kept(weighed), key=lambda c: c.operations or 0)
    return Choice(tried[best.route].derived, tuple(weighed), digits)


@dataclass(frozen=True)
class _Attempt:
    """A route's equations, and the steps that its derivative takes, alone and after all passes."""

    derived: Derived
    alone: Program


def _only(model: Model, route: str, words: str) -> Choice:
    return Choice(derive(model, route), (Candidate(route, None, words),))


def _tried(model: Model, closed: bool) -> tuple[list[Candidate], dict[str, _Attempt]]:
    """The routes with the operations of their derivatives after all passes, and those of them that
    were worth a try.

    Beside a symbolic route, which is counted among all outputs of its module, the others are, too:
    that takes little time where one is tried.
    """
    candidates, tried = list[Candidate](), dict[str, _Attempt]()
    for name, spec in ROUTES.items():
        if not spec.symbolic:
            continue
        if words := why_not_closed(model) or why_not_tried(model):
            candidates.append(Candidate(name, None, words))
        elif closed:
            derived = derive(model, name)
            program = _in_module(derived)
            candidates.append(_candidate(name, _operations(program)))
            tried[name] = _Attempt(derived, _alone(program))
    among_all, least, fewest = bool(tried), least_factoring(model), math.inf
    # Routes that factor M come last: what that takes at least is known beforehand.
    others = [name for name, spec in ROUTES.items() if not (spec.symbolic or spec.last)]
    for name in sorted(others, key=_factors):
        if _factors(name) and least > fewest:
            words = f"not tried: factoring alone takes {least} operations"
            candidates.append(Candidate(name, None, words))
            continue
        tried[name] = _recursive(derive(model, name))
        program = _in_module(derive(model, name)) if among_all else tried[name].alone
        candidates.append(_candidate(name, _operations(program)))
        fewest = min(fewest, _operations(program))
    return candidates, tried


def _factors(route: str) -> bool:
    return ROUTES[route].recursion == "factored"


def _recursive(derived: Derived) -> _Attempt:
    assert derived.alone is not None
    return _Attempt(derived, derived.alone)


def _in_module(derived: Derived) -> Program:
    """All outputs but the Jacobian, after all passes."""
    return optimised(record(derived, jacobian=False)).program


def _alone(program: Program) -> Program:
    """The steps that a derivative takes alone and after all passes."""
    outputs = {"derivative": program.outputs["derivative"]}
    return optimise(replace(program, outputs=outputs, checks=()))


def _operations(program: Program) -> int:
    return cost(program, "derivative")["total"]


def _candidate(route: str, operations: int) -> Candidate:
    return Candidate(route, operations, "operations a call of derivative")


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


def least_factoring(model: Model) -> int:
    """Operations of LᵀDL at least: for each velocity a division and a product and a difference for
    every pair of velocities that carry it.
    """
    return sum(above + above * (above + 1) for above in model.carriers)


def why_not_compared(model: Model, route: str) -> str:
    """What keeps a route from being made beside the one taken, in a few words; "" if nothing."""
    if model.form != "velocity":
        return f"the form '{model.form}' comes from the closed form alone"
    if ROUTES[route].symbolic:
        return why_not_closed(model) or why_not_tried(model)
    least = least_factoring(model)
    if _factors(route) and least > MOST_FACTORING:
        return f"not tried: factoring alone takes {least} operations"
    return ""


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


def _route(model: Model, attempt: _Attempt) -> Route:
    """How a route computes v̇, of one state or of several."""
    run = interpreter(attempt.alone, "derivative", ArrayScalars())
    names = [c.name for c in (*model.coordinates, *model.velocities)]
    first = len(model.coordinates)

    def found(values: Values) -> Sequence[float]:
        given = {**values.parameters, **values.inputs, **values.states, TIME: 0.0}
        given |= dict(zip(names, (*values.q, *values.v), strict=True))
        return run(given)[first : first + len(model.velocities)]

    return Route(found, attempt.derived.axes)
