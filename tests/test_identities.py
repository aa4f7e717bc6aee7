"""Laws of mechanics that every generated module must keep, at seeded random states.

Derivatives are taken in 60-digit arithmetic, by running the program over mpmath numbers; what the
module itself returns is compared in double precision.
"""

from collections.abc import Callable, Mapping

import mpmath
import numpy as np
import pytest
import sympy as sp
from campaign import some
from mechanisms import BUILT_IN, Compiled, compiled, random_tree

from eomgen.program.program import interpret

DIGITS = 60
STEP = mpmath.mpf(10) ** -20  # a central difference is off by its square
TREES = (9, 22, 38)
ROUNDING = 1e-12

Vector = list[mpmath.mpf]


class Digits:
    """mpmath numbers as scalars of a program."""

    def number(self, value: float) -> mpmath.mpf:
        """The double itself, exactly."""
        return mpmath.mpf(value)

    def call(self, function: str, argument: mpmath.mpf) -> mpmath.mpf:
        """sin, cos, tan or sqrt."""
        return getattr(mpmath, function)(argument)


@pytest.fixture(autouse=True)
def sixty_digits():
    """All of mpmath here works in 60 digits."""
    with mpmath.workdps(DIGITS):
        yield


@pytest.fixture(params=[*BUILT_IN, *TREES], ids=str)
def c(request: pytest.FixtureRequest) -> Compiled:
    """Every built-in scene, and some random trees."""
    return compiled(request.param if isinstance(request.param, str) else random_tree(request.param))


def samples(c: Compiled, count: int = 5) -> list[tuple[np.ndarray, dict[str, float]]]:
    """Some states with inputs."""
    rng = np.random.default_rng(31)
    return [(c.scene.random_state(c.module, rng), c.scene.random_inputs(rng)) for _ in range(count)]


def exactly(
    c: Compiled,
    output: str,
    y: Vector,
    u: Mapping[str, float],
    p: Mapping[str, float] | None = None,
) -> Vector:
    """An output of the program in 60 digits."""
    given = {**c.module.PARAMETERS, **(p or {}), **u}
    inputs = {name: mpmath.mpf(value) for name, value in given.items()}
    inputs |= dict(zip(c.module.STATES, y, strict=True))
    return interpret(c.system.program, output, inputs, Digits())


def digits(y: np.ndarray) -> Vector:
    """Doubles as 60-digit numbers."""
    return [mpmath.mpf(float(x)) for x in y]


def along(f: Callable[[Vector], Vector], y: Vector, direction: Vector) -> Vector:
    """The derivative of f at y in a direction: central difference, some 40 digits."""
    ahead = f([a + STEP * d for a, d in zip(y, direction, strict=True)])
    behind = f([a - STEP * d for a, d in zip(y, direction, strict=True)])
    return [(a - b) / (2 * STEP) for a, b in zip(ahead, behind, strict=True)]


def unit(n: int, i: int) -> Vector:
    """The direction of entry i."""
    return [mpmath.mpf(int(j == i)) for j in range(n)]


def halves(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """q and v of a state."""
    return y[: len(y) // 2], y[len(y) // 2 :]


def assert_close(
    actual: object, expected: object, *terms: object, tolerance: float = ROUNDING
) -> None:
    """Equal but for rounding of what is expected and of the terms that it is the sum of."""
    actual, expected = np.asarray(actual, dtype=float), np.asarray(expected, dtype=float)
    assert actual.shape == expected.shape
    size = max(1.0, *(float(np.max(np.abs(np.asarray(x, float)))) for x in (expected, *terms)))
    assert np.max(np.abs(actual - expected)) <= tolerance * size


def test_mass_matrix(c: Compiled) -> None:
    """½ vᵀ M v is the kinetic energy; M is symmetric with positive eigenvalues, and is SymPy's."""
    eq = c.equations
    names = (*eq.symbols.parameters.values(), *eq.symbols.q)
    matrix = sp.lambdify(names, eq.symmetric.M.tolist(), "math")
    for y, u in samples(c, some(5, 20)):
        q, v = halves(y)
        M = c.module.mass_matrix(0.0, y, u=u)
        assert np.array_equal(M, M.T)
        assert np.min(np.linalg.eigvalsh(M)) > 0
        assert_close(c.module.kinetic_energy(0.0, y), v @ M @ v / 2)
        assert_close(M, matrix(*c.module.PARAMETERS.values(), *q))
        for i in range(len(v)):  # the energy of unit velocities makes M too
            for j in range(len(v)):
                e = np.eye(len(v))
                parts = [np.concatenate((q, w)) for w in (e[i] + e[j], e[i], e[j])]
                both, first, second = (c.module.kinetic_energy(0.0, part) for part in parts)
                assert_close(M[i, j], both - first - second, both)


def test_gravity_force_is_the_slope_of_the_potential(c: Compiled) -> None:
    """G = ∂U/∂q; without gravity both are 0."""
    n = len(c.module.STATES)
    for y, u in samples(c):
        exact = [
            along(lambda z, u=u: exactly(c, "potential_energy", z, u), digits(y), unit(n, i))[0]
            for i in range(n)
        ]
        G = c.module.gravity_force(0.0, y, u=u)
        assert_close(G, exact[: n // 2])
        assert exact[n // 2 :] == [0] * (n // 2)
        assert ("gravity" in c.module.EFFECTS) == bool(np.any(G))


def test_velocity_force_is_christoffels(c: Compiled) -> None:
    """V = C v with the Christoffel symbols of M, so Ṁ - 2C is skew and vᵀ V = ½ vᵀ Ṁ v."""
    n = len(c.module.STATES) // 2
    for y, u in samples(c, 2):
        z, (_, v) = digits(y), halves(y)
        slopes = np.array(
            [
                along(lambda z, u=u: exactly(c, "mass_matrix", z, u), z, unit(2 * n, i))
                for i in range(n)
            ]
        ).reshape(n, n, n)  # slopes[k, i, j] = ∂M_ij/∂q_k
        rate = np.einsum("kij,k->ij", slopes, v)
        C = (rate + np.einsum("jik,k->ij", slopes, v) - np.einsum("ijk,k->ij", slopes, v)) / 2
        skew = (rate - 2 * C).astype(float)
        assert_close(skew, -skew.T)
        V = c.module.velocity_force(0.0, y, u=u)
        terms = np.abs(C.astype(float)) @ np.abs(v)
        assert_close(V, C @ v, terms)
        assert_close(v @ V, v @ rate @ v / 2, np.abs(v) @ terms)


def test_energy_flows_as_velocity_times_force(c: Compiled) -> None:
    """d/dt ½ vᵀ M v = vᵀ (M v̇ + V), with Ṁ along the motion."""
    n = len(c.module.STATES) // 2
    for y, u in samples(c, 2):
        z, (_, v) = digits(y), halves(y)
        rates = exactly(c, "derivative", z, u)
        [flow] = along(lambda z, u=u: exactly(c, "kinetic_energy", z, u), z, rates)
        M, V = c.module.mass_matrix(0.0, y, u=u), c.module.velocity_force(0.0, y, u=u)
        inertia = M @ np.array([float(a) for a in rates[n:]])
        assert_close(v @ (inertia + V), flow, np.abs(v) @ (np.abs(inertia) + np.abs(V)))


def test_velocity_force_is_quadratic(c: Compiled) -> None:
    """V(q, s v) = s² V(q, v), exactly so where s is a power of two."""
    for y, u in samples(c, 20):
        q, v = halves(y)
        V = c.module.velocity_force(0.0, y, u=u)
        for s in (-4.0, 0.0, 0.5):
            scaled = c.module.velocity_force(0.0, np.concatenate((q, s * v)), u=u)
            assert np.array_equal(scaled, s**2 * V)


def test_balance(c: Compiled) -> None:
    """M v̇ + V + G = F + τ closes for the module's own answers, and inverse undoes forward."""
    rng = np.random.default_rng(32)
    for y, u in samples(c, 20):
        q, v = halves(y)
        module = c.module
        M = module.mass_matrix(0.0, y, u=u)
        V, G, F = (
            getattr(module, name)(0.0, y, u=u)
            for name in ("velocity_force", "gravity_force", "applied_force")
        )
        tau = rng.uniform(-20.0, 20.0, len(q))
        vd = module.forward_dynamics(q, v, tau, u=u)
        terms = (np.abs(M) @ np.abs(vd), V, G, F)
        assert_close(M @ vd + V + G, F + tau, *terms)
        assert_close(module.inverse_dynamics(q, v, vd, u=u), tau, *terms)
        assert_close(module.inverse_dynamics(q, v, 0 * vd, u=u), V + G - F, *terms)
        free = module.forward_dynamics(q, v, u=u)
        assert_close(free, module.derivative(0.0, y, u=u)[len(q) :])


def test_energy_changes_by_the_power_of_applied_forces(c: Compiled) -> None:
    """dE/dt along the motion is Σ f·ẋ + τ φ̇ of forces and motors, as the other solver sees it."""
    for y, u in samples(c):
        z = digits(y)
        rates = exactly(c, "derivative", z, u)

        def energy(z: Vector, u: Mapping[str, float] = u) -> Vector:
            kinetic, potential = (
                exactly(c, f"{kind}_energy", z, u)[0] for kind in ("kinetic", "potential")
            )
            return [kinetic + potential]

        [flow] = along(energy, z, rates)
        power = c.scene.motion(c.module, y, u=u).external_power
        assert_close(power, flow)
        if not c.scene.inputs:
            assert abs(flow) < 1e-30


def test_momentum_changes_by_the_forces_from_outside(c: Compiled) -> None:
    """Momentum, linear and angular, changes by weights, applied forces and the world's pins."""
    for y, u in samples(c):
        z = digits(y)
        rates = exactly(c, "derivative", z, u)
        flow = along(lambda z, u=u: exactly(c, "momentum", z, u), z, rates)
        motion = c.scene.motion(c.module, y, u=u)
        outside = [*motion.external_force, motion.external_torque]
        assert_close(outside, flow, motion.pin_forces, motion.poses)


def test_momentum_is_constant_when_nothing_acts_from_outside() -> None:
    """The handout's two bodies, without gravity, keep all three momenta to 30 digits."""
    c = compiled("two_body")
    for y, _ in samples(c):
        z = digits(y)
        assert max(abs(a) for a in exactly(c, "derivative", z, {}, {"g": 0.0})[4:]) > 0.1
        rates = exactly(c, "derivative", z, {}, {"g": 0.0})
        for flow in along(lambda z: exactly(c, "momentum", z, {}), z, rates):
            assert abs(flow) < 1e-30


CASES = [(scene, "velocity") for scene in (*BUILT_IN, *TREES)]
CASES += [  # the other forms need an inertia of every body
    (scene, form)
    for scene in ("double_pendulum", "two_body", "two_body_forced", 9, 38)
    for form in ("momentum", "redundant")
]


@pytest.mark.parametrize(("scene", "form"), CASES)
def test_jacobian(scene: str | int, form: str) -> None:
    """The exact Jacobian is the derivative's, differentiated in 60 digits, in every state form."""
    scene = scene if isinstance(scene, str) else random_tree(scene)
    c = compiled(scene, form)
    n = len(c.module.STATES)
    rng = np.random.default_rng(33)
    y, u = rng.uniform(-3.0, 3.0, n), c.scene.random_inputs(rng)
    columns = [
        along(lambda z: exactly(c, "derivative", z, u), digits(y), unit(n, i)) for i in range(n)
    ]
    exact = np.array(columns, dtype=float).T
    ours = c.module.jacobian(0.0, y, u=u)
    assert_close(ours, exact)
    both = np.column_stack((y, y))
    inputs = np.column_stack([[u[name] for name in c.module.INPUTS]] * 2)
    assert_close(c.module.jacobian(0.0, both, u=inputs)[:, :, 1], exact)


@pytest.mark.parametrize(("scene", "form"), CASES)
def test_jacobians_by_inputs_and_parameters(scene: str | int, form: str) -> None:
    """∂f/∂u and ∂f/∂p are the derivative's, differentiated in 60 digits, in every state form."""
    scene = scene if isinstance(scene, str) else random_tree(scene)
    c = compiled(scene, form)
    module, rng = c.module, np.random.default_rng(34)
    names = {"input": tuple(module.INPUTS), "parameter": tuple(module.PARAMETERS)}
    y, u = rng.uniform(-3.0, 3.0, len(module.STATES)), c.scene.random_inputs(rng)
    values = {n: v * float(rng.uniform(0.5, 2.0)) for n, v in module.PARAMETERS.items()} | u

    def rates(by: tuple[str, ...], at: Vector) -> Vector:
        changed = {**values, **dict(zip(by, at, strict=True))}
        return exactly(c, "derivative", digits(y), {}, changed)

    p = {name: values[name] for name in module.PARAMETERS}
    for kind, by in names.items():
        if not by:
            assert f"{kind}_jacobian" not in module.COST
            continue
        at = digits(np.array([values[name] for name in by]))
        columns = [
            along(lambda z, by=by: rates(by, z), at, unit(len(by), i)) for i in range(len(by))
        ]
        exact = np.array(columns, dtype=float).T
        function = getattr(module, f"{kind}_jacobian")
        assert_close(function(0.0, y, p, u), exact)
        assert_close(function(0.0, np.column_stack((y, y)), p, u)[:, :, 1], exact)
        assert np.any(exact)
