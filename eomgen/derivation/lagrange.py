"""Lagrange's equations of a small tree: M, V and G from the energies.

    d/dt ∂T/∂v - ∂T/∂q + ∂U/∂q = Q

T = ½ vᵀ M v, so that V = Ṁ v - ∂T/∂q. Angular velocities of a ball are not derivatives of
coordinates: ∂/∂q is then the derivative along a rotation about an axis of the body, and V has
ω × ∂T/∂ω beside the rest (Hamel's form of the equations).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import sympy as sp

from eomgen.derivation.definitions import written_out
from eomgen.derivation.identity import identical
from eomgen.derivation.linkage import Frame, Linkage, linkage_of
from eomgen.derivation.matrices import Matrices
from eomgen.derivation.poses import poses
from eomgen.derivation.reading import short_name
from eomgen.derivation.rotations import rate
from eomgen.derivation.simplified import simplified, size
from eomgen.derivation.steps import Equation, Step
from eomgen.derivation.symbols import Expr, real
from eomgen.derivation.terms import terms_steps
from eomgen.model.model import Model

MOST = 1500
"""The size of a mass matrix up to which Lagrange's equations are written out."""
SHORT = 120
"""The size of an energy up to which it is written out."""
ENERGIES = (
    "T is the kinetic energy, the sum of ½ m |u|² + ½ ω·I ω over the bodies, with the velocities "
    "of the joints put in; U is the potential energy of gravity."
)
EQUATIONS = (
    "d/dt ∂T/∂v - ∂T/∂q + ∂U/∂q = Q for each velocity; Q is the power of all other loads at unit "
    "velocity. T is quadratic in v: M is the matrix of its second derivatives, V is what is left "
    "of the first two terms where dv/dt = 0, G is ∂U/∂q, and F is Q."
)
DERIVATIVES = "p_q is the momentum ∂T/∂v that belongs to a coordinate q, and T_q is ∂T/∂q."
HAMEL = (
    " The components of a ball's ω are not derivatives of coordinates: ∂/∂q is the derivative "
    "along a rotation about an axis of the body, and V has ω × ∂T/∂ω beside the rest."
)


def lagrange_written(
    model: Model, tree: Matrices, gravity: Expr, rates: Mapping[Expr, Expr]
) -> list[Step] | None:
    """The steps to the equations of a tree with V and G from the energies; `gravity` is the
    acceleration of all bodies, with three components in world axes, and `rates` has the time
    derivatives of what is in M. None if the equations would be too long to read.

    V and G are written as those of the tree, to which they are identical. Raises `ArithmeticError`
    if they are not.
    """
    if sum(map(size, tree.M)) > MOST:
        return None
    v = sp.Matrix(tree.v)
    rates = {symbol: rate for symbol, rate in rates.items() if symbol not in tree.v}
    kinetic = (v.T * tree.M * v)[0] / 2
    height = potential(model, tree, gravity) if any(gravity) else sp.S.Zero
    momenta = tree.M * v
    along = _slopes(tree, kinetic, rates)
    V = rate(tree.M, rates) * v - along
    for spin in _spins(model):
        turning = sp.Matrix([tree.v[j] for j in spin])
        across = turning.cross(sp.Matrix([momenta[j] for j in spin]))
        for j, part in zip(spin, across, strict=True):
            V[j] += part
    G = _slopes(tree, height, rates) if any(gravity) else tree.G
    pairs = [*zip(V, tree.V, strict=True), *zip(G, tree.G, strict=True)]
    if not identical(pairs, tree.definitions):
        raise ArithmeticError(f"Lagrange's equations of {model.name} are not those of the tree")
    energies = [Equation(sp.Symbol(x), e) for x, e in _energies(kinetic, height)]
    steps = [Step("balance", "Energies", ENERGIES, tuple(energies))] if energies else []
    steps += _derivatives(model, momenta, along)
    words = EQUATIONS + (HAMEL if any(_spins(model)) else "")
    steps += terms_steps("Lagrange's equations", words, tree)
    return steps


def _derivatives(model: Model, momenta: Expr, along: Expr) -> Iterator[Step]:
    """∂T/∂v and ∂T/∂q, where they are short."""
    lines = []
    for letter, vector in (("p", momenta), ("T", along)):
        for c, e in zip(model.velocities, vector, strict=True):
            short, word = simplified(e), short_name(c.name)
            if short != 0 and size(short) <= SHORT and f"{letter}_{word}" not in model.defaults:
                lines.append(Equation(real(f"{letter}_{word}"), short))
    if lines:
        yield Step("balance", "The derivatives of the kinetic energy", DERIVATIVES, tuple(lines))


def _energies(kinetic: Expr, potential: Expr) -> Iterator[tuple[str, Expr]]:
    for letter, e in (("T", kinetic), ("U", potential)):
        if size(short := simplified(e)) <= SHORT:
            yield letter, short


def potential(model: Model, tree: Matrices, gravity: Expr) -> Expr:
    """U = -Σ m g·x over coordinates, and the entries of a ball's rotation."""
    known = {s.name: s for m in (tree.M, tree.G, gravity) for s in m.free_symbols}
    frames = (_with_entries(model, frame) for frame in linkage_of(model).frames)
    linkage, total = Linkage(model, tuple(frames)), sp.S.Zero
    definitions, _ = poses(linkage, [body.name for body in model.bodies])
    for frame in linkage.bodies:
        name = linkage.name(frame)
        place = [real(f"{axis}_{name}") for axis in "xyz"[: model.dimensions]]
        total -= frame.mass * sum(g * x for g, x in zip(gravity, place, strict=False))
    whole = written_out(total, definitions)
    return whole.xreplace({s: known.get(s.name, s) for s in whole.free_symbols})


def _spins(model: Model) -> list[Sequence[int]]:
    """Indices of the angular velocities of each ball."""
    return [index.spin for index in model.joint_indices if index.quaternion]


def _with_entries(model: Model, frame: Frame) -> Frame:
    """A frame with symbols for the entries of a ball's rotation."""
    if frame.kind != "spherical":
        return frame
    name = model.bodies[frame.body].name
    entries = sp.Matrix(3, 3, lambda i, j: real(f"R__{name}__{'xyz'[i]}{'xyz'[j]}"))
    return replace(frame, turned=entries)


def _slopes(tree: Matrices, e: Expr, rates: Mapping[Expr, Expr]) -> Expr:
    """The derivative of an expression along each velocity: of e' by it."""
    found = []
    for v in tree.v:
        unit = {x: sp.Integer(int(x == v)) for x in tree.v}
        found.append(rate(e, {symbol: x.xreplace(unit) for symbol, x in rates.items()}))
    return sp.Matrix(found)
