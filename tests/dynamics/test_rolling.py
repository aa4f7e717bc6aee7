"""Rolling, knife edges and points on curves: against closed forms, integrals and published numbers.

Closed forms are derived in the comments or are in the books: E. J. Routh, Dynamics of a System of
Rigid Bodies (1905); Ju. I. Neimark and N. A. Fufaev, Dynamics of Nonholonomic Systems (1972).
"""

from functools import cache
from typing import Any

import mpmath
import numpy as np
import pytest
from campaign import some
from scenes import refusal
from scipy.integrate import quad
from scipy.special import ellipj, ellipk
from whipple import PRINTED, SPEEDS, TABLE, appendix, linearised, matrices

from eomgen.base.errors import SceneError
from eomgen.dynamics.loops import constraints
from eomgen.dynamics.start.assembly import assembled
from eomgen.dynamics.tree.mechanism_state import MechanismState
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.model.named import Values
from eomgen.pipeline import generate
from eomgen.run.integrate import integrate
from eomgen.run.module import as_problem, load_module
from eomgen.scalars.duals import Dual, Duals
from eomgen.scalars.extended import MP
from eomgen.scalars.floats import FloatScalars
from eomgen.scene.effects.vectors import cross
from eomgen.scene.reader import built_in_names, parse_scene, read_scene

TIGHT = {"rtol": 1e-11, "atol": 1e-13}


@cache
def module(scene: str) -> Any:
    """The module of a built-in scene, or of a text without its outputs."""
    if scene not in built_in_names():
        tables = parse_scene(scene)
        made = generate(assembled(elaborate(tables)), jacobian=False)
    else:
        tables = read_scene(scene).replaced(outputs=("kinetic_energy", "potential_energy"))
        made = generate(assembled(elaborate(tables)), jacobian=scene == "bicycle")
    return load_module(made.module, f"rolling_{tables.name}")


def run(scene: str, t_end: float, samples: int = 41) -> tuple[Any, np.ndarray, dict[str, Any]]:
    """A module, the times of a run, and its states by name."""
    made = module(scene)
    found = integrate(as_problem(made), "DOP853", t_end, samples=samples, **TIGHT)
    assert found.finished
    return made, found.t, dict(zip(made.STATES, found.y.T, strict=True))


def body(name: str, mass: float, inertia: Any = None) -> str:
    """A body's table."""
    own = "" if inertia is None else f", inertia_com = {inertia}"
    return f'[[bodies]]\nname = "{name}"\nmass = {mass}\n{own.strip(", ")}\n'


def scene(
    dimensions: int, *tables: str, start: str = "", outputs: str = "", route: str = "ldl"
) -> str:
    """A scene of such tables."""
    gravity = '[[effects]]\ntype = "gravity"\ng = 9.81\n'
    head = f'name = "rolling"\ndimensions = {dimensions}\nroute = "{route}"\n'
    head += f"outputs = [{outputs}]\n"
    return head + "".join(tables) + gravity + start


def table(kind: str, **fields: Any) -> str:
    """A table of a scene; values as TOML writes them."""
    return f"[[{kind}]]\n" + "".join(f"{key} = {value}\n" for key, value in fields.items())


def joint(kind: str, child: str, **fields: Any) -> str:
    """A joint's table."""
    parent = {} if kind == "free" else {"parent": '"world"'}
    named = {"name": f'"to_{child}"', "type": f'"{kind}"', "child": f'"{child}"'}
    return table("joints", **{**named, **parent, **fields})


def constraint(kind: str, on: str, **fields: Any) -> str:
    """A constraint's table, of the name `held`."""
    return table("constraints", type=f'"{kind}"', name='"held"', body=f'"{on}"', **fields)


def upright(y: dict[str, Any], name: str) -> np.ndarray:
    """The cosine of the angle between a body's z axis and the world's."""
    return np.asarray(1 - 2 * (y[f"{name}_qx"] ** 2 + y[f"{name}_qy"] ** 2))


def vertical(y: dict[str, Any], name: str) -> np.ndarray:
    """The world's z axis in a free body's axes, (3, n)."""
    w, x, i, k = (y[f"{name}_q{part}"] for part in "wxyz")
    return np.array([2 * (x * k - w * i), 2 * (i * k + w * x), upright(y, name)])


def spin(y: dict[str, Any], name: str) -> np.ndarray:
    """The angular velocity of a free body in its axes, (3, n)."""
    return np.array([y[f"{name}_w{part}"] for part in "xyz"])


# The geometry of every kind of contact, at states that no motion has led to.

TILTED = {
    2: body("base", 2.0, 0.4) + joint("planar", "base") + body("b", 1.0, 0.1) + joint("free", "b"),
    3: body("base", 2.0, "[0.4, 0.5, 0.6]")
    + joint("free", "base")
    + body("b", 1.0, "[0.1, 0.2, 0.25]")
    + joint("free", "b"),
}
HOLDING = {
    "wheel": (2, "rolling", "at = [0.1, 0.2]; radius = 0.3; normal = [1, 3]"),
    "ellipse": (2, "rolling", "at = [0.1, 0.2]; semi_axes = [0.3, 0.2]; normal = [1, 3]"),
    "on circle": (2, "rolling", "radius = 0.3; other_at = [0.2, 0.1]; other_radius = 0.5"),
    "in circle": (2, "rolling", "radius = 0.1; other_radius = 0.9; inside = true"),
    "on line": (2, "point_on", "at = [0.1, 0.2]; line = [1, 2]; other_at = [0.3, 0]"),
    "on curve": (2, "point_on", 'at = [0.1, 0.2]; equations = ["y - x**3 + t"]'),
    "edge": (2, "knife_edge", "at = [0.1, 0.2]; across = [1, 1]"),
    "sphere": (3, "rolling", "at = [0.1, 0.2, 0.3]; radius = 0.3; normal = [1, 2, 3]"),
    "disc": (3, "rolling", "at = [0, 0.1, 0]; radius = 0.3; axis = [1, 2, 0]"),
    "round disc": (3, "rolling", "radius = 0.3; axis = [0, 0, 1]; rim = 0.1; normal = [1, 2, 3]"),
    "ellipsoid": (3, "rolling", "at = [0.1, 0, 0.1]; semi_axes = [0.3, 0.2, 0.1]"),
    "on sphere": (3, "rolling", "radius = 0.3; other_at = [0.2, 0.1, 0]; other_radius = 0.5"),
    "in sphere": (3, "rolling", "radius = 0.1; other_radius = 0.9; inside = true"),
    "in plane": (3, "point_on", "normal = [1, 2, 3]; other_at = [0.3, 0, 0]"),
    "on rail": (3, "point_on", "at = [0.1, 0, 0]; line = [1, 2, 3]"),
    "on surface": (3, "point_on", 'at = [0.1, 0, 0]; equations = ["z - x*y + sin(t)"]'),
    "blade": (3, "knife_edge", "at = [0.1, 0, 0]; across = [1, 2, 3]"),
}


@cache
def held(name: str, other: str) -> Model:
    """Two free bodies, one held to the other or to the world."""
    dimensions, kind, fields = HOLDING[name]
    lines = dict(line.split(" = ", 1) for line in fields.split("; "))
    text = scene(dimensions, TILTED[dimensions], constraint(kind, "b", other=f'"{other}"', **lines))
    return elaborate(parse_scene(text))


def anywhere(model: Model, seed: int) -> Values:
    """A random state."""
    rng = np.random.default_rng(seed)
    q, v = rng.normal(size=len(model.coordinates)), rng.normal(size=len(model.velocities))
    for indices in map(list, model.quaternions):
        q[indices] /= np.linalg.norm(q[indices])
    return Values(model.defaults, {}, q.tolist(), v.tolist(), {}, 0.3)


def moving(model: Model, at: Values) -> MechanismState:
    """The state and its rate, as dual numbers."""
    floats, duals = FloatScalars(), Duals(FloatScalars())
    rates = constraints.position_rates(MechanismState(model, at, floats))
    q = [Dual(x, dx) for x, dx in zip(at.q, rates, strict=True)]
    values = Values(
        {name: duals.still(x) for name, x in at.parameters.items()},
        {},
        q,
        [duals.still(x) for x in at.v],
        {},
        Dual(at.time, 1.0),
    )
    return MechanismState(model, values, duals)


@pytest.mark.every(2)
@pytest.mark.parametrize("other", ["world", "base"])
@pytest.mark.parametrize("name", HOLDING)
def test_the_rate_of_a_residual_is_the_power_of_its_loads(name: str, other: str) -> None:
    """With contact points that move over both bodies; and forces are equal and opposite.

    A formula's residual is f/|∇f|, whose rate has a further term where it is not 0, which is
    subtracted here: ġ + g d(|∇f|)/dt/|∇f|, taken from f alone.
    """
    model = held(name, other)
    at = anywhere(model, 5)
    d, along = MechanismState(model, at, FloatScalars()), moving(model, at)
    rates = constraints.rates(d)
    alone = [n for (n, _), r in zip(model.rows, d.rows, strict=True) if r.residual is None]
    assert list(model.velocity_rows) == alone
    for row, changing, rate in zip(d.rows, along.rows, rates, strict=True):
        if row.residual is not None and "equations" not in HOLDING[name][2]:
            assert changing.residual.value == row.residual
            assert rate == pytest.approx(changing.residual.rate, abs=1e-13)
        force = sum(np.array(load.force) for load in row.loads if load.body != "world")
        if other == "base":
            assert abs(force).max() < 1e-14
            moments = [cross(d.position(load.body, load.at), load.force) for load in row.loads]
            torque = sum(np.array(moments)) + sum(np.array(x.torque) for x in row.loads if x.torque)
            assert abs(torque).max() < 1e-14
        else:
            assert np.linalg.norm(force) == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize("name", ["on curve", "on surface"])
def test_the_rate_of_a_formula(name: str) -> None:
    """df/dt/|∇f|, by differences of the formula written in Python."""
    model = held(name, "base")
    at = anywhere(model, 6)

    def f(t: float) -> tuple[float, float]:
        step = t - at.time
        d = MechanismState(model, at, FloatScalars())
        rates = constraints.position_rates(d)
        q = [x + step * dx for x, dx in zip(at.q, rates, strict=True)]
        d = MechanismState(model, Values(at.parameters, {}, q, at.v, {}, t), FloatScalars())
        arm = [0.1, 0.2] if d.dimensions == 2 else [0.1, 0.0, 0.0]
        zeros = [0.0] * d.dimensions
        far = np.subtract(d.position("b", tuple(arm)), d.position("base", tuple(zeros)))
        axes = [d.outward("base", tuple(e)) for e in np.eye(d.dimensions).tolist()]
        x, y, *z = np.array(axes) @ far
        if not z:
            return y - x**3 + t, np.hypot(3 * x * x, 1.0)
        return z[0] - x * y + np.sin(t), np.sqrt(1 + x * x + y * y)

    value, size = f(at.time)
    d = MechanismState(model, at, FloatScalars())
    assert constraints.residuals(d) == pytest.approx([value / size], abs=1e-14)
    h = 1e-5
    slope = (f(at.time + h)[0] - f(at.time - h)[0]) / (2 * h)
    assert constraints.rates(d) == pytest.approx([slope / size], abs=1e-8)


@pytest.mark.parametrize("name", ["disc", "round disc", "ellipsoid", "sphere", "ellipse"])
def test_a_gap_is_that_of_the_lowest_point(name: str) -> None:
    """Against the least height over the plane of many points of the surface."""
    model = held(name, "base")
    d = MechanismState(model, anywhere(model, 7), FloatScalars())
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 801), np.linspace(0, np.pi, 401))
    ball = np.array([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)]).reshape(3, -1)
    centre, normal = (0.0, 0.0, 0.0), np.array([1, 2, 3]) / np.sqrt(14)
    if name == "ellipsoid":
        centre, normal = (0.1, 0.0, 0.1), np.array([0.0, 0.0, 1.0])
        surface = np.array([[0.3], [0.2], [0.1]]) * ball
    elif name == "ellipse":
        centre, normal = (0.1, 0.2), np.array([1, 3]) / np.sqrt(10)
        surface = np.array([0.3 * np.cos(u[0]), 0.2 * np.sin(u[0])])
    elif name == "sphere":
        centre, surface = (0.1, 0.2, 0.3), 0.3 * ball
    elif name == "disc":
        centre, normal = (0.0, 0.1, 0.0), np.array([0.0, 0.0, 1.0])
        one, two = np.array([2, -1, 0]) / np.sqrt(5), np.array([0.0, 0.0, 1.0])
        surface = 0.3 * (np.outer(one, np.cos(u[0])) + np.outer(two, np.sin(u[0])))
    else:
        edge = 0.2 * np.array([np.cos(u[0]), np.sin(u[0]), 0 * u[0]])
        flat = np.linspace(0, 2 * np.pi, 801)
        arc = 0.1 * np.array([np.cos(flat), np.sin(flat)])
        ring = np.array([edge[0] / 0.2, edge[1] / 0.2])
        surface = np.array(
            [
                edge[0][:, None] + ring[0][:, None] * arc[0],
                edge[1][:, None] + ring[1][:, None] * arc[0],
                0 * edge[0][:, None] + arc[1],
            ]
        ).reshape(3, -1)
    zeros = tuple([0.0] * d.dimensions)
    axes = np.array([d.outward("base", tuple(e)) for e in np.eye(d.dimensions).tolist()])
    turned = np.array([d.outward("b", tuple(e)) for e in np.eye(d.dimensions).tolist()]).T
    points = np.array(d.position("b", centre))[:, None] + turned @ surface
    heights = (normal @ axes) @ (points - np.array(d.position("base", zeros))[:, None])
    assert constraints.residuals(d)[0] == pytest.approx(heights.min(), abs=2e-5)


# The plane.


def test_a_wheel_rolls_down_a_slope() -> None:
    """a = g sin(s)/(1 + I/(m r²)); the friction m g sin(s)/(1 + m r²/I) and the normal force."""
    slope, m, r, inertia = 0.3, 2.0, 0.25, 0.04
    n = [-float(np.sin(slope)), float(np.cos(slope))]
    made = module(
        scene(
            2,
            body("wheel", m, inertia),
            joint("free", "wheel"),
            constraint("rolling", "wheel", radius=r, normal=n),
            start="[initial]\nq = { wheel_x = 0.4 }\nv = { wheel_angle_dot = -2.0 }\n",
            outputs='"constraint_forces"',
        )
    )
    y = made.initial_state()
    assert y @ [*n, 0, 0, 0, 0] == pytest.approx(r, abs=1e-14)
    assert y[3:] == pytest.approx([2 * r * n[1], -2 * r * n[0], -2.0], abs=1e-14)
    turning = -9.81 * np.sin(-slope) * m * r / (inertia + m * r * r)
    assert made.derivative(0.0, y)[5] == pytest.approx(turning, rel=1e-13)
    normal, along = made.constraint_forces(0.0, y)
    assert normal == pytest.approx(m * 9.81 * np.cos(slope), rel=1e-13)
    assert abs(along) == pytest.approx(inertia * turning / r, rel=1e-13)


def test_a_wheel_in_a_circle_swings_as_a_pendulum() -> None:
    """Of length (1 + I/(m r²)) (R - r); the angle by Jacobi's functions."""
    big, r, m = 0.9, 0.2, 1.5
    _, t, y = run(
        scene(
            2,
            body("wheel", m, m * r * r / 2),
            joint("free", "wheel"),
            constraint("rolling", "wheel", radius=r, other_radius=big, inside="true"),
            start=f"[initial]\nq = {{ wheel_x = {(big - r) * np.sin(1.0)}, "
            f"wheel_y = {-(big - r) * np.cos(1.0)} }}\n",
        ),
        3.0,
    )
    k = np.sin(0.5)
    frequency = np.sqrt(9.81 / (1.5 * (big - r)))
    sn = ellipj(ellipk(k * k) - frequency * t, k * k)[0]
    angle = 2 * np.arcsin(k * sn)
    assert np.arctan2(y["wheel_x"], -y["wheel_y"]) == pytest.approx(angle, abs=1e-9)
    assert y["wheel_angle"] == pytest.approx(-(big - r) / r * (angle - 1.0), abs=1e-9)


def test_chaplygins_sleigh() -> None:
    """v = c tanh(s), ω = c/k sech(s) with s = a c (t - t0)/k² and k² = a² + I/m."""
    a, m, inertia = 0.3, 2.0, 0.5
    k = np.sqrt(a * a + inertia / m)
    v, w = -0.8, 1.7
    c = np.hypot(v, k * w)
    text = scene(
        2,
        body("sled", m, inertia),
        joint("free", "sled"),
        constraint("knife_edge", "sled", at=[-a, 0], across=[0, 1]),
        start=f"[initial]\nv = {{ sled_x_dot = {v}, sled_y_dot = {a * w}, "
        f"sled_angle_dot = {w} }}\n",
    ).replace("g = 9.81", "g = 0.0")
    _, t, y = run(text, 6.0)
    s = np.arctanh(v / c) + a * c * t / k**2
    angle = 2 * k / a * (np.arctan(np.exp(s)) - np.arctan(np.exp(s[0])))
    forward = y["sled_x_dot"] * np.cos(angle) + y["sled_y_dot"] * np.sin(angle)
    assert y["sled_angle"] == pytest.approx(angle, abs=1e-10)
    assert y["sled_angle_dot"] == pytest.approx(c / k / np.cosh(s), abs=1e-10)
    assert forward == pytest.approx(c * np.tanh(s), abs=1e-10)


def test_a_bead_on_a_hoop_is_a_pendulum() -> None:
    """The force of the hoop too: m (v²/l + g cos)."""
    made, t, y = run(
        scene(
            2,
            body("bead", 0.7),
            joint("particle", "bead"),
            constraint("point_on", "bead", equations='["x**2 + y**2 - 0.25"]'),
            start="[initial]\nq = { bead_x = 0.4, bead_y = -0.3 }\n",
            outputs='"constraint_forces"',
        ),
        2.0,
    )
    start = np.arctan2(0.4, 0.3)
    k = np.sin(start / 2)
    sn = ellipj(ellipk(k * k) - np.sqrt(9.81 / 0.5) * t, k * k)[0]
    angle = 2 * np.arcsin(k * sn)
    assert y["bead_x"] == pytest.approx(0.5 * np.sin(angle), abs=1e-10)
    for i in (0, 13, 40):
        state = np.array([y[name][i] for name in made.STATES])
        force = -0.7 * (3 * 9.81 * np.cos(angle[i]) - 2 * 9.81 * np.cos(start))
        assert made.constraint_forces(t[i], state)[0] == pytest.approx(force, abs=1e-9)


# Space.


def test_a_ball_on_a_turntable() -> None:
    """A homogeneous ball on a table that turns at Ω goes round a circle, at 2/7 Ω."""
    omega, r, m = 1.3, 0.1, 0.4
    ball = joint("free", "ball")
    text = scene(
        3,
        body("table", 3.0, "[1, 1, 2]"),
        joint("revolute", "table", axis=[0, 0, 1], r_child=[0, 0, 0.2]),
        table(
            "effects",
            type='"driven"',
            name='"motor"',
            joint='"to_table"',
            coordinate=f'"{omega}*t"',
        ),
        body("ball", m, [0.4 * m * r * r] * 3),
        ball,
        constraint("rolling", "ball", radius=r, other='"table"', other_at=[0, 0, 0.2]),
        start="[initial]\nq = { ball_x = 0.5, ball_y = 0.1 }\n"
        "v = { ball_x_dot = 0.2, ball_y_dot = -0.1, ball_wz = 0.3 }\n",
    )
    _, t, y = run(text, 5.0)
    w = 2 / 7 * omega
    start, speed = np.array([0.5, 0.1]), np.array([0.2, -0.1])
    centre = start + np.array([-speed[1], speed[0]]) / w
    c, s = np.cos(w * t), np.sin(w * t)
    arm = start - centre
    assert y["ball_x"] == pytest.approx(centre[0] + c * arm[0] - s * arm[1], abs=1e-10)
    assert y["ball_y"] == pytest.approx(centre[1] + s * arm[0] + c * arm[1], abs=1e-10)
    assert y["ball_z"] == pytest.approx(r, abs=1e-14)


DISC = (1.3, 0.2, 1.3 * 0.04 / 4, 1.3 * 0.04 / 2)
"""Mass, radius, moments about a diameter and the axis."""


def disc(tilt: float, spin: tuple[float, float, float]) -> str:
    """A thin disc whose axis z is at an angle from the vertical, with an angular velocity."""
    m, r, diameter, axis = DISC
    wx, wy, wz = spin
    return scene(
        3,
        body("disc", m, [diameter, diameter, axis]),
        joint("free", "disc"),
        constraint("rolling", "disc", radius=r, axis=[0, 0, 1]),
        start=f"[initial]\nq = {{ disc_qw = {np.cos(tilt / 2)}, disc_qx = {np.sin(tilt / 2)}, "
        f"disc_z = {r * np.sin(tilt)} }}\n"
        f"v = {{ disc_wx = {wx}, disc_wy = {wy}, disc_wz = {wz} }}\n",
    )


@pytest.mark.parametrize(("tilt", "turning"), [(0.9, 2.0), (1.2, -6.0)])
def test_steady_rolling_of_a_disc(tilt: float, turning: float) -> None:
    """(I3 + m r²) ω3 Ω sin + m g r cos = I1 Ω² sin cos, with the tilt, the precession Ω and the
    spin ω3; the centre goes round a circle of radius r ω3/Ω. Neimark and Fufaev, II.2.
    """
    m, r, diameter, axis = DISC
    s, c = np.sin(tilt), np.cos(tilt)
    spin = (diameter * turning**2 * s * c - m * 9.81 * r * c) / ((axis + m * r * r) * turning * s)
    _, t, y = run(disc(tilt, (0.0, turning * s, spin)), 1.5)
    assert upright(y, "disc") == pytest.approx(c, abs=1e-10)
    radius = r * spin / turning
    assert y["disc_x"] == pytest.approx(-radius * np.sin(turning * t), abs=1e-9)
    assert y["disc_y"] == pytest.approx(-radius * (1 - np.cos(turning * t)), abs=1e-9)


def test_a_disc_that_falls_flat_stops() -> None:
    """Where it has no lowest point any more, at the time of the integral of its energy."""
    start = 0.9
    made = module(disc(start, (0.0, 0.0, 0.0)))
    found = integrate(as_problem(made), "DOP853", 1.0)
    assert not found.finished and "lies flat" in found.message
    m, r, diameter, _ = DISC

    def slowness(tilt: float) -> float:
        """By the energy about the fixed point of contact: (I + m r²) θ̇² / 2 = m g r Δ sin θ."""
        fallen = 2 * m * 9.81 * r * (np.sin(start) - np.sin(tilt))
        return float(np.sqrt((diameter + m * r * r) / fallen))

    time = quad(lambda s: slowness(start - s * s) * 2 * s, 0.0, np.sqrt(start))[0]
    assert found.t[-1] == pytest.approx(time, abs=1e-4)


def test_the_integrals_of_a_rolling_disc() -> None:
    """Energy, and the two linear integrals of Appell and Korteweg, with Legendre functions.

    With k = m r²/(I3 + m r²) the spin ω3 and ω2 = (ω·z - ω3 cos)/sin obey dω3/dθ = k ω2 and
    dω2/dθ = I3/I1 ω3 - cot ω2. So ω3 solves Legendre's equation of the degree ν, ν (ν + 1) =
    -k I3/I1, in x = cos θ; sin (ω3 P' - k ω2 P) is constant for P = P_ν(x) and P_ν(-x), P' = dP/dθ.
    """
    m, r, diameter, axis = DISC
    _, _, y = run(disc(1.1, (0.7, 1.5, 4.0)), 1.2)
    x, w = upright(y, "disc"), spin(y, "disc")
    s = np.sqrt(1 - x * x)
    assert np.ptp(x) > 0.2  # it nods
    upward = (w * vertical(y, "disc")).sum(axis=0)
    across = (upward - w[2] * x) / s
    k = m * r * r / (axis + m * r * r)
    a = 0.5 + 1j * np.sqrt(k * axis / diameter - 0.25)

    def legendre(x: float) -> tuple[float, float]:
        """P and dP/dx."""
        z = (1 - x) / 2
        slope = -mpmath.hyp2f1(a + 1, 2 - a, 2, z) * a * (1 - a) / 2
        return float(mpmath.re(mpmath.hyp2f1(a, 1 - a, 1, z))), float(mpmath.re(slope))

    for sign in (1.0, -1.0):
        p, slope = np.array([legendre(sign * value) for value in x]).T
        integral = s * (w[2] * (-s * sign * slope) - k * across * p)
        assert integral == pytest.approx(integral[0], abs=1e-9)
    v = np.array([y[f"disc_{part}_dot"] for part in "xyz"])
    energy = m * (v * v).sum(axis=0) / 2 + m * 9.81 * y["disc_z"]
    energy += (diameter * (w[0] ** 2 + w[1] ** 2) + axis * w[2] ** 2) / 2
    assert energy == pytest.approx(energy[0], rel=1e-10)


def test_a_tippe_top_that_rolls() -> None:
    """Energy, Jellett's integral L·r with the contact point r, and Routh's
    ω3 sqrt(I1 I3 + m R² (I1 sin² + I3 (cos - e/R)²)), with the depth e of the centre of mass.
    """
    m, big, e, one, three = 0.02, 0.025, 0.004, 4.1e-6, 5.2e-6
    text = scene(
        3,
        body("top", m, [one, one, three]),
        joint("free", "top"),
        constraint("rolling", "top", at=[0, 0, e], radius=big),
        start="[initial]\nq = { top_qw = 0.96, top_qx = 0.28 }\n"
        "v = { top_wx = 1.0, top_wy = 20.0, top_wz = 90.0 }\n",
    )
    _, _, y = run(text, 0.6)
    x, w, z = upright(y, "top"), spin(y, "top"), vertical(y, "top")
    assert np.ptp(x) > 0.1
    arm = -big * z
    arm[2] += e
    momentum = np.array([[one], [one], [three]]) * w
    jellett = (momentum * arm).sum(axis=0)
    assert jellett == pytest.approx(jellett[0], rel=1e-10)
    routh = w[2] * np.sqrt(
        one * three + m * big**2 * (one * (1 - x * x) + three * (x - e / big) ** 2)
    )
    assert routh == pytest.approx(routh[0], rel=1e-10)
    v = np.array([y[f"top_{part}_dot"] for part in "xyz"])
    energy = m * (v * v).sum(axis=0) / 2 + m * 9.81 * y["top_z"] + (momentum * w).sum(axis=0) / 2
    assert energy == pytest.approx(energy[0], rel=1e-10)


# The bicycle: see whipple.py.


@pytest.mark.parametrize("speed", some((5,), SPEEDS))
def test_every_printed_digit_of_the_bicycle(speed: int) -> None:
    """In 60 digits the linearisation is that of the paper's appendix, whose matrices are those that
    it prints, in every digit.

    Its table 2 of eigenvalues was computed in double precision, which shows in the last of its 14
    decimals: by up to 4 units, by 11 in the weave mode at 9 m/s and by 60 in the caster mode at 7.
    """
    model = assembled(elaborate(read_scene("bicycle")))
    matrix, exact = linearised(model, speed), appendix(speed)
    assert max(abs(x) for x in matrix - exact) < MP.mpf(10) ** -45
    for name, own in matrices().items():
        for i, row in enumerate(PRINTED[name]):
            for j, text in enumerate(row):
                assert abs(own[i, j] - MP.mpf(text)) <= MP.mpf("0.5e-14"), name
    found, printed = (
        sorted(eigenvalues, key=lambda x: (round(float(x.real), 6), x.imag))
        for eigenvalues in (MP.eig(matrix, left=False, right=False), TABLE[speed])
    )
    last = {7: 61e-14, 9: 11e-14, 10: 5e-14}.get(speed, 4e-14)
    assert max(abs(complex(a) - b) for a, b in zip(found, printed, strict=True)) < last


# What is wrong is said in one line.

SPHERE = "radius = 0.2\n"
WRONG = [
    ("rolling", "", "radius: give radius or semi_axes, one of them"),
    ("rolling", SPHERE + "semi_axes = [1, 1, 1]", "radius: give radius or semi_axes, one of them"),
    ("rolling", "radius = -1", "radius: -1 is not positive; give a number > 0 in m"),
    ("rolling", SPHERE + "rim = 0.1",
     "rim: rounds the edge of a disc; give its axis, or leave it out"),
    ("rolling", SPHERE + "axis = [0, 0, 1]\nrim = 0.2",
     "rim: 0.2 is not less than the radius, 0.2; give a smaller rim"),
    ("rolling", SPHERE + "axis = [0, 0, 0]", "axis: has no direction; give one that is not zero"),
    ("rolling", SPHERE + "normal = [0, 1]", "normal: has 2 components; space takes 3"),
    ("rolling", "semi_axes = [1, 1]", "semi_axes: has 2 components; give 3"),
    ("rolling", "semi_axes = [1, 1, 1]\naxis = [0, 0, 1]",
     "axis: is that of a disc, which has a radius; leave it out"),
    ("rolling", SPHERE + "inside = true", "inside: is that of a sphere; give its other_radius"),
    ("rolling", SPHERE + "other_radius = 1\nnormal = [0, 0, 1]",
     "normal: is that of a plane; give it or other_radius"),
    ("rolling", SPHERE + "other_radius = 1\naxis = [0, 0, 1]",
     "axis: on a sphere a sphere rolls, with a radius alone; leave it out"),
    ("rolling", SPHERE + "other_radius = 0.1\ninside = true",
     "radius: 0.2 is not less than other_radius, 0.1, inside which it rolls"),
    ("rolling", SPHERE + 'other = "ball"',
     "other: is also body, which holds its own points; name another body"),
    ("rolling", SPHERE + 'other = "bal"', "other: no body is named 'bal' (did you mean 'ball'?)"),
    ("knife_edge", "across = [0, 0, 0]", "across: has no direction; give one that is not zero"),
    ("knife_edge", "", "across: missing; every such table needs it"),
    ("point_on", "", "line: is missing; give one of line, normal, equations"),
    ("point_on", "line = [1, 0, 0]\nnormal = [0, 0, 1]",
     "normal: is given in addition to 'line'; give one of line, normal, equations"),
    ("point_on", 'equations = ["t"]', "equations[0]: depends on none of x, y, z; name a curve"),
    ("point_on", 'equations = ["x - ball_x"]',
     "equations[0]: 'ball_x' changes with the motion, which this value must not; use parameters"),
    ("point_on", 'equations = ["x", "y", "z"]', "equations: has 3 entries; give at most 2"),
]  # fmt: skip
FLAT = [
    ("point_on", 'equations = ["x", "y"]',
     "equations: 2 equations hold the point in the plane; give one"),
    ("point_on", 'equations = ["x - z"]',
     "equations[0]: has z, which is 0 in the plane; use x and y"),
    ("point_on", "normal = [0, 1]",
     "normal: the plane has no planes in it; give a line"),
    ("rolling", SPHERE + "axis = [0, 1]",
     "axis: in the plane a wheel turns about z; leave it out"),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "lines", "message"), [*WRONG, *FLAT])
def test_bad_input(kind: str, lines: str, message: str) -> None:
    """One clear line each."""
    dimensions = 2 if (kind, lines, message) in FLAT else 3
    inertia = 0.1 if dimensions == 2 else "[0.1, 0.1, 0.1]"
    text = scene(
        dimensions,
        body("ball", 1.0, inertia),
        joint("free", "ball"),
        constraint(kind, "ball"),
        lines + "\n",
    )
    assert refusal(text) == f"constraints[0].{message}"


# Particles and forces between all of them.


def test_three_bodies_on_a_triangle() -> None:
    """Lagrange: equal masses on an equilateral triangle of the side L turn at sqrt(3 G m/L³), with
    points alone; and springs and a law do what three springs do.
    """
    angles = 2 * np.pi * np.arange(3) / 3
    side, G, m = np.sqrt(3.0), 0.8, 1.4
    turning = np.sqrt(3 * G * m / side**3)
    names = ("a", "b", "c")
    points = [body(n, m) + joint("particle", n) for n in names]
    q = [float(f(x)) for x in angles for f in (np.cos, np.sin)]
    v = [float(turning * f) for x in angles for f in (-np.sin(x), np.cos(x))]
    text = (
        'name = "triangle"\noutputs = ["potential_energy"]\n'
        + "".join(points)
        + table("effects", type='"pairwise"', name='"all"', gravitation=G)
        + f"[initial]\nq = {q}\nv = {v}\n"
    )
    made, t, y = run(text, 5.0)
    assert y["a_x"] == pytest.approx(np.cos(turning * t), abs=1e-9)
    assert y["b_y"] == pytest.approx(np.sin(turning * t + angles[1]), abs=1e-9)
    assert made.potential_energy(0.0, made.initial_state()) == pytest.approx(-3 * G * m * m / side)

    rng = np.random.default_rng(3)
    state = rng.normal(size=12)
    own = "".join(
        table("effects", type='"spring"', name=f'"s{i}"', body_1=f'"{one}"', body_2=f'"{two}"',
              stiffness=3.0, rest_length=0.4, damping=0.2)
        for i, (one, two) in enumerate((("a", "b"), ("b", "c"), ("a", "c")))
    )  # fmt: skip
    head = text[: text.index("[[effects]]")]
    group = {"type": '"pairwise"', "name": '"all"', "bodies": '["a", "b", "c"]'}
    together = table("effects", **group, stiffness=3.0, rest_length=0.4, damping=0.2)
    law = table("effects", **group, law='"3*(distance - 0.4) + 0.2*rate"')
    expected, *others = [module(head + effects) for effects in (own, together, law)]
    for other in others:
        found = other.derivative(0.0, state)
        assert found == pytest.approx(expected.derivative(0.0, state), abs=1e-12)
    energies = [made.potential_energy(0.0, state) for made in (expected, others[0])]
    assert energies[0] == pytest.approx(energies[1])


@pytest.mark.parametrize("dimensions", [2, 3])
def test_a_particle_joint_that_closes_a_loop_keeps_an_attitude(dimensions: int) -> None:
    """A free body under a force beside its centre of mass then moves as a point."""
    inertia, force = (0.3, [1.0, 2.0]) if dimensions == 2 else ("[0.3, 0.4, 0.5]", [1.0, 2.0, 3.0])
    at = [0.3, 0.4, 0.5][:dimensions]
    push = table("effects", type='"external_force"', name='"push"', body='"b"', at=at, force=force)
    held = joint("particle", "b", loop="true").replace('"to_b"', '"level"')
    made = module(scene(dimensions, body("b", 2.0, inertia), joint("free", "b"), held, push))
    names = ["level_angle"] if dimensions == 2 else [f"level_angle_{i}" for i in (1, 2, 3)]
    assert list(made.CONSTRAINTS) == names
    rates = made.derivative(0.0, made.initial_state())[-3 * (dimensions - 1) :]
    pull = np.array(force) / 2.0 - 9.81 * np.eye(dimensions)[-1]
    assert rates == pytest.approx([*pull, *[0.0] * (1 if dimensions == 2 else 3)], abs=1e-13)


def test_a_disc_that_lies_flat_is_refused() -> None:
    """It has no lowest point."""
    flat = disc(0.0, (0.0, 0.0, 1.0))
    with pytest.raises(SceneError, match=r"^initial.q: constraint 'held' has no direction at this"):
        assembled(elaborate(parse_scene(flat)))
