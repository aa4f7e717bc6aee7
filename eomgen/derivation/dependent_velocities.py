"""Equations of the freedoms of a mechanism whose positions have no closed form.

All coordinates are states. The constraints J v̇ + β = 0 are solved for dependent velocities, row by
row as in programs, and what is long gets a name: entries of J, of K and κ in v̇ = K u̇ + κ, and
those of the equations of the tree. What is left are the equations of `embedding`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import sympy as sp

from eomgen.derivation.constraints import DerivedConstraint
from eomgen.derivation.embedding import SHORT, projected, solved_for
from eomgen.derivation.linkage import linkage_of
from eomgen.derivation.loops import entry
from eomgen.derivation.matrices import Matrices
from eomgen.derivation.poses import poses
from eomgen.derivation.simplified import size
from eomgen.derivation.steps import Definition
from eomgen.derivation.symbols import Expr, real
from eomgen.derivation.terms import Terms
from eomgen.model.model import Model


@dataclass
class _Names:
    """The definitions so far."""

    found: list[Definition] = field(default_factory=list)

    def named(self, name: str, value: Expr) -> Expr:
        """A symbol for what is long."""
        if size(value) <= SHORT:
            return value
        self.found.append((real(name), value))
        return real(name)


def of_freedoms(
    model: Model, tree: Matrices, constraints: Sequence[DerivedConstraint]
) -> tuple[Matrices, int]:
    """The equations of the independent velocities as matrices, and how many definitions come before
    those of effects.
    """
    needed = dict.fromkeys(body for c in constraints for body in c.bodies)
    placed, _ = poses(linkage_of(model), needed)
    points = (pair for c in constraints for pair in (*c.definitions, *c.speeds))
    names = _Names([*placed, *points])
    K, kappa = _motions(model, constraints, names)
    words = [c.name.removesuffix("_dot") for c in model.velocities]
    n = len(words)
    M = sp.Matrix(n, n, lambda i, j: names.named(f"M_{words[min(i, j)]},{words[max(i, j)]}",
                                                 tree.M[i, j]) if i >= j else 0)  # fmt: skip
    M = sp.Matrix(n, n, lambda i, j: M[max(i, j), min(i, j)])
    forces = (_column(letter, getattr(tree, letter), words, names) for letter in "VGF")
    reduced = projected(K, kappa, Terms(M, *forces))
    dependent = {column for _, column in model.pivots}
    free = [j for j in range(n) if j not in dependent]
    rates = tuple(real(model.velocities[j].acceleration) for j in free)
    before = len(names.found)
    definitions = (*names.found, *solved_for([x.name for x in rates], reduced))
    v = tuple(tree.v[j] for j in free)
    return Matrices(*reduced.whole, tree.q, v, rates, definitions, tree.formulas), before


def _column(letter: str, vector: Expr, words: Sequence[str], names: _Names) -> Expr:
    return sp.Matrix([names.named(f"{letter}_{w}", e) for w, e in zip(words, vector, strict=True)])


def _motions(
    model: Model, constraints: Sequence[DerivedConstraint], names: _Names
) -> tuple[Expr, Expr]:
    """K and κ by elimination in the order of the model's pivots."""
    rows = [row for c in constraints for row in c.rows]
    velocities = [c.name for c in model.velocities]
    words = [name.removesuffix("_dot") for name in velocities]
    J = [
        [names.named(entry(row.name, v).name, dict(row.slopes).get(v, sp.S.Zero))
         for v in velocities]
        for row in rows
    ]  # fmt: skip
    beta = [names.named(f"beta_{row.name}", row.bend) for row in rows]
    for n, (i, j) in enumerate(model.pivots):
        for k, _ in model.pivots[n + 1 :]:
            if (share := J[k][j]) == 0:
                continue
            share = share / J[i][j]
            for h, x in enumerate(J[i]):
                name = f"J_{rows[k].name},{words[h]},{n + 1}"
                J[k][h] = names.named(name, J[k][h] - share * x) if h != j else sp.S.Zero
            beta[k] = names.named(f"beta_{rows[k].name},{n + 1}", beta[k] - share * beta[i])
    dependent = {j for _, j in model.pivots}
    free = [j for j in range(len(velocities)) if j not in dependent]
    K, kappa = sp.zeros(len(velocities), len(free)), sp.zeros(len(velocities), 1)
    for place, j in enumerate(free):
        K[j, place] = 1
    for i, j in reversed(model.pivots):
        known = [h for h in range(len(velocities)) if h != j and J[i][h] != 0]
        for place, own in enumerate(free):
            total = sum((J[i][h] * K[h, place] for h in known), sp.S.Zero)
            K[j, place] = names.named(f"K_{words[j]},{words[own]}", -total / J[i][j])
        total = sum((J[i][h] * kappa[h] for h in known), beta[i])
        kappa[j] = names.named(f"kappa_{words[j]}", -total / J[i][j])
    return K, kappa
