"""Choice of the route by which a model's equations are derived."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from eomgen.base.errors import SceneError
from eomgen.codegen.derive import Derived, derive, record
from eomgen.codegen.digits import ALL, Route, digits_lost, digits_lost_by_kind
from eomgen.derivation.supported import why_not_closed, why_not_tried
from eomgen.dynamics.orthogonal.mixed import well_conditioned
from eomgen.dynamics.start.assur import with_closed_form
from eomgen.dynamics.start.walks import with_safe_pivots
from eomgen.dynamics.tree.linkage import make_linkage
from eomgen.model.model import Model
from eomgen.model.named import Values
from eomgen.program.passes import optimise
from eomgen.program.program import Program, cost, interpreter
from eomgen.program.tape import TIME
from eomgen.scalars.floats import ArrayScalars, FloatScalars
from eomgen.tables.routes import ROUTES, routes_for

MOST_LOST = 4.0
"""Largest number of decimal digits of v̇ that a route may lose at the sampled states and still be
chosen by `auto`.
"""
SPARE = 1.0
"""Margin in digits for the route of last resort: it may lose more at states not sampled."""
ENOUGH = 10
"""Number of correct digits of v̇ from which on no notice is given."""
MOST_DENSE = 12
"""Rows of constraints beyond which only the route whose cost grows linearly with them is tried."""
FEWEST = 6
"""Smallest number of correct digits of v̇ at the worst states that is enough anywhere."""
ORDINARY, LEAST = 7, 2
"""A scene that has fewer at the worst states is refused unless it has these numbers at states that
are not aligned, and at all.
"""
DERIVATIVES_A_STEP = 4
"""The derivatives of a step for which loops in closed form and projections are compared."""
BY_INDEPENDENT = ("independent", "embedded")
"""Routes that take velocities as independent."""
MOST_FACTORING = 20_000
"""Operations of factoring M from which on `ldl` is not derived for comparison only."""


@dataclass(frozen=True)
class Candidate:
    """A route that `choose` considered.

    operations  of its `derivative`, None if the route was not tried
    words       what the operations are, or why it was not tried
    refused     whether it loses too many digits
    """

    route: str
    operations: int | None
    words: str
    refused: bool = False


@dataclass(frozen=True)
class Choice:
    """The equations by the chosen route, and all candidates.

    digits    number of correct digits of accelerations at the worst states, None if at least
              `ENOUGH`
    ordinary  at states that are not aligned
    """

    derived: Derived
    candidates: tuple[Candidate, ...]
    digits: int | None = None
    ordinary: int | None = None

    def notices(self) -> list[str]:
        """Notices for the user, one line each."""
        if self.digits is None:
            return []
        more = self.ordinary is not None and self.ordinary > self.digits
        aligned = f" where parts align, elsewhere {self.ordinary}" if more else ""
        return [
            f"{_ILL_CONDITIONED}; with the best, '{self.derived.route}', "
            f"{self.digits} of {ALL:.0f} digits of accelerations are right{aligned}"
        ]


_ILL_CONDITIONED = "the bodies and joints are so uneven that every route loses digits"


def choose(model: Model, *, closed: bool = True) -> Choice:
    """The equations of a model by the route it names; for `auto` by the route with the fewest
    operations among those that lose at most `MOST_LOST` digits.

    If all lose more, the route of last resort is taken. Without `closed`, symbolic routes, which
    take a second or two, are tried only if named.

    Raises `SceneError` if the named route does not apply to the model, or if every route loses too
    many digits.
    """
    if model.constraints:
        if model.route not in ("auto", "embedded"):
            return _only(with_closed_form(model), model.route, "named")
        made = with_closed_form(model)
        if made.groups and model.route == "auto":
            return _of_loops(made, model, closed)
        model = made if made.groups else with_safe_pivots(model)
    return _chosen(model, closed)


def without_dead_points(model: Model) -> Model:
    """The model with all coordinates as its state, by a route that takes no velocities as
    independent, so that it has no dead points: the one it names, or what `choose` takes then.
    """
    model = replace(model, loops_kept="projected")
    if model.route not in ("auto", *BY_INDEPENDENT):
        return model
    # Without pivots the routes are tried that take no velocities as independent.
    candidates = choose(replace(model, route="auto", pivots=()), closed=False).candidates
    others = [c for c in _accepted(candidates) if c.route not in BY_INDEPENDENT]
    last = next(name for name in routes_for(loops=True) if ROUTES[name].last)
    best = min(others, key=lambda c: c.operations or 0).route if others else last
    return replace(model, route=best)


def _of_loops(model: Model, other: Model, closed: bool) -> Choice:
    """The choice between a model with loops in closed form and the `other` with a state of all
    coordinates and projection: the one whose steps take fewer operations, unless it loses digits or
    the scene names the other. With many loops they are not compared: that would take as long again.
    """
    try:
        in_closed_form = _chosen(model, closed)
    except SceneError:  # too few digits
        if model.loops_kept == "closed":
            raise
        return _chosen(with_safe_pivots(other), closed)
    if model.loops_kept == "closed" or len(model.rows) > MOST_DENSE:
        return in_closed_form
    projected = _chosen(with_safe_pivots(other), closed)
    steps = [_of_step(choice) for choice in (in_closed_form, projected)]
    loses = in_closed_form.digits is not None and projected.digits is None
    counts = f"{steps[0]} operations a step, by projection {steps[1]}"
    if steps[0] > steps[1] or loses:
        why = "would lose digits" if loses else counts
        beside = Candidate("closed form", _derivative(in_closed_form), f"of loops: {why}")
        return replace(projected, candidates=(*projected.candidates, beside))
    words = f"loops by projection; in closed form {counts}"
    beside = Candidate("projection", _derivative(projected), words)
    return replace(in_closed_form, candidates=(*in_closed_form.candidates, beside))


def _derivative(choice: Choice) -> int:
    assert choice.derived.alone is not None
    return _operations(choice.derived.alone)


def _of_step(choice: Choice) -> int:
    """The operations of a step as of Runge and Kutta: four derivatives, and of a projection two
    steps of Newton's method and the velocities.
    """
    count = DERIVATIVES_A_STEP * _derivative(choice)
    program = record(choice.derived, jacobian=False).program
    if "project_position" not in program.outputs:
        return count
    names = {"constraint_residuals": 3, "project_position": 2, "project_velocity": 1}
    outputs = {name: program.outputs[name] for name in names}
    alone = optimise(replace(program, outputs=outputs, checks=()))
    return count + sum(times * cost(alone, name)["total"] for name, times in names.items())


def _chosen(model: Model, closed: bool) -> Choice:
    """The choice among routes."""
    if model.route != "auto":
        return _only(model, model.route, "named")
    if not model.velocities:
        return _only(model, "aba", "all coordinates are driven: no acceleration is solved for")
    if model.form != "velocity":
        return _only(model, "closed", f"form '{model.form}' comes from this route alone")
    candidates, attempts = _attempts(model, closed)
    routes = {name: _route(model, attempt) for name, attempt in attempts.items()}
    judged, digits, ordinary = _judged(candidates, digits_lost(model, routes)), None, None
    if not _accepted(judged):
        resorts = [n for n, spec in ROUTES.items() if spec.last and not why_not_mixed(model, n)]
        for name in resorts:
            attempts[name] = _recursive(derive(model, name))
            routes[name] = _route(model, attempts[name])
        by_kind = digits_lost_by_kind(model, routes, closely=True)
        lost = {route: max(parts) for route, parts in by_kind.items()}
        judged = _judged(candidates, lost)
        if not _accepted(judged):
            digits, ordinary = _correct_digits(by_kind["orthogonal"])
            judged += _resorts(attempts, resorts, lost)
    best = min(_accepted(judged), key=lambda c: c.operations or 0)
    return Choice(attempts[best.route].derived, tuple(judged), digits, ordinary)


def _resorts(
    attempts: Mapping[str, "_Attempt"], names: Sequence[str], lost: Mapping[str, float]
) -> list[Candidate]:
    """The routes of last resort as candidates: `orthogonal` in any case, the others unless they
    lose too many digits.
    """
    one = "aba" if "aba" in lost else min((n for n in lost if n not in names), key=lost.__getitem__)
    words = f"keeps digits that the other routes lose: {one} loses {lost[one]:.0f}"
    found = {name: Candidate(name, _operations(attempts[name].alone), words) for name in names}
    others = _judged([c for n, c in found.items() if n != "orthogonal"], lost)
    return [*others, found["orthogonal"]]


@dataclass(frozen=True)
class _Attempt:
    """A route's equations, and the optimised program of its derivative and nothing else."""

    derived: Derived
    alone: Program


def _only(model: Model, route: str, words: str) -> Choice:
    return Choice(derive(model, route), (Candidate(route, None, words),))


def _attempts(model: Model, closed: bool) -> tuple[list[Candidate], dict[str, _Attempt]]:
    """All routes except that of last resort as candidates, and the equations of those tried.

    Operations are those of `derivative` after all passes.
    """
    candidates, attempts = list[Candidate](), dict[str, _Attempt]()
    for name, spec in ROUTES.items():
        if not spec.symbolic:
            continue
        if words := why_not_closed(model) or why_not_tried(model):
            candidates.append(Candidate(name, None, words))
        elif closed:
            attempts[name] = _symbolic(derive(model, name))
            candidates.append(_candidate(name, _operations(attempts[name].alone)))
    least, fewest = least_factoring(model), math.inf
    # Routes that factor M come last, because a lower bound of their operations is known; those for
    # loops first, because where `independent` holds the range-space method gains nothing.
    there = {name: ROUTES[name] for name in routes_for(bool(model.constraints))}
    others = [name for name, spec in there.items() if not (spec.symbolic or spec.last)]
    for name in sorted(others, key=lambda name: (_factors(name), not ROUTES[name].loops)):
        words = why_not_loops(model, name)
        if model.constraints and "independent" in attempts and not ROUTES[name].loops:
            words = "not tried: independent takes fewer operations on almost all loops"
        if words:
            candidates.append(Candidate(name, None, words))
            continue
        if _factors(name) and least > fewest:
            words = f"not tried: factoring alone takes {least} operations"
            candidates.append(Candidate(name, None, words))
            continue
        attempts[name] = _recursive(derive(model, name))
        operations = _operations(attempts[name].alone)
        candidates.append(_candidate(name, operations))
        fewest = min(fewest, operations)
    return candidates, attempts


def why_not_loops(model: Model, route: str) -> str:
    """Why a route is not tried on a model with constraints; "" if it is."""
    if route == "independent" and len(model.pivots) < len(model.rows):
        return "not tried: dependent velocities do not follow from the others in every position"
    if len(model.rows) > MOST_DENSE and route != "embedded":
        return f"not tried on more than {MOST_DENSE} rows of constraints; --route {route} does"
    return ""


def why_not_mixed(model: Model, route: str) -> str:
    """Why a model is not derived by a route of last resort; "" if it is."""
    if route != "mixed":
        return ""
    if model.constraints:
        return "not tried with loops"
    linkage = make_linkage(model, model.defaults, FloatScalars())
    plain = len(well_conditioned(linkage))
    if plain == len(linkage.frames):
        return "the same as aba: no body carries one that is much heavier"
    return "" if plain else "the same as orthogonal: all joints carry much heavier bodies"


def _factors(route: str) -> bool:
    return ROUTES[route].recursion == "factored"


def _recursive(derived: Derived) -> _Attempt:
    assert derived.alone is not None
    return _Attempt(derived, derived.alone)


def _symbolic(derived: Derived) -> _Attempt:
    program = record(derived, jacobian=False).program
    outputs = {"derivative": program.outputs["derivative"]}
    return _Attempt(derived, optimise(replace(program, outputs=outputs, checks=())))


def _operations(program: Program) -> int:
    return cost(program, "derivative")["total"]


def _candidate(route: str, operations: int) -> Candidate:
    return Candidate(route, operations, "operations a call of derivative")


def _correct_digits(lost: Sequence[float]) -> tuple[int | None, int | None]:
    """The numbers of correct digits by the route of last resort, which loses `lost` at states of
    each kind: at the worst of all, and at those that are not aligned; None if `ENOUGH`. Raises
    `SceneError` for too few.
    """
    correct, ordinary = (max(0, math.floor(ALL - part - SPARE)) for part in (max(lost), lost[0]))
    if correct < LEAST or (correct < FEWEST and ordinary < ORDINARY):
        raise SceneError(
            f"route: {_ILL_CONDITIONED}; with the best, 'orthogonal', "
            f"only {correct} of {ALL:.0f} digits of accelerations would be right; make "
            "them less uneven, or give route = 'orthogonal' to take it anyway"
        )
    return (correct, ordinary) if correct < ENOUGH else (None, None)


def least_factoring(model: Model) -> int:
    """A lower bound of the operations of LᵀDL factorisation of M.

    A velocity with n others on the path to the world takes n divisions, and a product and a
    difference for each of n (n + 1) / 2 pairs of these.
    """
    return sum(above + above * (above + 1) for above in model.carriers)


def routes_of(model: Model) -> list[str]:
    """The routes that there are for a model, in order."""
    return [r for r in routes_for(bool(model.constraints)) if not why_not_mixed(model, r)]


def why_not_compared(model: Model, route: str) -> str:
    """Why a route is not derived for comparison with the chosen one; "" if it is."""
    if model.form != "velocity":
        return f"the form '{model.form}' comes from the closed form alone"
    if ROUTES[route].symbolic:
        return why_not_closed(model) or why_not_tried(model)
    least = least_factoring(model)
    if _factors(route) and least > MOST_FACTORING:
        return f"not tried: factoring alone takes {least} operations"
    return ""


def _judged(candidates: Sequence[Candidate], lost: Mapping[str, float]) -> list[Candidate]:
    """The candidates, those refused that were tried and lose more than `MOST_LOST` digits."""
    judged = []
    for candidate in candidates:
        if candidate.operations is not None and (digits := lost[candidate.route]) > MOST_LOST:
            words = f"{candidate.words}; would lose {digits:.0f} digits"
            candidate = replace(candidate, words=words, refused=True)
        judged.append(candidate)
    return judged


def _accepted(candidates: Sequence[Candidate]) -> list[Candidate]:
    """The candidates that were tried and not refused."""
    return [c for c in candidates if c.operations is not None and not c.refused]


def _route(model: Model, attempt: _Attempt) -> Route:
    """A route as `digits_lost` takes it: a function that computes v̇ at one state or several."""
    every = attempt.derived.every
    run = interpreter(every or attempt.alone, "derivative", ArrayScalars())
    names = [c.name for c in (*model.coordinates, *model.velocities)]
    first = 0 if every else len(model.coordinates)

    def accelerations(values: Values) -> Sequence[float]:
        given = {**values.parameters, **values.inputs, **values.states, TIME: 0.0}
        given |= dict(zip(names, (*values.q, *values.v), strict=True))
        return run(given)[first : first + len(model.velocities)]

    return Route(accelerations, attempt.derived.axes)
