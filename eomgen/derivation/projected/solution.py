"""M v̇ = F - V - G solved on pivots that are sums of weighted squares.

By Gauss's principle the accelerations v̇ minimise Σ w (j v̇ + b)²: three squares a body for its
centre of mass, with its mass as weight, three for its rotation, with its moments of inertia, and
one for each rotor. b is the acceleration at v̇ = 0, from velocities and gravity. All other forces Q
are a linear term beside the sum. Eliminating an unknown k with entry a in each row takes

    pivot       d = Σ w a²
    coupling    c_j = Σ w a j / d       and   β = Σ w a b / d
    rows        j - a c_j,   b - a β    forces   Q_j - c_j Q_k
    leaving     v̇_k = Q_k / d - β - Σ c_j v̇_j, or f / d - Σ c_j v̇_j with f = Q_k - d β

(weighted Gram-Schmidt, Golub & Van Loan §5.2). No pivot is a difference of large numbers. A
floating tree's translation is eliminated first, in the axes of its root; then all other velocities,
from the leaves to the root.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import sympy as sp

from eomgen.derivation.definitions import Ledger
from eomgen.derivation.linkage import Frame
from eomgen.derivation.projected.equations import Motion, generalised
from eomgen.derivation.projected.loads import Loads
from eomgen.derivation.projected.tree import Tree
from eomgen.derivation.rewriting import is_sum_of_positive_terms, nested, sum_of_squares
from eomgen.derivation.symbols import Expr
from eomgen.model.model import Model


@dataclass
class Row:
    """One weighted square: entries by index of velocity, and the acceleration b at v̇ = 0."""

    weight: Expr
    entries: dict[int, Expr]
    bias: Expr


@dataclass(frozen=True)
class Translation:
    """The eliminated translation of a floating tree.

    root, mass  index of its root, and the mass of the tree
    mean        mass-weighted mean of the centres' partial velocities by velocity, in root axes
    bias        mass-weighted mean of their accelerations at v̇ = 0, in root axes
    force       the force on the translation, in world axes
    """

    root: int
    mass: Expr
    mean: dict[int, Expr]
    bias: Expr
    force: Expr


@dataclass(frozen=True)
class Solution:
    """Definitions in order, the last of them v̇.

    They divide by `pivots`, and by `divisors`: pairs of a body's name and a moment of inertia.
    """

    definitions: dict[Expr, Expr]
    pivots: tuple[Expr, ...]
    divisors: tuple[tuple[str, Expr], ...]


@dataclass
class Elimination:
    """The state of an elimination: rows, forces on the velocities, and what is known so far."""

    tree: Tree
    forces: dict[int, Expr]
    rows: list[Row] = field(default_factory=list)
    sums: dict[Expr, Expr] = field(default_factory=dict)
    pivots: list[Expr] = field(default_factory=list)
    weights: list[Expr] = field(default_factory=list)
    divisors: list[tuple[str, Expr]] = field(default_factory=list)

    @property
    def ledger(self) -> Ledger:
        """The definitions so far."""
        return self.tree.ledger

    def short(self, expression: Expr) -> Expr:
        """The expression simplified, with constant pivots substituted where terms then cancel."""
        return self.ledger.short(expression, self.sums)

    def named(self, name: str, expression: Expr) -> Expr:
        """The short form; a new symbol for it if it is long."""
        return self.ledger.named(name, self.short(expression))

    def pivot(self, name: str, total: Expr) -> Expr:
        """The symbol of a pivot; the value of a constant pivot is kept for `short`."""
        fixed, longest = self.ledger.fixed, self.ledger.longest
        form = sum_of_squares(total, fixed, self.sums, longest)
        if form.is_Atom:
            symbol = form
        else:
            symbol = self.ledger.define(sp.Symbol(name, positive=True), form)
            if form.free_symbols <= {*self.ledger.fixed, *self.sums, *self.weights}:
                self.sums[symbol] = form.xreplace(self.sums)
        self.pivots.append(symbol)
        return symbol


def solve(tree: Tree, motions: Sequence[Motion], loads: Loads) -> Solution:
    """Solve for v̇ under the effects and further generalised forces `tau`."""
    work = Elimination(tree, _forces(tree, motions, loads))
    model, ledger, a = tree.model, tree.ledger, tree.symbols.a
    roots = model.roots
    translations = []
    for k, (body, motion) in enumerate(zip(tree.bodies, motions, strict=True)):
        floats = not model.bodies[roots[k]].joint.holds
        work.rows += _angular_rows(k, motion, work)
        if not floats:
            work.rows += _linear_rows(body, motion, work)
        elif roots[k] == k:
            members = [i for i, root in enumerate(roots) if root == k]
            translations.append(_eliminate_translation(members, motions, work))
    for j, inertia in tree.armatures.items():
        work.rows.append(Row(inertia, {j: sp.Integer(1)}, sp.Integer(0)))
    carried = {
        model.first_velocity[translation.root] + i
        for translation in translations
        for i in range(model.dimensions)
    }
    answers = {}
    for j in _inwards(model):
        if j not in carried:
            answers[j] = _eliminate(j, work)
    for j in reversed(answers):  # the last one eliminated is known first
        ledger.define(a[j], answers[j])
    for translation in translations:
        _define_translation(tree, translation, loads.uniform)
    return Solution(ledger.definitions, tuple(work.pivots), tuple(work.divisors))


def _inwards(model: Model) -> list[int]:
    """The velocities from the leaves to the root; of a joint the prismatic ones first, which are
    cheaper to eliminate.
    """
    order: list[int] = []
    for body, first in reversed([*zip(model.bodies, model.first_velocity, strict=True)]):
        units = [c.unit for c in body.velocities]
        own = reversed(range(len(units)))
        order += [first + i for i in sorted(own, key=lambda i: units[i] == "rad/s")]
    return order


def _forces(tree: Tree, motions: Sequence[Motion], loads: Loads) -> dict[int, Expr]:
    """The generalised forces: all except uniform gravity, minus gyroscopic torques ω x I ω."""
    forces = dict(enumerate(tree.symbols.tau))
    for j, force in loads.motors.items():
        forces[j] += force
    for load in (*loads.gravity, *loads.applied):
        for j, part in generalised(tree, motions, load).items():
            forces[j] += part
    for body, motion in zip(tree.bodies, motions, strict=True):
        torque = motion.omega.cross(body.inertia * motion.omega)
        for j, partial_omega in motion.partial_omegas.items():
            forces[j] -= tree.ledger.short(partial_omega.dot(torque))
    return forces


def _angular_rows(k: int, motion: Motion, work: Elimination) -> list[Row]:
    """Three squares of a body's rotation: I = Lᵀ D L, weights D, entries L times partial ω."""
    body, model = work.tree.model.bodies[k], work.tree.model
    name, values = body.name, [model.value(entry) for entry in body.inertia_com[:3]]
    # From the largest moment down: it is not 0 unless all are.
    order = sorted(range(3), key=lambda i: -values[i]) if len(values) == 3 else [2]
    left, rows = sp.Matrix(work.tree.bodies[k].inertia), []
    for i in order:
        others = [h for h in order[order.index(i) + 1 :] if left[i, h] != 0]
        weight = left[i, i]
        if weight == 0 and not others:
            continue
        if not is_sum_of_positive_terms(weight):  # by its form; an inertia's moments are positive
            symbol = sp.Symbol(f"weight__{name}__{'xyz'[i]}", positive=True)
            weight = work.ledger.define(symbol, weight)
            work.weights.append(weight)
        if others:
            work.divisors.append((name, weight))
        slopes = {h: left[i, h] / weight for h in others}
        mixed = {i: sp.Integer(1)} | {
            h: work.ledger.named(f"ratio__{name}__{'xyz'[i]}{'xyz'[h]}", slope)
            for h, slope in slopes.items()
        }
        for h in others:
            for g in others:
                left[h, g] -= mixed[h] * left[i, g]
        entries = {
            j: work.short(sum(part * partial_omega[h] for h, part in mixed.items()))
            for j, partial_omega in motion.partial_omegas.items()
        }
        bias = work.short(sum(part * motion.alpha[h] for h, part in mixed.items()))
        rows.append(Row(weight, {j: e for j, e in entries.items() if e != 0}, bias))
    return [row for row in rows if row.entries]


def _linear_rows(body: Frame, motion: Motion, work: Elimination) -> list[Row]:
    """Three squares of a body's centre of mass, in its axes."""
    if body.mass == 0:
        return []
    rows = []
    for i in range(3):
        entries = {
            j: partial_velocity[i]
            for j, partial_velocity in motion.partial_velocities.items()
            if partial_velocity[i] != 0
        }
        if entries:
            bias = work.short(motion.acceleration[i] - motion.gravity[i])
            rows.append(Row(body.mass, entries, bias))
    return rows


def _eliminate_translation(
    members: Sequence[int], motions: Sequence[Motion], work: Elimination
) -> Translation:
    """Eliminate a floating tree's translation, and add the rows of its bodies that are left."""
    tree, ledger, root = work.tree, work.tree.ledger, members[0]
    model, bodies, v = tree.model, tree.bodies, tree.symbols.v
    name = model.bodies[root].name
    first = model.first_velocity[root]
    carried = range(first, first + model.dimensions)
    total = sum((bodies[k].mass for k in members), sp.Integer(0))
    mass = work.pivot(f"mass__{name}", total)
    whole = {mass: total} if mass != total else {}
    work.sums |= whole
    columns = dict.fromkeys(
        j for k in members for j in motions[k].partial_velocities if j not in carried
    )
    none = sp.zeros(3, 1)

    def mean(word: str, vectors: dict[int, Expr]) -> Expr:
        joined = sp.zeros(3, 1)
        for k, vector in vectors.items():
            joined += bodies[k].mass / mass * (tree.rotation(k, root) * vector)
        return ledger.vector(word, name, joined.applyfunc(work.short))

    means = {
        j: mean(
            f"mean__{v[j].name}",
            {k: motions[k].partial_velocities.get(j, none) for k in members},
        )
        for j in columns
    }
    bias = mean("bias", {k: motions[k].acceleration for k in members})
    force = sp.Matrix([*(work.forces[j] for j in carried), *([0] * (3 - len(carried)))])
    pushed = tree.rotation(root).T * force
    for j, part in means.items():
        work.forces[j] -= part.dot(pushed)
    for k in (k for k in members if bodies[k].mass != 0):
        back = tree.rotation(k, root).T
        body = model.bodies[k].name
        apart = {
            j: ledger.vector(
                f"apart__{v[j].name}",
                body,
                (motions[k].partial_velocities.get(j, none) - back * means[j]).applyfunc(
                    work.short
                ),
            )
            for j in columns
        }
        rest = (motions[k].acceleration - back * bias).applyfunc(work.short)
        for i in range(3):
            entries = {j: vector[i] for j, vector in apart.items() if vector[i] != 0}
            if entries:
                work.rows.append(Row(bodies[k].mass, entries, rest[i]))
    return Translation(root, mass, {j: m for j, m in means.items() if any(m)}, bias, force)


def _define_translation(tree: Tree, translation: Translation, uniform: Expr) -> None:
    """The acceleration of a floating tree's root: the whole tree's, minus that from other v̇."""
    a = tree.symbols.a
    inside = -translation.bias
    for j, part in translation.mean.items():
        inside -= part * a[j]
    first = tree.model.first_velocity[translation.root]
    outside = (
        uniform + translation.force / translation.mass + tree.rotation(translation.root) * inside
    )
    for i in range(tree.model.dimensions):
        tree.ledger.define(a[first + i], outside[i])


def _eliminate(k: int, work: Elimination) -> Expr:
    """Eliminate v̇_k; return it as an expression in the v̇ that are left."""
    v, a = work.tree.symbols.v, work.tree.symbols.a
    name = v[k].name
    here = [row for row in work.rows if k in row.entries]
    pivot = work.pivot(f"pivot__{name}", sum(row.weight * row.entries[k] ** 2 for row in here))
    columns = sorted({j for row in here for j in row.entries if j != k})
    coupling = {}
    for j in columns:
        joint = sum(
            row.weight * row.entries[k] * row.entries[j] for row in here if j in row.entries
        )
        found = work.named(f"coupling__{name}__{v[j].name}", joint / pivot)
        if found != 0:
            coupling[j] = found
    held = work.short(sum(row.weight * row.entries[k] * row.bias for row in here))
    known = sum((c * a[j] for j, c in coupling.items()), sp.Integer(0))
    force = work.forces[k]
    if not coupling:  # no row is left that would need β
        for row in here:
            row.entries.pop(k)
        work.rows = [row for row in work.rows if row.entries]
        return _acceleration(name, force - held, pivot, work)
    force = work.forces[k] = work.named(f"load__{name}", force)
    bias = work.named(f"bias__{name}", held / pivot)
    for n, row in enumerate(here):
        own = row.entries.pop(k)
        for j, c in coupling.items():
            rest = work.short(row.entries.get(j, sp.Integer(0)) - own * c)
            row.entries[j] = work.ledger.named(f"row__{name}__{n}__{v[j].name}", rest)
        row.entries = {j: e for j, e in row.entries.items() if e != 0}
        if row.entries:
            row.bias = work.named(f"rest__{name}__{n}", row.bias - own * bias)
    work.rows = [row for row in work.rows if row.entries]
    for j, c in coupling.items():
        work.forces[j] -= c * force
    if bias in work.ledger.definitions:
        return force / pivot - bias - known
    return _acceleration(name, force - held, pivot, work) - known


def _acceleration(name: str, force: Expr, pivot: Expr, work: Elimination) -> Expr:
    """f / d for a force and a pivot; a long force gets a name."""
    force = nested(work.short(force))
    if pivot in work.sums:  # the pivot is constant, so that terms of f / d may simplify
        return sp.Add(*(work.short(term / pivot) for term in sp.Add.make_args(force)))
    return work.ledger.named(f"drive__{name}", force) / pivot
