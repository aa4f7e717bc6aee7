"""One body that turns freely, in Euler angles: energies, constants of motion, steady precession.

z-x-z angles as in Goldstein, "Classical Mechanics", sections 4.9 and 5.7:

    Q = R_z(φ) R_x(θ) R_z(ψ),    ω = B (φ̇, θ̇, ψ̇) in axes of the body
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import sympy as sp

from eomgen.derivation.dots import dotted
from eomgen.derivation.identity import identical
from eomgen.derivation.lagrange import potential
from eomgen.derivation.matrices import Matrices
from eomgen.derivation.rotations import about, rate
from eomgen.derivation.simplified import simplified
from eomgen.derivation.steps import Equation, Step
from eomgen.derivation.symbols import Expr, real
from eomgen.model.model import Model

ANGLES = ("phi", "theta", "psi")
MOMENTA = tuple(sp.Symbol(f"p_{x}") for x in ANGLES)
TITLE = "In Euler angles"
KINEMATICS = (
    "The same motion in three angles in place of the quaternion: by φ about z, by θ about the new "
    "x, by ψ about the new z, the axis of the body. φ is the precession, θ the tilt, ψ the spin. "
    "The quaternion and ω follow from the angles. The other way round φ' and ψ' have sin θ as a "
    "denominator: where the body's z is that of the world or opposite to it, θ = 0 or π, only "
    "φ + ψ or φ - ψ is determined, and the angles are singular. The quaternion is not, so that "
    "the module has it."
)
ENERGIES = (
    "T and U in the angles, and the momenta p of the angles. They change by ∂T/∂q - ∂U/∂q{loads}."
)
LOADS = ", beside the power of the other loads at unit rate of the angle"
GYROSCOPIC = (
    " p_psi φ' sin θ is the gyroscopic torque: what the spin makes of the precession. It is what "
    "keeps a top from falling."
)
CONSTANT = (
    "T and U do not contain {angles}, and no other load acts, so that {momenta} constant: the "
    "moment of momentum about {axes}. So is the energy E."
)
EFFECTIVE = (
    "With both momenta constant θ moves by itself in the effective potential U_e: the energy is "
    "E = ½ p_theta θ' + U_e. It goes up to infinity at θ = 0 and π unless p_phi = ±p_psi, so "
    "that θ stays between two angles: the top nutates. Where U_e has its minimum θ stays, and "
    "the top precesses steadily at a rate φ' for which dU_e/dθ = 0; the slow rate is near the "
    "quotient of the weight's moment and the spin."
)


@dataclass(frozen=True)
class EulerForm:
    """The rotation of a body in Euler angles.

    kinetic, potential  T of the rotation, and U, over angles and their rates
    momenta, forces     ∂T/∂rate, and ∂T/∂angle - ∂U/∂angle, (3, 1)
    loads               generalised forces of all else, (3, 1)
    B, Q                ω over the rates, and the rotation, both (3, 3)
    axial               inertia across and along the axis, if the body has one
    """

    kinetic: Expr
    potential: Expr
    momenta: Expr
    forces: Expr
    loads: Expr
    B: Expr
    Q: Expr
    axial: tuple[Expr, Expr] | None


def euler_form(model: Model, tree: Matrices, gravity: Expr) -> EulerForm | None:
    """The rotation of a model's only body in Euler angles; None without such a body.

    Raises `ArithmeticError` if its equations are not those of the tree.
    """
    spin = [list(index.spin) for index in model.joint_indices if index.quaternion]
    if len(model.bodies) != 1 or not spin or model.constraints or model.prescribed:
        return None
    taken = {*model.defaults, *(c.name for c in model.coordinates)}
    taken |= {i.name for i in model.inputs}
    (own,) = spin
    rest = [j for j in range(len(tree.v)) if j not in own]
    if not taken.isdisjoint(ANGLES) or any(tree.M.extract(own, rest) if rest else ()):
        return None
    phi, theta, psi = q = [real(x) for x in ANGLES]
    v = sp.Matrix([real(f"{x}_dot") for x in ANGLES])
    a = sp.Matrix([real(f"{x}_ddot") for x in ANGLES])
    z, x = sp.Matrix([0, 0, 1]), sp.Matrix([1, 0, 0])
    Q = about(z, phi) * about(x, theta) * about(z, psi)
    sin, cos = sp.sin, sp.cos
    B = sp.Matrix(
        [
            [sin(theta) * sin(psi), cos(psi), 0],
            [sin(theta) * cos(psi), -sin(psi), 0],
            [cos(theta), 0, 1],
        ]
    )
    M, omega = tree.M.extract(own, own), B * v
    turned = _turned(model, Q) | dict(zip([tree.v[j] for j in own], omega, strict=True))
    axial = (M[0, 0], M[2, 2]) if M.is_diagonal() and M[0, 0] == M[1, 1] else None
    if axial:
        across, along = axial
        kinetic = across * (v[1] ** 2 + v[0] ** 2 * sin(theta) ** 2) / 2
        kinetic += along * (v[2] + v[0] * cos(theta)) ** 2 / 2
    else:
        kinetic = (omega.T * M * omega)[0] / 2
    U = simplified(potential(model, tree, gravity).xreplace(turned)) if any(gravity) else sp.S.Zero
    momenta = sp.Matrix([sp.diff(kinetic, x) for x in v])
    forces = sp.Matrix([sp.diff(kinetic - U, x) for x in q])
    loads = (B.T * tree.F.extract(own, [0]).xreplace(turned)).applyfunc(simplified)
    rates: Mapping[Expr, Expr] = dict(zip((*q, *v), (*v, *a), strict=True))
    bias = (tree.V + tree.G).extract(own, [0]).xreplace(turned)
    other = B.T * (M * (B * a + rate(B, rates) * v) + bias)
    if not identical(zip(rate(momenta, rates) - forces, other, strict=True)):
        raise ArithmeticError(f"the equations of {model.name} in Euler angles are not its own")
    return EulerForm(kinetic, U, momenta, forces, loads, B, Q, axial)


def _turned(model: Model, Q: Expr) -> dict[Expr, Expr]:
    """The entries of the joint's rotation by the angles."""
    name = model.bodies[0].name
    both = [(i, j) for i in range(3) for j in range(3)]
    return {real(f"R__{name}__{'xyz'[i]}{'xyz'[j]}"): Q[i, j] for i, j in both}


def euler_steps(model: Model, tree: Matrices, gravity: Expr) -> Iterator[Step]:
    """The motion of a model's only body in Euler angles, if it turns freely."""
    form = euler_form(model, tree, gravity)
    if form is None:
        return
    yield Step("equations", TITLE, KINEMATICS, tuple(_kinematics(model, form)))
    read = {real(f"{x}_dot"): _dot(x) for x in ANGLES}
    loads = form.loads.applyfunc(lambda e: e.xreplace(read))
    momenta, forces = form.momenta.xreplace(read), form.forces.xreplace(read)
    lines = [Equation(sp.Symbol("T"), form.kinetic.xreplace(read))]
    if form.axial:
        across, brief = form.axial[0], _across(model, form)
        short = {across: brief} if brief != across else {}
        lines = [Equation(x, e) for e, x in short.items()] + lines
        momenta, forces = _axial(form, brief)
        lines[-1] = Equation(lines[-1].left, lines[-1].right.xreplace(short))
    else:
        momenta, forces = momenta.applyfunc(simplified), forces.applyfunc(simplified)
    lines += [Equation(sp.Symbol("U"), form.potential)] if form.potential != 0 else []
    for i in (2, 0, 1):
        lines.append(Equation(MOMENTA[i], momenta[i]))
    for i in (2, 0, 1):
        lines.append(Equation(sp.Symbol(dotted(MOMENTA[i].name)), forces[i] + loads[i]))
    words = ENERGIES.format(loads=LOADS if any(loads) else "") + GYROSCOPIC * bool(form.axial)
    yield Step("equations", f"{TITLE}: energies and momenta", words, tuple(lines))
    yield from _constants(model, form)


def _across(model: Model, form: EulerForm) -> Expr:
    """The inertia across the axis, with a name if it is a sum."""
    assert form.axial is not None
    return real("A") if form.axial[0].is_Add and "A" not in model.defaults else form.axial[0]


def _axial(form: EulerForm, across: Expr) -> tuple[Expr, Expr]:
    """Momenta and forces of a body with an axis, over the momentum along it."""
    assert form.axial is not None
    theta, p_psi, (phi_dot, theta_dot, psi_dot) = real("theta"), MOMENTA[2], map(_dot, ANGLES)
    sin, cos = sp.sin(theta), sp.cos(theta)
    along = form.axial[1] * (psi_dot + phi_dot * cos)
    momenta = [across * phi_dot * sin**2 + p_psi * cos, across * theta_dot, along]
    tilt = across * phi_dot**2 * sin * cos - p_psi * phi_dot * sin - sp.diff(form.potential, theta)
    return sp.Matrix(momenta), sp.Matrix([form.forces[0], tilt, form.forces[2]])


def _dot(angle: str) -> Expr:
    return sp.Symbol(dotted(angle))


def _kinematics(model: Model, form: EulerForm) -> Iterator[Equation]:
    phi, theta, psi = (real(x) for x in ANGLES)
    spin = [real(c.name) for c in model.velocities[-3:]]
    q = [real(c.name) for c in model.bodies[0].positions[-4:]]
    half = sp.Rational(1, 2)
    sin, cos = sp.sin, sp.cos
    yield Equation(q[0], cos(theta * half) * cos((phi + psi) * half))
    yield Equation(q[1], sin(theta * half) * cos((phi - psi) * half))
    yield Equation(q[2], sin(theta * half) * sin((phi - psi) * half))
    yield Equation(q[3], cos(theta * half) * sin((phi + psi) * half))
    rates = sp.Matrix([_dot(x) for x in ANGLES])
    yield from (Equation(x, e) for x, e in zip(spin, form.B * rates, strict=True))
    x, y, z = spin
    yield Equation(rates[1], x * cos(psi) - y * sin(psi))
    yield Equation(rates[0], (x * sin(psi) + y * cos(psi)) / sin(theta))
    yield Equation(rates[2], z - rates[0] * cos(theta))


def _constants(model: Model, form: EulerForm) -> Iterator[Step]:
    """What is constant, and with two momenta the motion of θ."""
    kept = [i for i in (0, 2) if form.forces[i] == 0]
    if any(form.loads) or not kept:
        return
    letters, axes = {0: "φ", 2: "ψ"}, {0: "z of the world", 2: "the body's axis"}
    words = CONSTANT.format(
        angles=" and ".join(letters[i] for i in kept),
        momenta=" and ".join(MOMENTA[i].name for i in kept) + (" are" if len(kept) > 1 else " is"),
        axes=" and ".join(axes[i] for i in kept),
    )
    U = form.potential
    energy = Equation(sp.Symbol("E"), sp.Symbol("T") + (sp.Symbol("U") if U != 0 else 0))
    yield Step("equations", f"{TITLE}: constants of the motion", words, (energy,))
    theta = real("theta")
    if form.axial is None or len(kept) < 2 or theta not in U.free_symbols:
        return
    across, along = _across(model, form), form.axial[1]
    p_phi, p_psi, rate_phi = MOMENTA[0], MOMENTA[2], _dot("phi")
    sin, cos = sp.sin(theta), sp.cos(theta)
    barrier = (p_phi - p_psi * cos) ** 2 / (2 * across * sin**2)
    lines = [
        Equation(rate_phi, (p_phi - p_psi * cos) / (across * sin**2)),
        Equation(_dot("psi"), p_psi / along - rate_phi * cos),
        Equation(sp.Symbol("U_e"), barrier + p_psi**2 / (2 * along) + U),
    ]
    weight = simplified(-sp.diff(U, theta) / sin)
    if theta not in weight.free_symbols:
        lines.append(Equation(across * rate_phi**2 * cos - p_psi * rate_phi + weight, sp.S.Zero))
    yield Step("equations", f"{TITLE}: nutation and steady precession", EFFECTIVE, tuple(lines))
