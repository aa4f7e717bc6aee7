"""The impulses of rigid contacts: what an impact does to the velocities."""

from collections.abc import Iterator, Sequence

import sympy as sp

from eomgen.derivation.effects import DerivedEffect
from eomgen.derivation.mechanism import (
    crossed,
    omega_symbols,
    rotation_symbols,
    turned,
    velocity_symbols,
)
from eomgen.derivation.steps import Equation, Step
from eomgen.derivation.symbols import Expr, real
from eomgen.model.model import Model
from eomgen.scene.effects.base import Contact, JointLoad, Load

LAW = (
    "A rigid contact exerts no force while its gap g is positive. Where g becomes 0 with u_n < 0 "
    "an instantaneous impact takes place: the coordinates stay, and an impulse P along the normal "
    "and the tangents changes the velocities. J holds the rows that give the speeds u of the "
    "contact from the velocities, and Jᵀ P are generalised impulses. A is the inverse mass that "
    "the contact point has in these directions. The law is that of A. Chatterjee and A. Ruina, A "
    "new algebraic rigid-body collision law based on impulse space considerations, J. Appl. Mech. "
    "65 (1998) 939-951: P_I ends the approach without friction, P_II ends the slip as well, e is "
    "the coefficient of restitution and μ that of friction. κ is 1, or so much less that the "
    "tangential part of P stays within μ times its normal part."
)


def impact_steps(model: Model, effects: Sequence[DerivedEffect]) -> Iterator[Step]:
    """The impulse equations, and the gap and the speeds of each contact."""
    contacts = [contact for effect in effects for contact in effect.contacts]
    if not contacts:
        return
    n, size = len(model.velocities), 1 + max(len(c.tangents) for c in contacts)
    mass, rows = sp.MatrixSymbol("M", n, n), sp.MatrixSymbol("J", size, n)
    u, v = sp.MatrixSymbol("u", size, 1), sp.MatrixSymbol("v", n, 1)
    inverse, impulse = sp.MatrixSymbol("A", size, size), sp.MatrixSymbol("P", size, 1)
    first, second = sp.MatrixSymbol("P_I", size, 1), sp.MatrixSymbol("P_II", size, 1)
    normal = sp.MatrixSymbol("n", size, 1)
    e, kappa = real("e"), real("kappa")
    equations = (
        Equation(u, sp.MatMul(rows, v)),
        Equation(inverse, sp.MatMul(rows, sp.Inverse(mass), rows.T)),
        Equation(first, sp.MatMul(-real("u_n") / real("A_nn"), normal)),
        Equation(second, sp.MatMul(-1, sp.Inverse(inverse), u)),
        Equation(
            impulse,
            sp.MatAdd(
                sp.MatMul(1 + e, first),
                sp.MatMul(kappa, sp.MatAdd(second, sp.MatMul(-1, first))),
            ),
        ),
        Equation(
            sp.MatrixSymbol("v^+", n, 1),
            sp.MatAdd(v, sp.MatMul(sp.Inverse(mass), rows.T, impulse)),
        ),
    )
    yield Step("impact", "Impacts: the impulse equations", LAW, equations)
    for contact in contacts:
        yield _contact_step(model, contact)


def _contact_step(model: Model, contact: Contact) -> Step:
    name = contact.name
    lines = [Equation(real(f"g_{name}"), contact.gap)]
    lines.append(Equation(real(f"u_{name},n"), power(model, contact.normal)))
    for i, tangent in enumerate(contact.tangents):
        letter = "t" if len(contact.tangents) == 1 else f"t{i + 1}"
        lines.append(Equation(real(f"u_{name},{letter}"), power(model, tangent)))
    lines.append(Equation(real(f"e_{name}"), contact.restitution))
    if contact.tangents and contact.friction != 0:
        lines.append(Equation(real(f"mu_{name}"), contact.friction))
    words = (
        f"Contact `{name}`: its gap, the speed at which it opens and the slip speeds, which are "
        f"the "
        "rows of J; by virtual work Jᵀ holds the generalised forces of unit impulses."
    )
    kept = tuple(line for line in lines if line.left != line.right)
    return Step("impact", f"Contact `{name}`", words, kept)


def power(model: Model, loads: Sequence[Load | JointLoad]) -> Expr:
    """The power of unit loads: a speed."""
    total: Expr = sp.Integer(0)
    size = model.dimensions
    for load in loads:
        if isinstance(load, JointLoad):
            body = next(b for b in model.bodies if b.joint.name == load.joint)
            total += load.force * real(body.velocities[load.coordinate].name)
            continue
        speed, omega = velocity_symbols(load.body, size), omega_symbols(load.body, size)
        arm = turned(rotation_symbols(load.body, size), load.at)
        moving = [a + b for a, b in zip(speed, crossed(omega, arm), strict=True)]
        total += sum(f * v for f, v in zip(load.force, moving, strict=True))
        total += sum(t * w for t, w in zip(load.torque, omega, strict=False))
    return total
