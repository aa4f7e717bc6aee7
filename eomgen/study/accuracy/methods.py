"""The integration methods as a search knows them, and the cost of a run by counting operations.

The cost is the same on every machine at all times. Methods are ranked by it and not by measured
time. It adds up derivatives, Jacobians, LU factorisations, steps, rows, and checks of contacts and
branches, each times a known cost. One unit is about a microsecond on one core at 2 GHz. Only a
search with a time budget measures how long a unit takes on the given machine.

`METHODS` was fitted to runs of six built-in scenes with 2 to 90 states (mean deviation 20 %). That
of Rodas5P was not: in Python its steps take as long as those of Radau, or longer, but a long run
makes them in compiled code, where little is left beside the functions. It is counted like that.
For Taylor series, a derivative is a coefficient of all states, and the numbers are those by which
their steps in C are faster than those of DOP853 in C.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from eomgen.run.integrators import FixedStep, find_integrator
from eomgen.run.problem import Problem
from eomgen.run.tally import Tally

CALL, STATE, OPERATION = 0.9, 0.05, 0.025
"""Of a generated function: a call, each state, and each operation in scalar code."""
COLUMNS, COLUMN = 0.3, 0.0015
"""Of a Jacobian computed along all directions at once: an operation, and that for each
direction."""
DIRECTION = 1 / 32
"""The same in compiled code: that for each direction, relative to an operation."""
ENTRY = 0.01
"""Of a Jacobian: each of its entries."""
FACTORS, FLOP = 25.0, 5e-4
"""Of an LU factorisation: a call, and each multiplication."""
HELD, GAP_CHECK = 110.0, 20.0
"""Of contacts: solving the complementarity problem for their forces, and a check of the gaps."""
SWITCH = 70.0
"""Of a check whether a step crossed a branch: the call, and the evaluation of its result."""
UNKNOWN = 50
"""Operations of a function that does not report their number."""


@dataclass(frozen=True)
class Overhead:
    """What a method spends besides evaluating the derivative, in units.

    step        for each step
    evaluation  for each derivative
    state       for each derivative, and each state of it
    row         for each row interpolated between steps
    stages      of implicit methods with equal steps: stages solved for together, each with a
                Jacobian
    compiled    whether Jacobians are counted as in compiled code
    order       of a method with error control; see `Method`
    """

    step: float
    evaluation: float
    state: float
    row: float = 0.0
    stages: int = 0
    compiled: bool = False
    order: int = 5


METHODS: Mapping[str, Overhead] = {
    "euler": Overhead(28.0, 1.0, 1.0),
    "semi_implicit_euler": Overhead(30.0, 1.0, 1.0),
    "leapfrog": Overhead(40.0, 1.0, 1.0),
    "leapfrog_4": Overhead(10.0, 24.0, 5.0),
    "leapfrog_6": Overhead(10.0, 42.0, 9.0),
    "rk4": Overhead(20.0, 4.0, 0.7),
    "implicit_midpoint": Overhead(55.0, 20.0, 1.5, stages=1),
    "gauss_4": Overhead(60.0, 17.0, 1.8, stages=2),
    "gauss_6": Overhead(64.0, 12.0, 2.0, stages=3),
    "RK45": Overhead(25.0, 9.0, 0.3, 8.0),
    "DOP853": Overhead(20.0, 7.5, 0.1, 12.0, order=8),
    "taylor": Overhead(10.0, 1.0, 0.1, 2.0, order=20),
    "Rodas5P": Overhead(10.0, 2.0, 0.2, 1.0, compiled=True),
    "Radau": Overhead(150.0, 30.0, 1.0, 12.0),
    "Radau_differences": Overhead(150.0, 30.0, 1.0, 12.0),
    "BDF": Overhead(90.0, 50.0, 1.2, 18.0, order=4),
    "BDF_differences": Overhead(90.0, 50.0, 1.2, 18.0, order=4),
    "LSODA": Overhead(28.0, 1.0, 0.5, 17.0, order=10),
}
OTHER = Overhead(50.0, 10.0, 0.5, 15.0)
"""Of a method that is not in the table."""


@dataclass(frozen=True)
class Method:
    """A method in theory: error ∝ τ^exponent, work ∝ τ^-growth (with equal steps, τ = h).

    tightest  its least relative tolerance; 0 for equal steps
    """

    name: str
    exponent: float
    growth: float
    tightest: float

    @property
    def equal_steps(self) -> bool:
        """Whether τ is a step, s."""
        return not self.tightest


def method_of(name: str) -> Method:
    """The properties of a method, by its name. Raises `RunError` for an unknown name."""
    found = find_integrator(name)
    if isinstance(found, FixedStep):
        return Method(name, float(found.order), 1.0, 0.0)
    return Method(name, 1.0, 1 / METHODS.get(name, OTHER).order, found.smallest_rtol)


def function(problem: Problem, name: str, compiled: bool = False) -> float:
    """Cost of a call of a problem's function, "derivative" or "jacobian", in units; of Jacobians,
    in `compiled` code or in Python.
    """
    states = len(problem.states)
    operations = problem.operations.get(name, UNKNOWN)
    if name == "jacobian" and problem.columns and compiled:
        return CALL + OPERATION * operations * (1 + DIRECTION * states)
    if name == "jacobian" and problem.columns:
        return CALL + operations * (COLUMNS + COLUMN * states) + ENTRY * states**2
    entries = ENTRY * states**2 if name == "jacobian" else 0.0
    return CALL + STATE * states + OPERATION * operations + entries


def meter(problem: Problem, method: str) -> Callable[[Tally], float]:
    """A function that gives the cost, in units, of a run by a method so far."""
    own, states = METHODS.get(method, OTHER), len(problem.states)
    derivative = function(problem, "derivative") + own.evaluation + own.state * states
    jacobian, factors = function(problem, "jacobian", own.compiled), FACTORS + FLOP * states**3
    if own.stages:
        jacobian += (FACTORS + FLOP * (own.stages * states) ** 3) / own.stages

    def cost(tally: Tally) -> float:
        return (
            tally.steps * own.step
            + tally.rows * own.row
            + tally.derivatives * derivative
            + tally.jacobians * jacobian
            + tally.factorisations * factors
            + tally.held * HELD
            + tally.gap_checks * GAP_CHECK
            + tally.switches * SWITCH
        )

    return cost
