"""The closed route for any small tree: constraints projected onto the velocities (Kane's
method).
"""

from dataclasses import dataclass, replace

from eomgen.base.errors import SceneError
from eomgen.derivation.definitions import Ledger
from eomgen.derivation.projected.constraints import Constraint
from eomgen.derivation.projected.equations import Motion, balance, body_motions
from eomgen.derivation.projected.loads import Loads, loads_of
from eomgen.derivation.projected.solution import Solution, solve
from eomgen.derivation.projected.tree import Tree
from eomgen.derivation.supported import FEW_VELOCITIES, why_not_closed
from eomgen.derivation.symbols import Symbols
from eomgen.derivation.terms import Terms
from eomgen.model.model import Model

WRITTEN, NAMED = (20, 160), (6, 40)
"""`inline` and `longest` of a `Ledger` for few velocities and for many."""


@dataclass(frozen=True)
class ProjectedEquations:
    """A model's equations of motion: its tree, motions, M v̇ + V + G = F, and v̇.

    `balance` is written over the first `motion_definitions` of `solution`.
    """

    tree: Tree
    motions: tuple[Motion, ...]
    loads: Loads
    balance: Terms
    motion_definitions: int
    solution: Solution

    @property
    def model(self) -> Model:
        """The model."""
        return self.tree.model

    @property
    def symbols(self) -> Symbols:
        """The symbols of the model."""
        return self.tree.symbols

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        """The joints as constraints, by body."""
        return self.tree.constraints

    @property
    def ledger(self) -> Ledger:
        """Definitions, and rates of symbols."""
        return self.tree.ledger


def derive_projected(model: Model) -> ProjectedEquations:
    """Derive and solve; see the modules of this package for each step. Raises `SceneError` for a
    model that is too large to be read or derived.
    """
    return solved(balanced(model))


def solved(e: ProjectedEquations) -> ProjectedEquations:
    """The same with their solution."""
    return replace(e, solution=solve(e.tree, e.motions, e.loads))


def balanced(model: Model) -> ProjectedEquations:
    """The equations without a solution: its definitions are those of the motion alone.

    Raises `SceneError` for a model that is too large to be read or derived.
    """
    if why_not := why_not_closed(model):
        raise SceneError(f"route: 'closed' does not derive this scene: {why_not}")
    tree = Tree.of(model, *(WRITTEN if len(model.velocities) <= FEW_VELOCITIES else NAMED))
    loads = loads_of(tree)
    motions = body_motions(tree, loads.uniform)
    equations = balance(tree, motions, loads)
    definitions = tree.ledger.definitions
    unsolved = Solution(definitions, (), ())
    return ProjectedEquations(tree, motions, loads, equations, len(definitions), unsolved)
