"""Systems of small trees by the symbolic route: SymPy's equations lowered to a tape.

v̇ and the terms of M v̇ + V + G = F are SymPy's. Energies, positions, joint forces and other
observables come from the recursions, recorded on the same tape.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from eomgen.codegen.from_recursion import from_recursion
from eomgen.codegen.recording import Recording
from eomgen.codegen.stand_ins import with_stand_ins
from eomgen.codegen.system import System, names_of_inputs
from eomgen.derivation.handout.closed import Equations, conditions
from eomgen.derivation.handout.forms import state_form
from eomgen.derivation.joint_loads import TIME as TIME_SYMBOL
from eomgen.derivation.projected.derive import ProjectedEquations
from eomgen.derivation.terms import Terms
from eomgen.language.formula import evaluate
from eomgen.model.model import Model
from eomgen.program.lower import Lowering
from eomgen.program.program import Check
from eomgen.program.tape import TIME, Node, Stage
from eomgen.scalars.exact import Real


@dataclass(frozen=True)
class ClosedForm:
    """A closed form as it is lowered.

    symbols      those of the derivation
    numbers      of these, symbols of numbers
    definitions  what v̇ consists of, each symbol over those before it
    conditions   quantities that must be positive, or may be 0 if the third entry says so
    balance      M v̇ + V + G = F, if it is over the same definitions
    """

    symbols: Any
    numbers: Mapping[Real, Any]
    definitions: Mapping[Any, Any]
    conditions: tuple[tuple[str, Any, bool], ...]
    balance: Terms | None = None


def of_projected(equations: ProjectedEquations) -> ClosedForm:
    """The closed form by projected constraints."""
    s, solution = equations.symbols, equations.solution
    positive = tuple(
        (f"inertia_com of {body}", moment, False) for body, moment in solution.divisors
    )
    return ClosedForm(s, s.numbers, solution.definitions, positive, equations.balance)


def of_pins(equations: Equations) -> ClosedForm:
    """The closed form of the handout's derivation, over [q, v]."""
    form = state_form(equations)
    found = {**equations.free_bodies.efforts, **dict(equations.solution.definitions)}
    definitions = {s: e.xreplace(form.replaced) for s, e in {**found, **form.defined}.items()}
    return ClosedForm(equations.symbols, {}, definitions, conditions(equations))


class Lowered:
    """A closed form lowered to the tape of a recording."""

    def __init__(self, form: ClosedForm, record: Recording) -> None:
        s, self.form = form.symbols, form
        self._tape, self._record = record.tape, record
        _, stand_ins = with_stand_ins(record.model, record.dynamics)
        known = {**record.parameters, **record.inputs, **stand_ins}
        named = {**s.parameters, **s.inputs}
        self._given: dict[Any, Node] = {symbol: known[name] for name, symbol in named.items()}
        for formula, symbol in s.formulas.items():
            self._given[symbol] = evaluate(formula, record.parameters, record.scalars)
        self._given |= {symbol: self._tape.constant(float(x)) for x, symbol in form.numbers.items()}
        self._given |= dict(zip((*s.q, *s.v), (*record.q, *record.v), strict=True))
        self._given[TIME_SYMBOL] = record.input(TIME, Stage.INPUTS)

    def forward(self, tau: Sequence[Node] | None = None) -> list[Node]:
        """v̇ under the effects and further generalised forces `tau`."""
        zero = self._tape.constant(0.0)
        s = self.form.symbols
        forces = [zero] * len(s.tau) if tau is None else tau
        return self.rows(s.a, dict(zip(s.tau, forces, strict=True)))

    def rows(self, expressions: Sequence[Any], given: dict[Any, Node] | None = None) -> list[Node]:
        """The nodes of expressions over the equations' symbols and those in `given`."""
        definitions = self.form.definitions
        lowering = Lowering(self._tape, self._given | (given or {}), definitions)
        # In the order of the definitions, which bounds the depth of recursion.
        for symbol in self._needed(expressions, given or {}):
            lowering.lower(symbol)
        return [lowering.lower(expression) for expression in expressions]

    def _needed(self, expressions: Sequence[Any], given: dict[Any, Node]) -> list[Any]:
        """The defined symbols that expressions use, directly or not, in order of definition."""
        definitions = self.form.definitions
        needed: set[Any] = set()
        stack = [s for e in expressions for s in e.free_symbols]
        while stack:
            symbol = stack.pop()
            if symbol in definitions and symbol not in needed and symbol not in given:
                needed.add(symbol)
                stack += definitions[symbol].free_symbols
        return [symbol for symbol in definitions if symbol in needed]


def from_closed_form(form: ClosedForm, model: Model, *, jacobian: bool = True) -> System:
    """The system of a model by route `closed`, with or without the Jacobian of the derivative."""
    record = Recording(model, "closed", lambda record: Lowered(form, record).forward)
    lowered = Lowered(form, record)
    positive = [
        Check(what, lowered.rows([value])[0].index, may_vanish)
        for what, value, may_vanish in form.conditions
    ]
    return from_recursion(
        record, jacobian=jacobian, given=partial(_dynamics, lowered, record), conditions=positive
    )


def _dynamics(
    lowered: Lowered, record: Recording, name: str, extra: dict[str, tuple[str, ...]]
) -> list[Node] | None:
    """The nodes of an output that SymPy's equations give, None for any other."""
    terms, symbols = lowered.form.balance, lowered.form.symbols
    if terms is None:
        return None
    n = len(record.v)
    match name:
        case "inverse_dynamics":
            vd = record.velocity_inputs("vd")
            extra[name] = names_of_inputs(vd)
            unknown = type(terms.V)(n, 1, symbols.a)
            needed = terms.M * unknown + terms.V + terms.G - terms.F
            return lowered.rows(list(needed), dict(zip(symbols.a, vd, strict=True)))
        case "mass_matrix":
            return lowered.rows(list(terms.M))
        case "velocity_force":
            return lowered.rows(list(terms.V))
        case "gravity_force":
            return lowered.rows(list(terms.G))
        case "bias_force":
            return lowered.rows(list(terms.V + terms.G))
        case "applied_force":
            return lowered.rows(list(terms.F))
    return None
