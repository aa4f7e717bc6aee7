"""Laws of mechanics that every generated module must keep, at seeded random states.

Derivatives are taken in 60 digits, by running the program over such numbers; what the module itself
returns is compared in double precision.
"""

import numpy as np
import pytest
import sympy as sp
from campaign import BUILT_IN, some
from engine import along, exact, varied
from mechanisms import Compiled, compiled, random_tree

TREES = (9, 22, 7)
ROUNDING = 1e-12


@pytest.fixture(params=[*BUILT_IN, *TREES], ids=str)
def c(request: pytest.FixtureRequest) -> Compiled:
    """Every built-in scene, and some random trees."""
    return compiled(request.param if isinstance(request.param, str) else random_tree(request.param))


def samples(c: Compiled, count: int = 5) -> list[tuple[np.ndarray, dict[str, float]]]:
    """Some states with inputs."""
    rng = np.random.default_rng(31)
    return [(c.random_state(rng), c.random_inputs(rng)) for _ in range(count)]


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


@pytest.mark.every(4)
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


@pytest.mark.every(4)
def test_gravity_force_is_the_slope_of_the_potential(c: Compiled) -> None:
    """G = ∂U/∂q; without gravity both are 0."""
    n = len(c.module.STATES)
    for y, u in samples(c):
        slopes = [
            along(lambda z, u=u: c.exactly("potential_energy", z, u), exact(y), unit)
            for unit in exact(np.eye(n))
        ]
        G = c.module.gravity_force(0.0, y, u=u)
        assert_close(G, slopes[: n // 2])
        assert slopes[n // 2 :] == [0] * (n // 2)
        assert ("gravity" in c.module.EFFECTS) == bool(np.any(G))


def test_velocity_force_is_christoffels(c: Compiled) -> None:
    """V = C v with the Christoffel symbols of M, so Ṁ - 2C is skew and vᵀ V = ½ vᵀ Ṁ v."""
    n = len(c.module.STATES) // 2
    for y, u in samples(c, 2):
        z, (_, v) = exact(y), halves(exact(y))
        slopes = np.array(  # slopes[k, i, j] = ∂M_ij/∂q_k
            [
                along(lambda z, u=u: c.exactly("mass_matrix", z, u), z, unit)
                for unit in exact(np.eye(2 * n)[:n])
            ]
        )
        rate = np.einsum("kij,k->ij", slopes, v)
        C = (rate + np.einsum("jik,k->ij", slopes, v) - np.einsum("ijk,k->ij", slopes, v)) / 2
        skew = (rate - 2 * C).astype(float)
        assert_close(skew, -skew.T)
        V = c.module.velocity_force(0.0, y, u=u)
        terms = np.abs(C) @ np.abs(v)
        assert_close(V, C @ v, terms)
        assert_close(v @ exact(V), v @ rate @ v / 2, np.abs(v) @ terms)


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
        z = exact(y)
        rates = c.exactly("derivative", z, u)
        flow = sum(
            along(lambda z, u=u, kind=kind: c.exactly(f"{kind}_energy", z, u), z, rates)
            for kind in ("kinetic", "potential")
        )
        power = c.motion(y, u).external_power
        assert_close(power, flow)
        if not c.module.INPUTS:
            assert abs(flow) < 1e-30


def test_momentum_changes_by_the_forces_from_outside(c: Compiled) -> None:
    """Momentum, linear and angular, changes by weights, applied forces and the world's pins."""
    for y, u in samples(c):
        z = exact(y)
        rates = c.exactly("derivative", z, u)
        flow = along(lambda z, u=u: c.exactly("momentum", z, u), z, rates)
        motion = c.motion(y, u)
        outside = motion.external_wrench[[0, 1, 5]]
        assert_close(outside, flow, motion.joint_forces, motion.body_poses)


CASES = [(scene, "velocity") for scene in (*BUILT_IN, *TREES)]
CASES += [  # the other forms need an inertia of every body
    (scene, form)
    for scene in ("double_pendulum", "two_body", "two_body_forced", 9, TREES[-1])
    for form in ("momentum", "redundant")
]


@pytest.mark.every(4)
@pytest.mark.parametrize(("scene", "form"), CASES)
def test_jacobian(scene: str | int, form: str) -> None:
    """The exact Jacobian is the derivative's, differentiated in 60 digits, in every state form."""
    scene = scene if isinstance(scene, str) else random_tree(scene)
    c = compiled(scene, form)
    n = len(c.module.STATES)
    rng = np.random.default_rng(33)
    y, u = rng.uniform(-3.0, 3.0, n), c.random_inputs(rng)
    columns = [
        along(lambda z: c.exactly("derivative", z, u), exact(y), unit) for unit in exact(np.eye(n))
    ]
    expected = np.array(columns).T
    ours = c.module.jacobian(0.0, y, u=u)
    assert_close(ours, expected)
    both = np.column_stack((y, y))
    inputs = np.column_stack([[u[name] for name in c.module.INPUTS]] * 2)
    assert_close(c.module.jacobian(0.0, both, u=inputs)[:, :, 1], expected)


@pytest.mark.every(6)
@pytest.mark.parametrize(("scene", "form"), CASES)
def test_jacobians_by_inputs_and_parameters(scene: str | int, form: str) -> None:
    """∂f/∂u and ∂f/∂p are the derivative's, differentiated in 60 digits, in every state form."""
    scene = scene if isinstance(scene, str) else random_tree(scene)
    c = compiled(scene, form)
    module, rng = c.module, np.random.default_rng(34)
    names = {"input": tuple(module.INPUTS), "parameter": tuple(module.PARAMETERS)}
    y, u = rng.uniform(-3.0, 3.0, len(module.STATES)), c.random_inputs(rng)
    values = varied(c.model, rng, 0.5, 2.0) | u

    def rates(by: tuple[str, ...], at: np.ndarray) -> np.ndarray:
        changed = {**values, **dict(zip(by, at, strict=True))}
        return c.exactly("derivative", y, changed, changed)

    p = {name: values[name] for name in module.PARAMETERS}
    for kind, by in names.items():
        if not by:
            assert f"{kind}_jacobian" not in module.COST
            continue
        at = exact([values[name] for name in by])
        ways = exact(np.eye(len(by)))
        expected = np.array([along(lambda z, by=by: rates(by, z), at, way) for way in ways]).T
        function = getattr(module, f"{kind}_jacobian")
        assert_close(function(0.0, y, p, u), expected)
        assert_close(function(0.0, np.column_stack((y, y)), p, u)[:, :, 1], expected)
        assert np.any(expected)
