"""Which route a model's equations take, and why."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from eomgen.derivation.recursive.digits import ALL, Accelerations, digits_lost
from eomgen.derivation.recursive.moving import Values
from eomgen.derivation.recursive.numbers import FloatScalars
from eomgen.derivation.supported import why_not_closed, why_not_pins, why_not_tried
from eomgen.errors import SceneError
from eomgen.model import Model
from eomgen.program.from_recursion import Recording, from_recursion
from eomgen.program.program import Output, cost, finish, interpreter
from eomgen.program.system import System
from eomgen.program.tape import TIME

MOST_LOST = 4.0
"""Decimal digits of v̇ that a route may lose at ordinary states and still be taken by itself."""

MOST_LOST_OF_ALL = 5.0
"""That the last of all routes may lose; a scene for which it loses more is refused."""

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
    """A system, and the routes it was chosen from."""

    system: System
    candidates: tuple[Candidate, ...]

    def explanation(self) -> list[str]:
        """Lines for a reader: each route, its operations, and why the one taken was taken."""
        lines = []
        for candidate in self.candidates:
            count = "-" if candidate.operations is None else str(candidate.operations)
            taken = " <- taken" if candidate.route == self.system.route else ""
            lines.append(f"{candidate.route:<10}{count:>6}  {candidate.words}{taken}".rstrip())
        return lines


def routed(model: Model, *, jacobian: bool = True) -> Routed:
    """The system of a model by the route it names, or by the one of the fewest operations that
    keeps its digits; with the derivative's Jacobian or without.

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
    candidates = []
    closed: System | None = None
    if why_not:
        candidates.append(Candidate("closed", None, why_not))
    elif words := why_not_tried(model):
        candidates.append(Candidate("closed", None, words))
    else:
        closed = _closed(model, jacobian)
        candidates.append(_candidate("closed", _operations(closed)))
    # Beside the closed form, which is counted as its module has it, the others are, too: among all
    # outputs, after the passes. That takes little time where a closed form is tried.
    count = _operations_of if closed is None else _operations_in_module
    records = {"aba": recorded(model, "aba")}
    aba, least = count(records["aba"]), least_factoring(model)
    candidates.append(_candidate("aba", aba))
    if least > aba:
        words = f"not tried: factoring alone takes {least} operations"
        candidates.append(Candidate("ldl", None, words))
    else:
        records["ldl"] = recorded(model, "ldl")
        candidates.append(_candidate("ldl", count(records["ldl"])))
    by_closed = None if closed is None else _accelerations(closed)
    ldl = "ldl" in records
    tried = _weighed(candidates, digits_lost(model, by_closed, ldl=ldl))
    if not _kept(tried):
        lost = digits_lost(model, by_closed, ldl=ldl, closely=True)
        tried = _weighed(candidates, lost)
        if not _kept(tried):
            records["orthogonal"] = recorded(model, "orthogonal")
            tried.append(_last_resort(records["orthogonal"], lost))
    candidates = tried
    best = min(_kept(candidates), key=lambda c: c.operations or 0)
    if closed is None or best.route != "closed":
        closed = from_recursion(records[best.route], jacobian=jacobian)
    return Routed(closed, tuple(candidates))


def recorded(model: Model, route: str) -> Recording:
    """A model on a tape by a recursion, in the axes that take the fewest operations.

    In the plane those are the world's, in which angles add up, unless bodies that turn carry
    slides; in space they are the frames' own.
    """
    record = Recording(model, route)
    if route == "orthogonal":
        return record
    if model.dimensions == 2 and any(
        move.kind == "slide"
        for body in model.bodies
        if body.parent >= 0
        for move in body.joint.moves(2)
    ):
        return min(record, Recording(model, route, axes="own"), key=_operations_of)
    return record


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
        from eomgen.derivation.general.derive import derive_general
        from eomgen.program.from_general import from_general

        return from_general(derive_general(model), jacobian=jacobian)
    from eomgen.derivation.closed import derive
    from eomgen.program.from_equations import from_equations

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


def _last_resort(record: Recording, lost: Mapping[str, float]) -> Candidate:
    """Orthogonal elimination. Raises `SceneError` if it loses too many digits, too."""
    if lost["orthogonal"] > MOST_LOST_OF_ALL:
        raise SceneError(
            f"route: every one loses digits at these masses and lengths, 'orthogonal' "
            f"{lost['orthogonal']:.0f} of {ALL:.0f}; make them less uneven, or name the route to "
            "take it all the same"
        )
    words = f"keeps the digits that these masses take from the others, {lost['aba']:.0f} of aba"
    return Candidate("orthogonal", _operations_of(record), words)


def _accelerations(system: System) -> Accelerations:
    """v̇ as a system in velocity form has it."""
    model = system.model
    run = interpreter(system.program, "derivative", FloatScalars())

    def found(values: Values) -> Sequence[float]:
        names = [c.name for c in (*model.coordinates, *model.velocities)]
        given = {**values.parameters, **values.inputs, TIME: 0.0}
        given |= dict(zip(names, (*values.q, *values.v), strict=True))
        return run(given)[-len(model.velocities) :]

    return found


def _candidate(route: str, operations: int) -> Candidate:
    return Candidate(route, operations, "operations a call of derivative")


def _operations(system: System) -> int:
    return cost(system.program, "derivative")["total"]


def _operations_in_module(record: Recording) -> int:
    """Of the derivative after all passes, beside all other outputs."""
    again = recorded(record.model, record.route)
    return _operations(from_recursion(again, jacobian=False))


def _operations_of(record: Recording) -> int:
    """Of the derivative alone as it is recorded."""
    rates = record.rates
    outputs = {"derivative": Output((len(rates),), tuple(node.index for node in rates))}
    return cost(finish(record.tape, outputs, ()), "derivative")["total"]
