"""What a run costs, by counting: the same on every machine and at every hour.

Methods are ranked by this, never by the clock: evaluations of the derivative and the Jacobian, LU
factors by their size, steps, rows, looks at contacts and at branches, each times a cost that is
known before. A unit is about a microsecond of one core of 2 GHz; what one unit takes here is for
those to measure who have to keep within a time.

`METHODS` was fitted to runs of six built-in scenes of 2 to 90 states (mean deviation a fifth).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from eomgen.run.problem import Problem
from eomgen.run.tally import Tally

CALL, STATE, OPERATION = 0.9, 0.05, 0.025
"""Of a generated function: a call, each state passed, and each operation, in scalar code."""
COLUMNS, COLUMN = 0.3, 0.0015
"""Of a Jacobian that is computed along all directions at once: an operation, and of each
direction."""
ENTRY = 0.01
"""Of a Jacobian: each of its entries."""
FACTORS, FLOP = 25.0, 5e-4
"""LU factors: a call, and each multiplication of them."""
HELD, LOOK = 110.0, 20.0
"""Contacts: forces of those that are held by a complementarity problem, a look at the gaps."""
SWITCH = 70.0
"""Branches that a step may pass over: a call of what tells of them, and what is done with it."""
UNKNOWN = 50
"""Operations of a function that does not tell them."""


@dataclass(frozen=True)
class Overhead:
    """What a method spends around the derivative, in units.

    step        a step
    evaluation  an evaluation of the derivative
    state       of that, each state
    row         a row between steps
    stages      of implicit equal steps: how many are solved for at once, each with a Jacobian
    """

    step: float
    evaluation: float
    state: float
    row: float = 0.0
    stages: int = 0


METHODS: Mapping[str, Overhead] = {
    "euler": Overhead(28.0, 1.0, 1.0),
    "semi_implicit_euler": Overhead(30.0, 1.0, 1.0),
    "leapfrog": Overhead(40.0, 1.0, 1.0),
    "rk4": Overhead(20.0, 4.0, 0.7),
    "implicit_midpoint": Overhead(55.0, 20.0, 1.5, stages=1),
    "gauss_4": Overhead(60.0, 17.0, 1.8, stages=2),
    "gauss_6": Overhead(64.0, 12.0, 2.0, stages=3),
    "RK45": Overhead(25.0, 9.0, 0.3, 8.0),
    "DOP853": Overhead(20.0, 7.5, 0.1, 12.0),
    "gragg_bulirsch_stoer": Overhead(60.0, 7.0, 0.3, 12.0),
    "Radau": Overhead(150.0, 30.0, 1.0, 12.0),
    "Radau_differences": Overhead(150.0, 30.0, 1.0, 12.0),
    "BDF": Overhead(90.0, 50.0, 1.2, 18.0),
    "BDF_differences": Overhead(90.0, 50.0, 1.2, 18.0),
    "LSODA": Overhead(28.0, 1.0, 0.5, 17.0),
}
OTHER = Overhead(50.0, 10.0, 0.5, 15.0)
"""Of a method that is not listed."""


def function(problem: Problem, name: str) -> float:
    """One call of a function of a problem: "derivative" or "jacobian"."""
    states = len(problem.states)
    operations = problem.operations.get(name, UNKNOWN)
    if name == "jacobian" and problem.columns:
        return CALL + operations * (COLUMNS + COLUMN * states) + ENTRY * states**2
    entries = ENTRY * states**2 if name == "jacobian" else 0.0
    return CALL + STATE * states + OPERATION * operations + entries


def meter(problem: Problem, method: str) -> Callable[[Tally], float]:
    """What tells of a run of a problem by a method how many units it has taken so far."""
    own, states = METHODS.get(method, OTHER), len(problem.states)
    derivative = function(problem, "derivative") + own.evaluation + own.state * states
    jacobian, factors = function(problem, "jacobian"), FACTORS + FLOP * states**3
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
            + tally.looks * LOOK
            + tally.switches * SWITCH
        )

    return cost
