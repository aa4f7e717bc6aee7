"""What constraints leave free: positions, velocities and accelerations by the freedoms.

    q = γ(independent coordinates),    v = K u,    v̇ = K u̇ + κ

with u the independent velocities. Positions are those of `dynamics.loops.dependent_coordinates`,
the same closed forms as in programs, run over symbols; velocities and accelerations follow from g
differentiated twice, one polygon after another. What is left has one equation for each freedom:

    M̂ u̇ + V̂ + Ĝ = F̂,    M̂ = KᵀM K,    V̂ = Kᵀ(V + M κ),    Ĝ = KᵀG,    F̂ = KᵀF
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import sympy as sp

from eomgen.derivation.constraints import DerivedConstraint, DerivedRow
from eomgen.derivation.linkage import linkage_of
from eomgen.derivation.poses import poses
from eomgen.derivation.simplified import simplified, size
from eomgen.derivation.steps import Definition
from eomgen.derivation.symbolic_scalars import SymbolicScalars
from eomgen.derivation.symbols import Expr, of_scene, real
from eomgen.derivation.terms import Terms
from eomgen.dynamics.loops.dependent_coordinates import Turn, angle_of, solved
from eomgen.dynamics.tree.mechanism_state import MechanismState
from eomgen.model.groups import Group
from eomgen.model.model import Model
from eomgen.model.named import Values

SHORT = 8
"""The size of a ratio or a coordinate up to which it has no name of its own."""


@dataclass(frozen=True)
class Polygon:
    """One group: what it determines.

    lengths     symbols in its coordinates, each over those before it
    positions   its coordinates
    ratios      symbols for entries of K, with the determinant before them
    velocities  its velocities over the independent ones
    drifts      symbols for entries of κ
    rates       its accelerations
    """

    constraint: str
    rows: tuple[DerivedRow, ...]
    lengths: tuple[Definition, ...]
    positions: tuple[Definition, ...]
    ratios: tuple[Definition, ...]
    velocities: tuple[Definition, ...]
    drifts: tuple[Definition, ...]
    rates: tuple[Definition, ...]

    @property
    def definitions(self) -> tuple[Definition, ...]:
        """All of it in order, but for accelerations."""
        return (*self.lengths, *self.positions, *self.ratios, *self.velocities, *self.drifts)


@dataclass(frozen=True)
class Embedding:
    """The motion of a model with `groups` by its freedoms.

    independent  indices of the independent velocities
    polygons     in the order in which they are solved
    K, kappa     (n, k) and (n, 1), over symbols of the polygons
    """

    model: Model
    independent: tuple[int, ...]
    polygons: tuple[Polygon, ...]
    K: Expr
    kappa: Expr

    @property
    def definitions(self) -> tuple[Definition, ...]:
        """Dependent coordinates and velocities, K and κ, in order."""
        return tuple(pair for polygon in self.polygons for pair in polygon.definitions)

    @property
    def same(self) -> dict[Expr, Expr]:
        """Dependent coordinates and velocities that are others, or their negatives."""
        pairs = (x for p in self.polygons for x in (*p.positions, *p.velocities))
        return {symbol: e for symbol, e in pairs if e.is_Symbol or (-e).is_Symbol}

    @property
    def rates(self) -> tuple[Definition, ...]:
        """The dependent accelerations over the independent ones."""
        return tuple(pair for polygon in self.polygons for pair in polygon.rates)


def embedded(model: Model, constraints: Sequence[DerivedConstraint]) -> Embedding:
    """The motion of a model by its freedoms; its `groups` determine all other coordinates."""
    n, names = len(model.velocities), [c.name for c in model.velocities]
    index = {name: j for j, name in enumerate(names)}
    independent = model.state_velocities
    K, kappa = sp.zeros(n, len(independent)), sp.zeros(n, 1)
    for place, j in enumerate(independent):
        K[j, place] = 1
    of = {c.constraint.name: c for c in constraints}
    column = {i: j for each in model.joint_indices for i, j in each.plain}
    over_q = _over_coordinates(model, constraints)
    polygons = []
    for group in model.groups:
        rows = tuple(_written_out(row, over_q) for row in of[group.constraint].rows)
        own = [column[i] for i in group.coordinates]
        block = sp.zeros(len(rows), len(own))
        right, bend = sp.zeros(len(rows), len(independent)), sp.zeros(len(rows), 1)
        for i, row in enumerate(rows):
            bend[i] += row.bend
            for name, slope in row.slopes:
                j = index[name]
                if j in own:
                    block[i, own.index(j)] += slope
                    continue
                bend[i] += slope * kappa[j]
                for place in range(len(independent)):
                    right[i, place] += slope * K[j, place]
        polygon = _polygon(model, group, rows, own, block, (right, bend), (K, kappa))
        polygons.append(polygon)
    return Embedding(model, independent, tuple(polygons), K, kappa)


def _over_coordinates(
    model: Model, constraints: Sequence[DerivedConstraint]
) -> tuple[Definition, ...]:
    """Poses and points of the constraints by coordinates, in order."""
    needed = dict.fromkeys(body for c in constraints for body in c.bodies)
    found, _ = poses(linkage_of(model), needed)
    return (*found, *(pair for c in constraints for pair in (*c.definitions, *c.speeds)))


def _written_out(row: DerivedRow, definitions: Sequence[Definition]) -> DerivedRow:
    """A row over coordinates and velocities."""

    def out(e: Expr) -> Expr:
        for symbol, value in reversed(definitions):
            e = e.xreplace({symbol: value})
        return simplified(e)

    return replace(
        row,
        position=None if row.position is None else out(row.position),
        speed=out(row.speed),
        slopes=tuple((name, slope) for name, e in row.slopes if (slope := out(e)) != 0),
        bend=out(row.bend),
    )


def _polygon(
    model: Model,
    group: Group,
    rows: tuple[DerivedRow, ...],
    own: Sequence[int],
    block: Expr,
    given: tuple[Expr, Expr],
    whole: tuple[Expr, Expr],
) -> Polygon:
    """A group's coordinates, velocities and accelerations; its rows of K and κ are filled in."""
    right, bend = given
    K, kappa = whole
    lengths, positions = _positions(model, group)
    independent = [model.velocities[j] for j in model.state_velocities]
    ratios: list[Definition] = []
    drifts: list[Definition] = []

    def named(found: list[Definition], name: str, value: Expr) -> Expr:
        if size(value) <= SHORT:
            return value
        found.append((real(name), value))
        return real(name)

    inverse = _inverse(block)
    u = sp.Matrix([real(c.name) for c in independent])
    rate = sp.Matrix([real(c.acceleration) for c in independent])
    velocities, rates = [], []
    for place, j in enumerate(own):
        c = model.velocities[j]
        word = c.name.removesuffix("_dot")
        for n, freedom in enumerate(independent):
            value = simplified(-inverse[place, :].dot(right[:, n]))
            other = f",{freedom.name.removesuffix('_dot')}" if len(independent) > 1 else ""
            K[j, n] = named(ratios, f"K_{word}{other}", value)
        kappa[j] = named(drifts, f"kappa_{word}", simplified(-inverse[place, :].dot(bend)))
        velocities.append((real(c.name), K[j, :].dot(u)))
        rates.append((real(c.acceleration), K[j, :].dot(rate) + kappa[j]))
    return Polygon(
        group.constraint,
        rows,
        tuple(lengths),
        tuple(positions),
        tuple(ratios),
        tuple(velocities),
        tuple(drifts),
        tuple(rates),
    )


def _inverse(block: Expr) -> Expr:
    """The inverse of a matrix with one or two rows."""
    if block.rows == 1:
        return sp.Matrix([[1 / block[0, 0]]])
    (a, b), (c, d) = block.tolist()
    whole = simplified(a * d - b * c)
    return sp.Matrix([[d, -b], [-c, a]]) / whole


@dataclass
class _Naming(SymbolicScalars):
    """Symbols as scalars; a root gets a name: the other side of a triangle."""

    suffix: str
    found: list[Definition] = field(default_factory=list)

    def call(self, function: str, *arguments: Expr) -> Expr:
        """A function of formulas."""
        if function != "sqrt":
            return super().call(function, *arguments)
        number = f",{len(self.found) + 1}" if self.found else ""
        self.found.append((real(f"w_{self.suffix}{number}"), super().call(function, *arguments)))
        return self.found[-1][0]


def _positions(model: Model, group: Group) -> tuple[list[Definition], list[Definition]]:
    """The coordinates of a group in closed form, and the symbols that they use."""
    scalars = _Naming(group.constraint)

    def symbols(items: Sequence[Any]) -> dict[str, Expr]:
        return {x.name: of_scene(x.name) for x in items}

    q, v = ([real(c.name) for c in x] for x in (model.coordinates, model.velocities))
    values = Values(symbols(model.parameters), symbols(model.inputs), q, v, {}, real("t"))
    d = MechanismState(model, values, scalars)
    found = [simplified(x) if not isinstance(x, Turn) else x for x in solved(d, group)]
    values_of: list[Expr] = []
    for value in found:
        values_of += map(simplified, value.direction) if isinstance(value, Turn) else [value]
    roots = [(symbol, simplified(e)) for symbol, e in scalars.found]
    lengths, values_of = _shortened(group.constraint, roots, values_of)
    positions: list[Definition] = []
    left = iter(values_of)
    for i, value, cut in zip(group.coordinates, found, group.cuts, strict=True):
        name = model.coordinates[i].name
        if not isinstance(value, Turn):
            positions.append((real(name), next(left)))
            continue
        assert cut is not None
        pair = next(left), next(left)
        if max(map(size, pair)) > SHORT:
            both = real(f"e_{name},x"), real(f"e_{name},y")
            lengths += zip(both, pair, strict=True)
            pair = both
        positions.append((real(name), angle_of(d, replace(value, direction=pair), cut)))
    return lengths, positions


def _shortened(
    name: str, roots: Sequence[Definition], values: Sequence[Expr]
) -> tuple[list[Definition], list[Expr]]:
    """Roots and values with names for the sums that occur in them again, and for denominators."""
    sums: dict[Expr, Expr] = {}
    found: list[Definition] = []
    whole = [*(e for _, e in roots), *values]
    counts: dict[Expr, int] = {}
    for e in whole:
        for x in sp.preorder_traversal(e):
            if x.is_Add and size(x) > SHORT:
                counts[x] = counts.get(x, 0) + 1
            if isinstance(x, sp.Pow) and x.exp.is_negative and x.base.is_Add:
                counts[x.base] = counts.get(x.base, 0) + 2
    often = sorted((x for x in counts if counts[x] > 1), key=lambda x: (size(x), str(x)))
    for n, x in enumerate(often, 1):
        symbol = real(f"k_{name}" + (f",{n}" if len(often) > 1 else ""))
        found.append((symbol, simplified(x.xreplace(sums))))
        sums[x.xreplace(sums)] = symbol
    order = sorted(sums.items(), key=lambda pair: -size(pair[0]))

    def short(e: Expr) -> Expr:
        for value, symbol in order:
            e = e.xreplace({value: symbol})
        return e

    rooted = [(symbol, short(e)) for symbol, e in roots]
    return [*found, *rooted], [short(e) for e in values]


def projected(K: Expr, kappa: Expr, tree: Terms) -> Terms:
    """M̂, V̂, Ĝ, F̂ from those of the tree."""
    turned = K.T
    M, V = turned * tree.M * K, turned * (tree.V + tree.M * kappa)
    return Terms(M, V, turned * tree.G, turned * tree.F).each(simplified)


def solved_for(names: Sequence[str], terms: Terms) -> Iterator[Definition]:
    """u̇ by elimination from the last freedom to the first: pivots, then accelerations in order."""
    M, right = sp.Matrix(terms.M), sp.Matrix(terms.right)
    k = M.rows
    if k == 1:
        yield real(names[0]), simplified(right[0] / M[0, 0])
        return
    words = [name.removesuffix("_ddot").removesuffix("_dot") for name in names]
    for j in range(k - 1, 0, -1):
        pivot, own = real(f"d_{words[j]}"), real(f"b_{words[j]}")
        yield pivot, simplified(M[j, j])
        yield own, simplified(right[j])
        for i in range(j):
            right[i] = right[i] - M[i, j] * own / pivot
            for h in range(i + 1):
                M[i, h] = M[h, i] = M[i, h] - M[i, j] * M[h, j] / pivot
        M[j, j], right[j] = pivot, own
    yield real(f"d_{words[0]}"), M[0, 0]
    yield real(f"b_{words[0]}"), right[0]
    for j in range(k):
        known = sum((M[i, j] * real(names[i]) for i in range(j)), sp.S.Zero)
        yield real(names[j]), (real(f"b_{words[j]}") - known) / real(f"d_{words[j]}")
