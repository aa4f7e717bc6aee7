"""Systems of small trees by the symbolic route: SymPy's equations lowered to a tape.

v̇ and the terms of M v̇ + V + G = F are SymPy's. Energies, positions, joint forces and other
observables come from the recursions, recorded on the same tape.
"""

from collections.abc import Sequence
from typing import Any

from eomgen.codegen.from_recursion import checks, output
from eomgen.codegen.jacobians import matrices
from eomgen.codegen.recording import Recording
from eomgen.codegen.system import OutputNodes, System, names_of_inputs, output_shape, recorded
from eomgen.derivation.joint_loads import TIME as TIME_SYMBOL
from eomgen.derivation.projected.derive import ProjectedEquations
from eomgen.language.formula import evaluate
from eomgen.model.states import velocity_states
from eomgen.outputs import DERIVATIVES
from eomgen.program.lower import Lowering
from eomgen.program.program import Check
from eomgen.program.tape import TIME, Node, Stage


class Lowered:
    """The equations lowered to the tape of a recording."""

    def __init__(self, equations: ProjectedEquations, record: Recording) -> None:
        self.equations = equations
        s = equations.symbols
        self._tape, self._record = record.tape, record
        self._given: dict[Any, Node] = {
            symbol: record.parameters[name] for name, symbol in s.parameters.items()
        }
        for formula, symbol in s.formulas.items():
            self._given[symbol] = evaluate(formula, record.parameters, record.scalars)
        self._given |= {symbol: self._tape.constant(float(x)) for x, symbol in s.numbers.items()}
        self._given |= dict(zip((*s.q, *s.v), (*record.q, *record.v), strict=True))
        self._given |= {symbol: record.inputs[name] for name, symbol in s.inputs.items()}
        self._given[TIME_SYMBOL] = record.input(TIME, Stage.INPUTS)

    def forward(self, tau: Sequence[Node] | None = None) -> list[Node]:
        """v̇ under the effects and further generalised forces `tau`."""
        zero = self._tape.constant(0.0)
        s = self.equations.symbols
        forces = [zero] * len(s.tau) if tau is None else tau
        return self.rows(s.a, dict(zip(s.tau, forces, strict=True)))

    def rows(self, expressions: Sequence[Any], given: dict[Any, Node] | None = None) -> list[Node]:
        """The nodes of expressions over the equations' symbols and those in `given`."""
        definitions = self.equations.solution.definitions
        lowering = Lowering(self._tape, self._given | (given or {}), definitions)
        # In the order of the definitions, which bounds the depth of recursion.
        for symbol in self._needed(expressions, given or {}):
            lowering.lower(symbol)
        return [lowering.lower(expression) for expression in expressions]

    def _needed(self, expressions: Sequence[Any], given: dict[Any, Node]) -> list[Any]:
        """The defined symbols that expressions use, directly or not, in order of definition."""
        definitions = self.equations.solution.definitions
        needed: set[Any] = set()
        stack = [s for e in expressions for s in e.free_symbols]
        while stack:
            symbol = stack.pop()
            if symbol in definitions and symbol not in needed and symbol not in given:
                needed.add(symbol)
                stack += definitions[symbol].free_symbols
        return [symbol for symbol in definitions if symbol in needed]


def from_projected(equations: ProjectedEquations, *, jacobian: bool = True) -> System:
    """The system of a model by route `closed`, with or without the Jacobian of the derivative."""
    model = equations.model
    record = Recording(model, "closed", lambda record: Lowered(equations, record).forward)
    lowered, tape, ny = Lowered(equations, record), record.tape, len(record.q) + len(record.v)
    start = [tape.constant(x) for x in (*model.initial_q, *model.initial_v)]
    nodes: OutputNodes = {"initial_state": ((ny,), start), "derivative": ((ny,), record.rates)}
    derivatives = matrices(record, with_jacobian=jacobian)
    nodes |= derivatives.nodes
    extra = dict(derivatives.extra)
    for name in model.outputs:
        if name not in DERIVATIVES:
            found = _dynamics(lowered, record, name, extra)
            nodes[name] = (
                output(record, name, extra) if found is None else (output_shape(name, model), found)
            )
    divisors = [
        Check(f"inertia_com of {body}", lowered.rows([moment])[0].index, may_vanish=False)
        for body, moment in equations.solution.divisors
    ]
    return recorded(
        model,
        "closed",
        velocity_states(model),
        tape,
        nodes,
        [*checks(record), *divisors],
        extra,
        derivatives.tangents,
    )


def _dynamics(
    lowered: Lowered, record: Recording, name: str, extra: dict[str, tuple[str, ...]]
) -> list[Node] | None:
    """The nodes of an output that SymPy's equations give, None for any other."""
    terms, symbols = lowered.equations.balance, lowered.equations.symbols
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
