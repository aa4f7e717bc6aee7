"""The derivation against the handout's own pages, typed by hand, term by term."""

from functools import cache
from types import SimpleNamespace

import pytest
import sympy as sp
from mechanisms import compiled

from eomgen.derivation.handout.closed import Equations

SCENES = ("two_body", "two_body_forced")
C, S = sp.cos, sp.sin


@cache
def equations(scene: str) -> Equations:
    """The derivation of one of the handout's two systems."""
    return compiled(scene).equations


@cache
def symbols(scene: str) -> SimpleNamespace:
    """Every symbol of the handout, found by the name that the scene gives it."""
    s = equations(scene).symbols
    named = {symbol.name: symbol for symbol in (*s.q, *s.v, *s.a)} | s.parameters | s.inputs
    xA, xB = ((s.x[k], s.y[k]) for k in (0, 1))
    return SimpleNamespace(
        **named,
        x_A_vector=sp.Matrix(xA),
        x_B_vector=sp.Matrix(xB),
        ddx_A_vector=sp.Matrix([s.xdd[0], s.ydd[0]]),
        ddx_B_vector=sp.Matrix([s.xdd[1], s.ydd[1]]),
        f_j=sp.Matrix(s.force[1]),
    )


def arms(h: SimpleNamespace) -> tuple[sp.Matrix, sp.Matrix]:
    """(18) and (19)."""
    r_A = sp.Matrix([h.l_A * C(h.theta), h.l_A * S(h.theta)])
    r_B = sp.Matrix([-h.l_B * C(h.theta + h.phi), -h.l_B * S(h.theta + h.phi)])
    return r_A, r_B


def loads(scene: str, h: SimpleNamespace) -> tuple[sp.Matrix, sp.Matrix, sp.Expr, sp.Expr, sp.Expr]:
    """(29)-(35): f_Ae, f_Be, their torques about the centres of mass, and the motor torque."""
    zero = sp.zeros(2, 1)
    if scene == "two_body":
        return zero, zero, sp.S.Zero, sp.S.Zero, sp.S.Zero
    f_A, f_B = sp.Matrix([h.f_A_x, h.f_A_y]), sp.Matrix([h.f_B_x, h.f_B_y])
    r_Ae = sp.Matrix([h.d_A * C(h.theta), h.d_A * S(h.theta)])
    r_Be = sp.Matrix([h.d_B * C(h.theta + h.phi), h.d_B * S(h.theta + h.phi)])
    return f_A, f_B, cross(r_Ae, f_A), cross(r_Be, f_B), h.tau


def cross(r: sp.Matrix, f: sp.Matrix) -> sp.Expr:
    """(r × f) · ẑ."""
    return r[0] * f[1] - r[1] * f[0]


def handout_system(h: SimpleNamespace) -> tuple[sp.Matrix, sp.Matrix, sp.Matrix]:
    """(26), (27), (28)."""
    both, turn = h.theta + h.phi, (h.theta_dot + h.phi_dot) ** 2
    M = sp.Matrix(
        [
            [
                h.m_A + h.m_B,
                0,
                -h.m_B * h.l_A * S(h.theta) - h.m_B * h.l_B * S(both),
                -h.m_B * h.l_B * S(both),
            ],
            [
                0,
                h.m_A + h.m_B,
                h.m_B * h.l_A * C(h.theta) + h.m_B * h.l_B * C(both),
                h.m_B * h.l_B * C(both),
            ],
            [h.m_A * h.l_A * S(h.theta), -h.m_A * h.l_A * C(h.theta), h.I_A, 0],
            [h.m_A * h.l_B * S(both), -h.m_A * h.l_B * C(both), h.I_B, h.I_B],
        ]
    )
    V = sp.Matrix(
        [
            -h.m_B * h.l_A * C(h.theta) * h.theta_dot**2 - h.m_B * h.l_B * C(both) * turn,
            -h.m_B * h.l_A * S(h.theta) * h.theta_dot**2 - h.m_B * h.l_B * S(both) * turn,
            0,
            0,
        ]
    )
    G = sp.Matrix(
        [
            0,
            (h.m_A + h.m_B) * h.g,
            -h.m_A * h.l_A * C(h.theta) * h.g,
            -h.m_A * h.l_B * C(both) * h.g,
        ]
    )
    return M, V, G


def assert_same(ours: object, handout: object) -> None:
    """Entry by entry: the difference simplifies to 0."""
    ours, handout = sp.Matrix([*ours]), sp.Matrix([*handout])
    assert ours.shape == handout.shape
    for i, difference in enumerate(ours - handout):
        left = sp.expand(difference)
        assert left == 0 or sp.trigsimp(left) == 0, f"entry {i}: {ours[i]} is not {handout[i]}"


@pytest.mark.parametrize("scene", SCENES)
def test_arms_and_constraint(scene: str) -> None:
    """(18), (19) and (21): where the joint is seen from each body, and x_B = x_A + r_A - r_B."""
    h, kinematics = symbols(scene), equations(scene).kinematics
    r_A, r_B = arms(h)
    assert_same(kinematics.arm_parent[1], r_A)
    assert_same(kinematics.arm_child[1], r_B)
    assert_same(kinematics.position[1], h.x_A_vector + r_A - r_B)


@pytest.mark.parametrize("scene", SCENES)
def test_acceleration_of_the_second_body(scene: str) -> None:
    """(22) and (23): the constraint differentiated twice."""
    h = symbols(scene)
    both, turn = h.theta + h.phi, (h.theta_dot + h.phi_dot) ** 2
    bend = h.theta_ddot + h.phi_ddot
    ddx_A, ddy_A = h.ddx_A_vector
    ddx_B = (
        ddx_A
        - h.l_A * C(h.theta) * h.theta_dot**2
        - h.l_A * S(h.theta) * h.theta_ddot
        - h.l_B * C(both) * turn
        - h.l_B * S(both) * bend
    )
    ddy_B = (
        ddy_A
        - h.l_A * S(h.theta) * h.theta_dot**2
        + h.l_A * C(h.theta) * h.theta_ddot
        - h.l_B * S(both) * turn
        + h.l_B * C(both) * bend
    )
    assert_same(equations(scene).kinematics.acceleration[1], [ddx_B, ddy_B])


@pytest.mark.parametrize("scene", SCENES)
def test_free_body_equations(scene: str) -> None:
    """(12)-(17), with (29)-(35): f_j acts on A and -f_j on B, +τ on B and -τ on A."""
    h = symbols(scene)
    r_A, r_B = arms(h)
    f_A, f_B, torque_A, torque_B, tau = loads(scene, h)
    weight = sp.Matrix([0, h.g])
    forces_A, forces_B = h.f_j - h.m_A * weight + f_A, -h.f_j - h.m_B * weight + f_B
    handout = [
        (h.m_A * h.ddx_A_vector[0], forces_A[0]),
        (h.m_A * h.ddx_A_vector[1], forces_A[1]),
        (h.I_A * h.theta_ddot, cross(r_A, h.f_j) + torque_A - tau),
        (h.m_B * h.ddx_B_vector[0], forces_B[0]),
        (h.m_B * h.ddx_B_vector[1], forces_B[1]),
        (h.I_B * (h.theta_ddot + h.phi_ddot), cross(r_B, -h.f_j) + torque_B + tau),
    ]
    ours = equations(scene).free_bodies.equations
    assert_same([left for left, _ in ours], [left for left, _ in handout])
    assert_same([right for _, right in ours], [right for _, right in handout])


@pytest.mark.parametrize("scene", SCENES)
def test_collected_system(scene: str) -> None:
    """(24)-(28) and (36): M, V, G as printed, this M not symmetric, and F of the applied forces."""
    h, collected = symbols(scene), equations(scene).collected
    M, V, G = handout_system(h)
    assert_same(collected.M, M)
    assert_same(collected.V, V)
    assert_same(collected.G, G)
    assert collected.M.T != collected.M
    r_A, r_B = arms(h)
    f_A, f_B, torque_A, torque_B, tau = loads(scene, h)
    F = [
        f_A[0] + f_B[0],
        f_A[1] + f_B[1],
        -cross(r_A, f_A) + torque_A - tau,
        cross(r_B, f_A) + torque_B + tau,
    ]
    assert_same(collected.F, F)


@pytest.mark.parametrize("scene", SCENES)
def test_joint_force(scene: str) -> None:
    """The recovered force is body A's: f_j = m_A ẍ_A + m_A g ŷ - f_Ae, by (5)."""
    h = symbols(scene)
    found = dict(equations(scene).joint_force)
    f_A = loads(scene, h)[0]
    handout = h.m_A * h.ddx_A_vector + h.m_A * sp.Matrix([0, h.g]) - f_A
    assert list(found) == [*h.f_j]
    assert_same(found.values(), handout)


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", SCENES)
def test_symmetric_form_is_lagranges(scene: str) -> None:
    """Lagrange's equations, from the energies and the virtual work alone, are the symmetric form.

    d/dt ∂T/∂q̇ - ∂T/∂q = M q̈ + V, with M = Mᵀ = ∂²T/∂q̇², and G = ∂U/∂q.
    """
    h, ours = symbols(scene), equations(scene).symmetric
    q = sp.Matrix([h.x_A, h.y_A, h.theta, h.phi])
    v = sp.Matrix([h.x_A_dot, h.y_A_dot, h.theta_dot, h.phi_dot])
    r_A, r_B = arms(h)
    x_A = q[:2, 0]
    x_B = x_A + r_A - r_B
    dx_B = x_B.jacobian(q) * v
    T = (
        h.m_A * (h.x_A_dot**2 + h.y_A_dot**2)
        + h.m_B * dx_B.dot(dx_B)
        + h.I_A * h.theta_dot**2
        + h.I_B * (h.theta_dot + h.phi_dot) ** 2
    ) / 2
    U = h.g * (h.m_A * h.y_A + h.m_B * x_B[1])
    slope = sp.Matrix([T]).jacobian(v).T
    M = slope.jacobian(v)
    assert_same(ours.M, M)
    assert ours.M.T == ours.M
    assert_same(ours.V, slope.jacobian(q) * v - sp.Matrix([T]).jacobian(q).T)
    assert_same(ours.G, sp.Matrix([U]).jacobian(q).T)
    f_A, f_B, torque_A, torque_B, tau = loads(scene, h)
    work = x_A.jacobian(q).T * f_A + x_B.jacobian(q).T * f_B
    work += sp.Matrix([0, 0, torque_A + torque_B, torque_B + tau])
    assert_same(ours.F, work)


@pytest.mark.parametrize("scene", SCENES)
def test_closed_form_solves_the_system_numerically(scene: str) -> None:
    """The closed form put into (24) leaves nothing, to 50 digits at random points.

    With generalised forces τ it does the same to the symmetric form, M q̈ + V + G = F + τ.
    """
    eq, h = equations(scene), symbols(scene)
    M, V, G = handout_system(h)
    a, tau = sp.Matrix(eq.symbols.a), sp.Matrix(eq.symbols.tau)
    twin = eq.symmetric
    for balance, pushed in (
        (M * a + V + G - eq.collected.F, False),
        (twin.M * a + twin.V + twin.G - twin.F - tau, True),
    ):
        inputs = sorted((balance.free_symbols | {*eq.symbols.parameters.values()}) - {*a}, key=str)
        for point in range(4):
            values = dict.fromkeys(tau, sp.Float(0, 60))
            for i, symbol in enumerate(inputs):
                number = sp.Rational(3 + (37 * i + 11 * point) % 23, 7 + (5 * i + point) % 11)
                values[symbol] = sp.Float(number, 60)
            assert pushed == all(values[force] > 0 for force in tau)
            place_bodies(eq, values)
            for symbol, meaning in eq.solution.definitions:
                values[symbol] = meaning.xreplace(values)
            size = max(abs(values[symbol]) for symbol in a)
            assert size > 0.1
            for row in balance.xreplace(values):
                assert abs(row) < 1e-50 * size


def place_bodies(eq: Equations, values: dict[sp.Expr, sp.Expr]) -> None:
    """Angles and rates of the bodies from those of the coordinates: ψ_A = θ, ψ_B = θ + φ."""
    s = eq.symbols
    for body, coordinate in ((s.angle, s.q), (s.omega, s.v)):
        values[body[0]] = values.get(coordinate[2], coordinate[2])
        values[body[1]] = values[body[0]] + values.get(coordinate[3], coordinate[3])


def test_definitions_come_in_order() -> None:
    """Each definition of the closed form uses only what stands before it, and defines it once."""
    eq = equations("two_body_forced")
    s = eq.symbols
    known = {*s.parameters.values(), *s.inputs.values(), *s.tau, *s.angle, *s.omega, *s.q, *s.v}
    for symbol, meaning in eq.solution.definitions:
        assert symbol not in known
        assert meaning.free_symbols <= known, f"{symbol} uses what is not known yet"
        known.add(symbol)
    assert known.issuperset(s.a)
