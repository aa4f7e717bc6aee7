"""M q̈ = F - V - G solved in closed form, on pivots that are sums of positive terms.

The unknowns are the root's acceleration (floating trees) and every body's own angular acceleration.
In them the mass matrix is a sum of weighted squares, Σ w jᵀ j: one row (I; 1) a body, and two rows
(m; ∂ẍ/∂z) for its centre of mass. Eliminating an unknown from two such rows with the entries a, b
and weights w₁, w₂ leaves

    the pivot      w₁ a² + w₂ b²
    and one row    a · row₂ - b · row₁   of weight   w₁ w₂ / (w₁ a² + w₂ b²)

(a Givens rotation without its square root: Gentleman 1973, Golub & Van Loan §5.3). Weights are
never subtracted: every pivot is a sum of positive terms, and is positive for positive masses.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import sympy as sp

from eomgen.derivation.handout.elimination import Tree, trees
from eomgen.derivation.handout.kinematics import Kinematics
from eomgen.derivation.handout.symbols import BodySymbols, Vec, add, scale
from eomgen.derivation.rewriting import by_variables, is_sum_of_positive_terms, tidy
from eomgen.derivation.steps import Definition
from eomgen.derivation.symbols import Expr
from eomgen.model.model import Model


@dataclass(frozen=True)
class Solution:
    """The closed form: definitions in order, the last of them the accelerations themselves.

    `pivots` are the symbols that the solution divides by; `masses`, of whole floating trees, are
    among them.
    """

    definitions: tuple[Definition, ...]
    pivots: tuple[Expr, ...]
    masses: tuple[Definition, ...]


@dataclass(frozen=True)
class _Row:
    """One weighted square: weight and entries by unknown (index of the body whose angle it is)."""

    weight: Expr
    entries: dict[int, Expr]


@dataclass(frozen=True)
class _Pair:
    """Two squares of equal weight, x and y of one vector, which can be rotated without cost."""

    weight: Expr
    entries: dict[int, Vec]

    def rotated(self, angle: Expr, symbols: BodySymbols) -> list[_Row]:
        """The two rows in axes turned by `angle`."""
        c, s = sp.cos(angle), sp.sin(angle)
        pairs = self.entries.items()
        along = {k: by_variables(tidy(c * x + s * y), symbols.fixed) for k, (x, y) in pairs}
        across = {k: by_variables(tidy(c * y - s * x), symbols.fixed) for k, (x, y) in pairs}
        rows = ({k: e for k, e in row.items() if e != 0} for row in (along, across))
        return [_Row(self.weight, row) for row in rows if row]


@dataclass
class _Notes:
    """The definitions made so far, the only mutable object of this module."""

    definitions: list[Definition] = field(default_factory=list)
    pivots: list[Expr] = field(default_factory=list)
    masses: list[Definition] = field(default_factory=list)

    def define(self, symbol: Expr, expression: Expr) -> Expr:
        self.definitions.append((symbol, expression))
        return symbol

    def fresh(self, name: str, expression: Expr, *, positive: bool = False) -> Expr:
        if expression.is_Atom:
            return expression
        symbol = sp.Symbol(name, positive=True) if positive else sp.Symbol(name, real=True)
        return self.define(symbol, expression)


def solve(kin: Kinematics, right_side: Expr) -> Solution:
    """Solve for all accelerations.

    `right_side` is F - V - G in the rows of `body_rows`. The definitions end with the accelerations
    `xdd`, `ydd`, `alpha` of every body and `a` of every coordinate, over the symbols `x`, `y`,
    `angle`, `xd`, `yd`, `omega` of the bodies.
    """
    notes, model, symbols = _Notes(), kin.model, kin.symbols
    for tree in trees(model):
        _solve_tree(kin, tree, right_side, notes)
    for k, (body, last) in enumerate(zip(model.bodies, model.angle_index, strict=True)):
        if len(body.positions) > 1:
            notes.define(symbols.a[last - 2], symbols.xdd[k])
            notes.define(symbols.a[last - 1], symbols.ydd[k])
        else:
            ddx, ddy = (e.xreplace(kin.inward) for e in kin.acceleration[k])
            notes.define(symbols.xdd[k], ddx)
            notes.define(symbols.ydd[k], ddy)
        base = symbols.alpha[body.parent] if body.parent >= 0 else sp.Integer(0)
        notes.define(symbols.a[last], symbols.alpha[k] - base)
    return Solution(tuple(notes.definitions), tuple(notes.pivots), tuple(notes.masses))


def _solve_tree(kin: Kinematics, tree: Tree, right_side: Expr, notes: _Notes) -> None:
    model, symbols = kin.model, kin.symbols
    # ∂ẍ/∂α of each body, and so the two squares of its centre of mass.
    carried: dict[int, dict[int, Vec]] = {}
    for k in tree.bodies:
        parent = model.bodies[k].parent
        entries = dict(carried.get(parent, {}))
        if not (tree.floating and k == tree.root):
            ddx, ddy = (e.xreplace(kin.inward) for e in kin.acceleration[k])
            for i in tuple(dict.fromkeys((parent, k))):
                if i >= 0:
                    old = entries.get(i, (sp.Integer(0), sp.Integer(0)))
                    slope = (sp.diff(ddx, symbols.alpha[i]), sp.diff(ddy, symbols.alpha[i]))
                    entries[i] = (old[0] + slope[0], old[1] + slope[1])
        carried[k] = {i: e for i, e in entries.items() if e != (0, 0)}
    pairs = [_Pair(symbols.mass[k], carried[k]) for k in tree.bodies]
    load = {k: tidy(right_side[model.angle_index[k]].xreplace(kin.inward)) for k in tree.bodies}
    root = model.bodies[tree.root].name
    if tree.floating:
        x = model.angle_index[tree.root] - 2
        push = tuple(tidy(right_side[x + i].xreplace(kin.inward)) for i in (0, 1))
        total, moment, pairs = _eliminate_translation(pairs)
        tree_mass = notes.fresh(f"mass__{root}", total, positive=True)
        notes.pivots.append(tree_mass)
        notes.masses.append((tree_mass, total))
        mean = {k: scale(1 / tree_mass, e) for k, e in moment.items()}
        for k, (jx, jy) in mean.items():
            load[k] = by_variables(
                tidy(load[k] - jx * push[0] - jy * push[1]), symbols.fixed, {tree_mass: total}
            )
    pivots, couplings = _eliminate_angles(model, symbols, tree, pairs, load, notes)
    for k in tree.bodies:  # the root was eliminated last and is known first
        known = sum((h * symbols.alpha[i] for i, h in couplings[k].items()), sp.Integer(0))
        notes.define(symbols.alpha[k], (load[k] - known) / pivots[k])
    if tree.floating:
        for axis, result in ((0, symbols.xdd[tree.root]), (1, symbols.ydd[tree.root])):
            rotational = sum((j[axis] * symbols.alpha[k] for k, j in mean.items()), sp.Integer(0))
            mean_force = push[axis] / tree_mass
            notes.define(
                result,
                by_variables(tidy(mean_force - rotational), symbols.fixed, {tree_mass: total}),
            )


def _eliminate_translation(
    pairs: Sequence[_Pair],
) -> tuple[Expr, dict[int, Vec], list[_Pair]]:
    """Eliminate a floating tree's translation, whose entry is 1 in every pair.

    Returns the pivot (the tree's mass), the pivot times the entries of its row, and the pairs that
    are left: the differences of Jacobi's coordinates, of weight m₁ m₂ / (m₁ + m₂).
    """
    zero = (sp.Integer(0), sp.Integer(0))
    total, left = pairs[0].weight, []
    moment = {k: scale(pairs[0].weight, e) for k, e in pairs[0].entries.items()}  # Σ m ∂ẍ/∂z
    for pair in pairs[1:]:
        both = dict.fromkeys((*moment, *pair.entries))
        difference = {
            k: add(pair.entries.get(k, zero), scale(-1 / total, moment.get(k, zero))) for k in both
        }
        left.append(_Pair(total * pair.weight / (total + pair.weight), difference))
        moment = {
            k: add(moment.get(k, zero), scale(pair.weight, pair.entries.get(k, zero))) for k in both
        }
        total += pair.weight
    return total, moment, left


def _eliminate_angles(
    model: Model,
    symbols: BodySymbols,
    tree: Tree,
    pairs: list[_Pair],
    load: dict[int, Expr],
    notes: _Notes,
) -> tuple[dict[int, Expr], dict[int, dict[int, Expr]]]:
    """Eliminate the angular accelerations from the leaves to the root; changes `load` in place.

    Returns for each body its pivot and the couplings of its pivot row to those eliminated later.
    """
    rows: list[_Row] = []
    pivots: dict[int, Expr] = {}
    couplings: dict[int, dict[int, Expr]] = {}
    for k in reversed(tree.bodies):
        name = model.bodies[k].name
        inertia = [_Row(symbols.inertia[k], {k: sp.Integer(1)})] if symbols.inertia[k] != 0 else []
        own = [
            row
            for pair in pairs
            if k in pair.entries
            for row in pair.rotated(symbols.angle[k], symbols)
        ]
        pairs = [pair for pair in pairs if k not in pair.entries]
        here = [row for row in (*inertia, *own, *rows) if k in row.entries]
        rows = [row for row in (*own, *rows) if k not in row.entries]
        pivot, coupling, left = _eliminate(k, here)
        rows += left
        pivots[k] = notes.fresh(f"pivot__{name}", positive_form(pivot, notes), positive=True)
        notes.pivots.append(pivots[k])
        rows = _named_rows(rows, name, notes)
        load[k] = notes.fresh(f"load__{name}", load[k])
        couplings[k] = {}
        for i in tree.bodies:
            if coupling.get(i, 0) != 0:
                other = model.bodies[i].name
                couplings[k][i] = notes.fresh(
                    f"coupling__{name}__{other}", by_variables(tidy(coupling[i]), symbols.fixed)
                )
                load[i] = load[i] - couplings[k][i] / pivots[k] * load[k]
    return pivots, couplings


def _eliminate(k: int, rows: Sequence[_Row]) -> tuple[Expr, dict[int, Expr], list[_Row]]:
    """Eliminate unknown `k` from rows that contain it: pivot, Σ w a j of the rest, other rows."""
    zero = sp.Integer(0)
    first, *others = rows
    weight, a = first.weight, first.entries[k]
    p = {i: e for i, e in first.entries.items() if i != k}
    left = []
    for row in others:
        b = row.entries[k]
        pivot = weight * a**2 + row.weight * b**2
        columns = dict.fromkeys((*p, *(i for i in row.entries if i != k)))
        rest = {i: a * row.entries.get(i, zero) - b * p.get(i, zero) for i in columns}
        rest = {i: e for i, e in rest.items() if e != 0}
        if rest:
            left.append(_Row(weight * row.weight / pivot, rest))
        coupling = {
            i: weight * a * p.get(i, zero) + row.weight * b * row.entries.get(i, zero)
            for i in columns
        }
        weight, a, p = pivot, sp.Integer(1), {i: h / pivot for i, h in coupling.items()}
    return weight * a**2, {i: sp.cancel(weight * a * e) for i, e in p.items()}, left


def _named_rows(rows: Sequence[_Row], name: str, notes: _Notes) -> list[_Row]:
    """Name long entries, so that expressions stay small for any size of tree."""
    named = []
    for n, row in enumerate(rows):
        weight, entries = row.weight, row.entries
        if sp.count_ops(weight) > 12:
            weight = notes.fresh(f"weight__{name}__{n}", weight, positive=True)
        named.append(
            _Row(weight, {
                i: notes.fresh(f"row__{name}__{n}__{i}", e) if sp.count_ops(e) > 12 else e
                for i, e in entries.items()
            })
        )  # fmt: skip
    return named


LONGEST_REWRITTEN = 80
"""Operations of a pivot beyond which rewriting it would cost more than it saves."""


def positive_form(pivot: Expr, notes: _Notes) -> Expr:
    """A short pivot A cos² + B sin² + C as (A + C) + (B - A) sin², if B - A is positive at sight.

    Earlier pivots that depend on parameters only are written out first, so that terms can cancel:
    m - I m / (I + m l²) is m² l² / (I + m l²).
    """
    constant = {s: e for s, e in notes.definitions if s.is_positive and not e.has(sp.sin, sp.cos)}
    written = pivot.xreplace(constant)
    cosines = sorted(written.atoms(sp.cos), key=sp.default_sort_key)
    if len(cosines) != 1 or sp.count_ops(written) > LONGEST_REWRITTEN:
        return pivot
    angle = cosines[0].args[0]
    squares = (sp.cos(angle) ** 2, sp.sin(angle) ** 2, sp.Integer(1))
    parts: dict[Expr, list[Expr]] = {square: [] for square in squares}
    for term in sp.Add.make_args(written):
        coefficient, moving = term.as_independent(sp.sin, sp.cos)
        if moving not in parts:
            return pivot
        parts[moving].append(coefficient)
    a, b, c = (sp.Add(*terms) for terms in parts.values())
    fixed, varying = sp.factor(sp.together(a + c)), sp.factor(sp.together(b - a))
    if not is_sum_of_positive_terms(fixed):  # factoring may have expanded a square
        fixed = a + c
    if not (is_sum_of_positive_terms(fixed) and is_sum_of_positive_terms(varying)):
        return pivot
    return fixed + varying * sp.sin(angle) ** 2
