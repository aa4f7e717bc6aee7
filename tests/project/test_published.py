"""Published and exact numbers, typed in here with where they come from.

Each is independent of eomgen: printed by others, or a formula of the books evaluated in 40 digits.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from engine import text_of
from scipy.special import ellipj

from eomgen.model.elaborate import elaborate
from eomgen.run.integrate import integrate
from eomgen.run.module import as_problem, load_module
from eomgen.run.trajectory import Trajectory
from eomgen.scene.reader import parse_scene, read_scene

PRINTED = 1e-4
"""What the Robotics Toolbox's own tests hold its numbers to."""


@cache
def loaded(scene: str) -> Any:
    """The module of a built-in scene."""
    return load_module(text_of(read_scene(scene)), f"published_{scene}")


def unconditional(scene: str) -> Any:
    """The same, of whatever moments of inertia: some published ones are of no body."""
    model = replace(elaborate(read_scene(scene)), conditions=())
    return load_module(text_of(model), f"published_{scene}")


def state(module: ModuleType, values: Mapping[str, float]) -> np.ndarray:
    """A state from what is not 0 in it, by name."""
    y = np.zeros(len(module.STATES))
    for name, value in values.items():
        y[module.STATES.index(name)] = value
    return y


def run(
    module: ModuleType,
    t_end: float,
    *,
    rtol: float,
    atol: float,
    samples: int,
    p: Mapping[str, float] | None = None,
    start: Mapping[str, float] | None = None,
    max_step: float | None = None,
) -> Trajectory:
    """A run by DOP853 from the scene's initial state, with some of its numbers changed."""
    problem = as_problem(module, p)
    if start:
        y = problem.initial.copy()
        for name, value in start.items():
            y[module.STATES.index(name)] = value
        problem = replace(problem, initial=y)
    found = integrate(
        problem, "DOP853", t_end, rtol=rtol, atol=atol, samples=samples, max_step=max_step
    )
    assert found.finished
    return found


# The PUMA 560 of P. Corke's Robotics Toolbox (parameters: Corke and Armstrong-Helouvry 1994) in its
# pose qn. Values: unit_test/SerialLinkTest.m of robotics-toolbox-matlab at bd7a9d75, and
# tests/test_DHRobot.py of robotics-toolbox-python at a9ed8d45. Friction, which the scene leaves
# out, is put on as torques: viscous B G^2 qd and Coulomb |G| Tc; no velocity here is negative.

JOINTS = range(1, 7)
QN = np.array([0.0, np.pi / 4, np.pi, 0.0, np.pi / 4, 0.0])
GEAR = np.array([-62.6111, 107.815, -53.7063, 76.0364, 71.923, 76.686])
VISCOUS = np.array([0.00148, 0.000817, 0.00138, 7.12e-05, 8.26e-05, 3.67e-05])
COULOMB = np.array([0.395, 0.126, 0.132, 0.0112, 0.00926, 0.00396])
INERTIA_QN = np.array(
    [
        [3.6594, -0.4044, 0.1006, -0.0025, 0.0, 0.0],
        [-0.4044, 4.4137, 0.3509, 0.0, 0.0024, 0.0],
        [0.1006, 0.3509, 0.9378, 0.0, 0.0015, 0.0],
        [-0.0025, 0.0, 0.0, 0.1925, 0.0, 0.0],
        [0.0, 0.0024, 0.0015, 0.0, 0.1713, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.1941],
    ]
)
CORIOLIS_QN = np.array(  # at velocities 1, 2, 3, 1, 2, 3, after Christoffel
    [
        [-0.1735, -2.0494, -0.1178, -0.0002, -0.0045, 0.0001],
        [0.6274, 1.1572, 1.9287, -0.0015, -0.0003, 0.0],
        [-0.3608, -0.7734, -0.0018, -0.0009, -0.0064, 0.0],
        [0.0011, 0.0005, -0.0001, 0.0002, 0.0002, -0.0001],
        [-0.0002, 0.0028, 0.0046, -0.0002, 0.0, 0.0],
        [0.0001, 0.0, 0.0, 0.0, 0.0, 0.0],
    ]
)


@pytest.fixture(scope="module")
def puma() -> Any:
    """The arm's module; joints in the toolbox's order."""
    module = loaded("puma560")
    assert module.STATES[:6] == tuple(f"q_{i}" for i in JOINTS)
    assert module.STATES[6:] == tuple(f"q_{i}_dot" for i in JOINTS)
    return module


def friction(velocity: np.ndarray) -> np.ndarray:
    """Torques that friction takes at positive velocities, as the toolbox has it."""
    return VISCOUS * GEAR**2 * velocity + np.abs(GEAR) * COULOMB * (velocity > 0)


def test_puma_mass_matrix(puma: Any) -> None:
    """M at qn with the rotors' G^2 J on its diagonal."""
    M = puma.mass_matrix(0.0, np.concatenate([QN, np.zeros(6)]))
    np.testing.assert_allclose(M, INERTIA_QN, atol=PRINTED)


def test_puma_gravity(puma: Any) -> None:
    """Torques that hold the arm at qn."""
    G = puma.gravity_force(0.0, np.concatenate([QN, np.zeros(6)]))
    np.testing.assert_allclose(G, [0.0, 31.6399, 6.0351, 0.0, 0.0283, 0.0], atol=PRINTED)


def test_puma_velocity_force(puma: Any) -> None:
    """V = C qd, and all of C: V is a quadratic form, so its half gradient is the Christoffel C."""
    v = np.array([1.0, 2.0, 3.0, 1.0, 2.0, 3.0])

    def force(velocity: np.ndarray) -> np.ndarray:
        return puma.velocity_force(0.0, np.concatenate([QN, velocity]))

    C = np.transpose([(force(v + e) - force(v - e)) / 4 for e in np.eye(6)])
    np.testing.assert_allclose(C, CORIOLIS_QN, atol=PRINTED)
    np.testing.assert_allclose(force(v), C @ v, atol=1e-13)


@pytest.mark.parametrize(
    ("velocity", "acceleration", "torques"),
    [
        (0.0, 1.0, [3.35311, 36.0025, 7.42596, 0.190043, 0.203441, 0.194133]),
        (1.0, 0.0, [29.1421, 56.5044, 16.3528, 1.26448, 1.12392, 0.519648]),
        (1.0, 1.0, [32.4952, 60.867, 17.7436, 1.45452, 1.29911, 0.713781]),
    ],
)
def test_puma_inverse_dynamics(
    puma: Any, velocity: float, acceleration: float, torques: list[float]
) -> None:
    """The toolbox's rne at qn, every joint alike; six digits are printed."""
    v = np.full(6, velocity)
    tau = puma.inverse_dynamics(QN, v, np.full(6, acceleration)) + friction(v)
    np.testing.assert_allclose(tau, torques, rtol=5.1e-6, atol=1e-6)


@pytest.mark.parametrize("way", ["motors", "tau"])
def test_puma_forward_dynamics(puma: Any, way: str) -> None:
    """The toolbox's accel at qn, with friction and, recomputed to six decimals, without."""
    v = np.array([0.1, 0.2, 0.8, 0.2, 0.5, 1.0])
    torque = np.array([1.0, 3.2, 1.8, 0.1, 0.7, 4.6])

    def acceleration(tau: np.ndarray) -> np.ndarray:
        if way == "tau":
            return puma.forward_dynamics(QN, v, tau)
        return puma.forward_dynamics(QN, v, u={f"tau_{i}": tau[i - 1] for i in JOINTS})

    published = [-7.4102, -9.8432, -10.9694, -4.4314, -0.9881, 21.0228]
    np.testing.assert_allclose(acceleration(torque - friction(v)), published, atol=PRINTED)
    frictionless = [-0.354048, -6.398926, -2.068494, 0.511244, 4.021223, 23.698454]
    np.testing.assert_allclose(acceleration(torque), frictionless, atol=1e-6)


def test_puma_moments_put_right_change_no_motion() -> None:
    """The published moments of links 2 and 3, which are of no body, act as the scene's do."""
    puma = unconditional("puma560")
    published = {"I_2x": 0.13, "I_2y": 0.524, "I_3x": 0.066, "I_3z": 0.0125}
    rng = np.random.default_rng(560)
    y = np.concatenate([rng.uniform(-np.pi, np.pi, 6), rng.uniform(-2.0, 2.0, 6)])
    for output in (puma.mass_matrix, puma.velocity_force, puma.derivative):
        np.testing.assert_allclose(output(0.0, y, published), output(0.0, y), rtol=0, atol=1e-12)


TWO_LINKS = """
name = "two_links"
outputs = ["inverse_dynamics"]
bodies = [
    { name = "upper", mass = 1.0, inertia_com = 0 },
    { name = "lower", mass = 1.0, inertia_com = 0 },
]
joints = [
    { name = "shoulder", type = "revolute", parent = "world", child = "upper", \
r_child = [-0.5, 0] },
    { name = "elbow", type = "revolute", parent = "upper", child = "lower", r_parent = [0.5, 0], \
r_child = [-0.5, 0] },
]
effects = [{ type = "gravity", g = 9.81 }]
"""


@pytest.mark.parametrize(
    ("q", "torques"),
    [([0.0, 0.0], [2.0, 0.5]), ([0.0, np.pi / 2], [1.5, 0.0]), ([np.pi / 2, 0.0], [0.0, 0.0])],
)
def test_two_links_of_the_toolbox(q: list[float], torques: list[float]) -> None:
    """models/mdl_twolink.m, rne_test of SerialLinkTest.m: exact multiples of g hold it."""
    module: Any = load_module(text_of(parse_scene(TWO_LINKS)), "two_links")
    tau = module.inverse_dynamics(q, np.zeros(2), np.zeros(2))
    np.testing.assert_allclose(tau, 9.81 * np.array(torques), atol=1e-14)


# T. R. Kane's chaotic pendulum after 10 s: angles in degrees, their rates and accelerations in SI
# units. Drake (multibody/benchmarks/chaotic_babyboot, from MotionGenesis) prints the first to some
# seven digits; the second is a Gragg-Bulirsch-Stoer run in 48 digits, at two resolutions that agree
# to 20 (run again for this test in 40 digits, with the same result).
BABYBOOT_PRINTED = np.array(
    [
        -61.312983340691, -929.47789677244, -6.7440081040646, -2.7795690128833, 41.137023263571,
        19.483647096003,
    ]
)  # fmt: skip
BABYBOOT = np.array(
    [
        -61.312983517501685534, -929.47789813700101347, -6.7440080753737697787,
        -2.7795696723106601822, 41.137023176526124289, 19.483647488829943449,
    ]
)  # fmt: skip


def babyboot_end(module: Any, y: np.ndarray) -> np.ndarray:
    """What Drake prints of an end state."""
    places = [module.STATES.index(name) for name in ("q_A", "q_B", "q_A_dot", "q_B_dot")]
    return np.array(
        [*np.degrees(y[places[:2]]), *y[places[2:]], *module.derivative(0.0, y)[places[2:]]]
    )


def test_babyboot_as_printed() -> None:
    """The scene as it is simulated, to the digits that Drake prints."""
    module = loaded("babyboot")
    y = run(module, 10.0, rtol=1e-13, atol=1e-15, samples=2).y[-1]
    np.testing.assert_allclose(babyboot_end(module, y), BABYBOOT_PRINTED, rtol=0, atol=2e-6)
    np.testing.assert_allclose(babyboot_end(module, y), BABYBOOT, rtol=0, atol=2e-6)


def test_babyboot_to_the_last_digit() -> None:
    """To 1e-8 of each value, with steps of 5 ms at most.

    What the steps are off that rtol 1e-13 asks for has grown to 2e-7 by the end. In short ones
    chaos has only rounding left to grow.
    """
    module = loaded("babyboot")
    y = run(module, 10.0, rtol=1e-13, atol=1e-15, samples=2, max_step=0.005).y[-1]
    np.testing.assert_allclose(babyboot_end(module, y), BABYBOOT, rtol=1e-8)


# The rigid body of Hairer, Norsett and Wanner: y1' = -2 y2 y3, y2' = 1.25 y1 y3, y3' = -0.5 y1 y2,
# which are Euler's equations for moments 1, 4, 6. From (1, 0, 0.9) it is (cn, sqrt(0.625) sn,
# 0.9 dn)(1.42302494707577 t | 0.308641975308642), evaluated in 40 digits.
EULER_TOP = np.array(
    [
        [1.0, 0.2446669753399561874, 0.7665417760867624717, 0.7582647837038857776],
        [2.0, -0.8353640990180009096, 0.4345736575022722570, 0.8570054226678143412],
        [3.0, -0.6927239832661219133, -0.5701608780685926101, 0.8246008908848089452],
        [5.0, 0.9716899970677550153, 0.1867795317989672178, 0.8922137426650541329],
        [8.0, -0.5230342109577448958, -0.6738115529247630493, 0.7927112945190371751],
        [13.0, -0.3366123703251475161, -0.7444343960954877805, 0.7670247531624899021],
        [17.0, -0.9921200662699092878, -0.0990510414653437750, 0.8978171063606731587],
        [20.0, 0.6062038539648122218, 0.6287472104501779704, 0.8073851485756025755],
    ]
)


def test_torque_free_body_in_elliptic_functions() -> None:
    """Twenty seconds, four turns over, within 1e-10."""
    module = unconditional("tumbling_body")
    moments = {"I_1": 1.0, "I_2": 4.0, "I_3": 6.0}
    start = {"nut_wx": 1.0, "nut_wy": 0.0, "nut_wz": 0.9}
    found = run(module, 20.0, rtol=1e-13, atol=1e-15, samples=21, p=moments, start=start)
    rows = EULER_TOP[:, 0].astype(int)
    np.testing.assert_allclose(found.t[rows], EULER_TOP[:, 0], atol=1e-12)
    spin = [module.STATES.index(f"nut_w{axis}") for axis in "xyz"]
    np.testing.assert_allclose(found.y[rows][:, spin], EULER_TOP[:, 1:], rtol=0, atol=1e-10)


def test_heavy_top_in_elliptic_functions() -> None:
    """The nutation of Lagrange's top from a start with its axis at rest.

    With u = cos(tilt), u'^2 = (u0 - u) (beta (1 - u^2) - a^2 (u0 - u)), where beta = 2 m g h / I
    and a = I_3 w_3 / I, with I about the tip (Goldstein, Classical Mechanics, section 5.7). It has
    roots u1 < u0 < u3, and u = u1 + (u0 - u1) sn^2(x + K) with x = sqrt(beta (u3 - u1)) t / 2 goes
    to and fro between the lower two, from u0; sn(x + K) = cn(x) / dn(x).
    """
    module = loaded("spinning_top")
    p = module.PARAMETERS
    across = p["I_1"] + p["m"] * p["h"] ** 2
    spin = 60.0
    beta, a = 2 * p["m"] * p["g"] * p["h"] / across, p["I_3"] * spin / across
    u0 = 0.96**2 - 0.28**2
    # beta (1 - u^2) - a^2 (u0 - u) = 0
    u1, u3 = np.sort(np.roots([-beta, a**2, beta - a**2 * u0]))
    assert -1 < u1 < u0 < 1 < u3

    found = run(module, 3.0, rtol=1e-13, atol=1e-15, samples=301)
    modulus = (u0 - u1) / (u3 - u1)
    _, cn, dn, _ = ellipj(np.sqrt(beta * (u3 - u1)) / 2 * found.t, modulus)
    exact = u1 + (u0 - u1) * (cn / dn) ** 2
    tilt = module.body_poses(0.0, found.y.T)[0, 2, 2]
    np.testing.assert_allclose(tilt, exact, rtol=0, atol=1e-10)
    assert np.ptp(tilt) > 0.1
    assert np.max(np.abs(found.y[:, module.STATES.index("tip_wz")] - spin)) < 1e-10


# Roots of the Laguerre polynomial L_10, in 19 digits: the squared frequencies, in g / l, of ten
# equal beads on equal massless threads (D. Bernoulli).


# The stiff beam of the CWI/Bari Test Set for IVP Solvers (E. Hairer, G. Wanner, Solving ODEs II,
# IV.10) at t = 5: RADAU in extended precision, rtol = atol = 1.1e-18, as R's deTestSet
# ships it: Ex_beam.f, rforge/bvpsolve at 78c711b7. Angles from the x axis, and their rates.
BEAM_ANGLES = np.array(
    [
        -0.005792366591285007, -0.01695298550721735, -0.02769103312973094, -0.03800815655879158,
        -0.04790616859743763, -0.05738710435274594, -0.06645327313454617, -0.07510730581979037,
        -0.08335219765414992, -0.09119134654647947, -0.0986285870013209, -0.1056682200378002,
        -0.1123150395409595, -0.1185743552727245, -0.1244520128755561, -0.1299544113264161,
        -0.1350885180610398, -0.1398618819194422, -0.1442826441015242, -0.1483595472463012,
        -0.1521019429001447, -0.1555197978061129, -0.1586236993420229, -0.1614248603702127,
        -0.1639351238193223, -0.1661669673440852, -0.1681335081778558, -0.1698485080602243,
        -0.1713263782440888, -0.1725821847462537, -0.1736316537975654, -0.1744911773840049,
        -0.1751778187863392, -0.1757093178712902, -0.1761040960228576, -0.1763812607175549,
        -0.1765606097564671, -0.1766626352260565, -0.176708527080746, -0.1767201761075488,
    ]
)  # fmt: skip
BEAM_RATES = np.array(
    [
        0.03747362681329794, 0.1099117880217593, 0.1798360474312799, 0.2472427305442391,
        0.3121293820596567, 0.37449473770195, 0.4343386073492798, 0.4916620354601748,
        0.5464677854586807, 0.598760970262427, 0.648549361111074, 0.6958435169132503,
        0.7406572668520808, 0.7830081747813241, 0.8229176659201515, 0.860411030519056,
        0.8955175502377805, 0.9282708263127953, 0.9587089334522034, 0.9868747821728363,
        1.012816579961883, 1.036587736679858, 1.058246826481355, 1.077857811433353,
        1.095490222005369, 1.111219164294898, 1.125125269286501, 1.137294526609229,
        1.147818025153607, 1.156792132004482, 1.164318845130183, 1.170505992596124,
        1.17546742429955, 1.179323003228859, 1.182198586299667, 1.184226111223146,
        1.185543909805575, 1.186297084203716, 1.186637618908127, 1.186724615113034,
    ]
)  # fmt: skip


@pytest.mark.full
def test_stiff_beam() -> None:
    """Forty angles within 1e-9 and their rates within 1e-6: sums of the relative ones here."""
    module = loaded("stiff_beam")
    found = integrate(as_problem(module), "Radau", 5.0, rtol=2e-8, atol=2e-9, samples=2)
    assert found.finished
    angles, rates = np.cumsum(found.y[-1].reshape(2, 40), axis=1)
    np.testing.assert_allclose(angles, BEAM_ANGLES, rtol=0, atol=1e-9)
    np.testing.assert_allclose(rates, BEAM_RATES, rtol=0, atol=1e-6)


def test_stiffness_of_the_beam() -> None:
    """Its fastest frequency is some 6400 rad/s, and nothing but rounding damps it."""
    module = loaded("stiff_beam")
    found = np.linalg.eigvals(module.jacobian(0.0, module.initial_state()))
    assert 6390 < np.max(found.imag) < 6410
    assert np.max(np.abs(found.real)) < 1e-6
