"""The closed route for any small tree: constraints projected onto the velocities (Kane's
method).
"""

from dataclasses import dataclass, replace

from eomgen.base.errors import SceneError
from eomgen.derivation.projected.constraints import Constraint, state_joints
from eomgen.derivation.projected.equations import (
    Balance,
    Inertia,
    Loads,
    Motion,
    World,
    balance,
    body_motions,
    inertias,
    loads,
)
from eomgen.derivation.projected.ledger import Ledger
from eomgen.derivation.projected.solution import Solution, solve
from eomgen.derivation.supported import FEW_VELOCITIES, why_not_closed
from eomgen.derivation.symbols import Symbols, make_symbols
from eomgen.model.model import Model

WRITTEN, NAMED = (20, 160), (6, 40)
"""`inline` and `longest` of a `Ledger` for few velocities and for many."""


@dataclass(frozen=True)
class ProjectedEquations:
    """A model's equations of motion: constraints, motions, M v̇ + V + G = F, and v̇.

    `balance` is written over the first `motion_definitions` of `solution`.
    """

    model: Model
    symbols: Symbols
    bodies: tuple[Inertia, ...]
    constraints: tuple[Constraint, ...]
    motions: tuple[Motion, ...]
    loads: Loads
    balance: Balance
    motion_definitions: int
    solution: Solution
    world: World
    ledger: Ledger


def derive_projected(model: Model) -> ProjectedEquations:
    """Derive and solve; see the modules of this package for each step. Raises `SceneError` for a
    model that is too large to be read or derived.
    """
    return solved(balanced(model))


def solved(e: ProjectedEquations) -> ProjectedEquations:
    """The same with their solution."""
    found = solve(e.model, e.symbols, e.bodies, e.motions, e.loads, e.world, e.ledger)
    return replace(e, solution=found)


def balanced(model: Model) -> ProjectedEquations:
    """The equations without a solution: its definitions are those of the motion alone.

    Raises `SceneError` for a model that is too large to be read or derived.
    """
    if why_not := why_not_closed(model):
        raise SceneError(f"route: 'closed' does not derive this scene: {why_not}")
    symbols = make_symbols(model)
    few = len(model.velocities) <= FEW_VELOCITIES
    ledger = Ledger(symbols.fixed, *(WRITTEN if few else NAMED))
    bodies = inertias(model, symbols)
    constraints = state_joints(model, symbols, ledger)
    applied_loads = loads(model, symbols, bodies, ledger)
    world = World(model, constraints, ledger)
    motions = body_motions(model, constraints, applied_loads.uniform, world, ledger, symbols)
    equations = balance(model, symbols, bodies, motions, applied_loads, world, ledger)
    before = len(ledger.definitions)
    return ProjectedEquations(
        *(model, symbols, bodies, constraints, motions, applied_loads, equations, before),
        *(Solution(ledger.definitions, (), ()), world, ledger),
    )
