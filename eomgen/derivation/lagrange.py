"""Lagrange's equations of a small tree: M, V and G from the energies.

    d/dt ∂T/∂v - ∂T/∂q + ∂U/∂q = Q

T = ½ vᵀ M v, so that V = Ṁ v - ∂T/∂q. Angular velocities of a ball are not derivatives of
coordinates: ∂/∂q is then the derivative along a rotation about an axis of the body, and V has
ω × ∂T/∂ω beside the rest (Hamel's form of the equations).
"""

from collections.abc import Iterator, Sequence

import sympy as sp

from eomgen.base.errors import SceneError
from eomgen.derivation.constraints import coordinate_rates
from eomgen.derivation.frames import frames_of
from eomgen.derivation.linkage import quaternion_rates, rate
from eomgen.derivation.matrices import Matrices, written_out
from eomgen.derivation.poses import poses
from eomgen.derivation.simplified import simplified, size
from eomgen.derivation.steps import Equation, Step
from eomgen.derivation.symbols import Expr, real
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
HAMEL = (
    " The components of a ball's ω are not derivatives of coordinates: ∂/∂q is the derivative "
    "along a rotation about an axis of the body, and V has ω × ∂T/∂ω beside the rest."
)


def lagrangian(model: Model, tree: Matrices, gravity: Expr) -> tuple[Matrices, list[Step]]:
    """The equations with V and G from the energies, and their steps; `gravity` is the acceleration
    of all bodies, with three components in world axes.

    Raises `SceneError` for a mechanism whose equations would be too long.
    """
    if sum(map(size, tree.M)) > MOST:
        raise SceneError(
            f"method: Lagrange's equations of {model.name} written out would be too long to read; "
            "use kane or newton-euler"
        )
    v = sp.Matrix(tree.v)
    kinetic = (v.T * tree.M * v)[0] / 2
    potential = _potential(model, tree, gravity)
    momenta = tree.M * v
    rates = dict(coordinate_rates(model))
    V = rate(tree.M, rates) * v - _slopes(model, kinetic)
    for spin in _spins(model):
        turning = sp.Matrix([tree.v[j] for j in spin])
        across = turning.cross(sp.Matrix([momenta[j] for j in spin]))
        for j, part in zip(spin, across, strict=True):
            V[j] += part
    G = _slopes(model, potential) if any(gravity) else tree.G
    found = Matrices(
        *(tree.q, tree.v, tree.a, tree.M, simplified(V), simplified(G), tree.F),
        *(tree.definitions, tree.formulas),
    )
    words = EQUATIONS + (HAMEL if any(_spins(model)) else "")
    energies = [Equation(sp.Symbol(x), e) for x, e in _energies(kinetic, potential)]
    steps = [Step("balance", "Energies", ENERGIES, tuple(energies))] if energies else []
    steps.append(Step("equations", "Lagrange's equations", words, (_line("M", found.M),)))
    for letter, title in (("V", "Velocity"), ("G", "Gravity"), ("F", "Applied")):
        lines = (_line(letter, getattr(found, letter)),)
        steps.append(Step("equations", f"{title} forces", "", lines))
    return found, steps


def _line(letter: str, e: Expr) -> Equation:
    return Equation(sp.Symbol(letter), e)


def _energies(kinetic: Expr, potential: Expr) -> Iterator[tuple[str, Expr]]:
    for letter, e in (("T", kinetic), ("U", potential)):
        if size(short := simplified(e)) <= SHORT:
            yield letter, short


def _potential(model: Model, tree: Matrices, gravity: Expr) -> Expr:
    """-Σ m g·x over coordinates."""
    known = {s.name: s for m in (tree.M, tree.G, gravity) for s in m.free_symbols}
    bodies = [frame for frame in frames_of(model) if frame.body >= 0]
    names = [model.bodies[frame.body].name for frame in bodies]
    definitions, _ = poses(model, frames_of(model), names)
    total = sp.S.Zero
    for frame, name in zip(bodies, names, strict=True):
        place = [real(f"{axis}_{name}") for axis in "xyz"[: model.dimensions]]
        total -= frame.mass * sum(g * x for g, x in zip(gravity, place, strict=False))
    whole = written_out(total, definitions)
    return whole.xreplace({s: known.get(s.name, s) for s in whole.free_symbols})


def _spins(model: Model) -> list[Sequence[int]]:
    """Indices of the angular velocities of each ball."""
    return [index.spin for index in model.joint_indices if index.quaternion]


def _slopes(model: Model, e: Expr) -> Expr:
    """The derivative of an expression along each velocity."""
    found = sp.zeros(len(model.velocities), 1)
    for index in model.joint_indices:
        body = index.body
        for c, j in zip(body.positions[: body.plain], index.v, strict=False):
            found[j] = sp.diff(e, real(c.name))
        if not index.quaternion:
            continue
        q = [real(c.name) for c in body.positions[body.plain :]]
        slopes = [sp.diff(e, x) for x in q]
        for k, j in enumerate(index.spin):
            unit = [int(i == k) for i in range(3)]
            moved = quaternion_rates(q, unit)
            found[j] = sum(a * b for a, b in zip(slopes, moved, strict=True))
    return found
