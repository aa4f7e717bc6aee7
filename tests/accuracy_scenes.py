# ruff: noqa: E501
"""Scenes that are not built in, for `--accuracy` to be held against the truth.

Each is the text of a scene. The ends of those in `CLOSED` are known in closed form, to 50 digits;
the others' come from `eomgen.study.accuracy.reference`, in 113 bits.
"""

from collections.abc import Callable
from typing import Any

from mpmath import mp, mpf

from eomgen.dynamics.start.assembly import assembled
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.native.accelerator import Accelerator
from eomgen.run.module import GeneratedModule, load_module
from eomgen.run.problem import Problem
from eomgen.scene.reader import parse_scene, read_scene
from eomgen.scene.schema import Simulation
from eomgen.store import generated_code
from eomgen.study.accuracy.localised import under_scrutiny
from eomgen.study.accuracy.moved import moved_problem
from eomgen.study.accuracy.trial import Case
from eomgen.study.diagnosis import problem_of

DIGITS = 50


def _tumbling(inertia: str, spin: str, t_end: float, effects: str = "") -> str:
    return f"""
dimensions = 3
bodies = [{{ name = "nut", mass = 1, inertia_com = {inertia} }}]
joints = [{{ name = "fly", type = "free", child = "nut" }}]
effects = [{effects}]
initial = {{ v = [0, 0, 0, {spin}] }}
simulation = {{ t_end = {t_end} }}
"""


def _stiff_slide(stiffness: float, damping: float) -> str:
    """A bob on a spring along a swinging rod: 1e9 N/m swing at 4.5e4 rad/s."""
    return f"""
parameters = {{ k = {stiffness}, c = {damping} }}
bodies = [
  {{ name = "rod", mass = 1.5, inertia_com = 0.12 }},
  {{ name = "bob", mass = 0.4, inertia_com = 0 }},
]
effects = [
  {{ type = "gravity", g = 9.81 }},
  {{ type = "joint_spring", name = "s", joint = "slide", stiffness = "k", damping = "c", rest = 0.25 }},
]
initial = {{ q = [1.1, 0.25] }}
simulation = {{ t_end = 4 }}
[[joints]]
name = "pivot"
type = "revolute"
parent = "world"
child = "rod"
r_child = [-0.35, 0]
[[joints]]
name = "slide"
type = "prismatic"
parent = "rod"
child = "bob"
r_parent = [0.3, 0]
axis = [1, 0]
"""


def _kepler(eccentricity: float, periods: int) -> str:
    """A planet from its farthest point on, μ = 1, a = 1."""
    far, speed = 1 + eccentricity, ((1 - eccentricity) / (1 + eccentricity)) ** 0.5
    return f"""
bodies = [{{ name = "planet", mass = 1, inertia_com = 1 }}]
joints = [{{ name = "orbit", type = "free", child = "planet" }}]
effects = [{{ type = "point_gravity", name = "sun", mu = 1.0 }}]
initial = {{ q = {{ planet_x = {far!r} }}, v = {{ planet_y_dot = {speed!r} }} }}
simulation = {{ t_end = {6.283185307179586 * periods!r} }}
"""


def _link(effects: str, q: float = 1.2, t_end: float = 6, joint: str = "") -> str:
    """A rod on a pin, and what acts on it."""
    return f"""
bodies = [{{ name = "rod", mass = 1.3, inertia_com = 0.05 }}]
joints = [
  {{ name = "pin", type = "revolute", parent = "world", child = "rod", r_child = [-0.3, 0]{joint} }},
]
effects = [{{ type = "gravity", g = 9.81 }}, {effects}]
initial = {{ q = [{q}] }}
simulation = {{ t_end = {t_end} }}
"""


def _ball(contacts: str, initial: str, t_end: float) -> str:
    """A ball of radius 0.1 m in the plane."""
    return f"""
bodies = [{{ name = "ball", mass = 0.5, inertia_com = 0.002 }}]
joints = [{{ name = "flight", type = "free", child = "ball" }}]
effects = [{{ type = "gravity", g = 9.81 }}, {contacts}]
initial = {{ {initial} }}
simulation = {{ t_end = {t_end} }}
"""


def _wall(name: str, more: str, law: str = "impact") -> str:
    return f'{{ type = "contact", name = "{name}", law = "{law}", body = "ball", radius = 0.1, {more} }}'


BOXED = ", ".join(
    [
        _wall("floor", "restitution = 0.9"),
        _wall("left", "normal = [1, 0], offset = -1.0, restitution = 0.8"),
        _wall("right", "normal = [-1, 0], offset = -1.0, restitution = 0.8"),
    ]
)

SCENES: dict[str, str] = {
    # Rotation about the middle axis, which any rounding turns over.
    "separatrix_1": _tumbling("[1.0, 2.0, 3.0]", "0.001, 3.0, 0.0005", 30),
    "separatrix_2": _tumbling("[1.0, 2.0, 3.0]", "0.0001, 5.0, 0.0001", 30),
    "separatrix_3": _tumbling("[0.7, 1.1, 1.6]", "2e-5, 4.0, -3e-5", 25),
    "nearly_symmetric": _tumbling("[2.0, 2.0001, 3.1]", "0.5, 0.4, 2.0", 20),
    "tumbling_in_oil": _tumbling(
        "[0.3, 0.5, 0.7]",
        "0.001, 6.0, 0.001",
        12,
        '{ type = "drag", name = "oil", body = "nut", turning_linear = 0.01 }',
    ),
    # Stiff springs.
    "slide_1e6": _stiff_slide(1e6, 2e3),
    "slide_1e7": _stiff_slide(1e7, 1e3),
    "slide_1e8": _stiff_slide(1e8, 2e4),
    "slide_1e9": _stiff_slide(1e9, 1e3),
    "stiff_hinges": """
chains = [{ name = "link", count = 3, mass = 0.3, inertia_com = 0.003, r_parent = [0.2, 0], r_child = [-0.2, 0] }]
effects = [
  { type = "gravity", g = 9.81 },
  { type = "joint_spring", name = "weld_2", joint = "link_joint_2", stiffness = 1e6, damping = 300 },
  { type = "joint_spring", name = "weld_3", joint = "link_joint_3", stiffness = 1e5, damping = 100 },
]
simulation = { t_end = 3 }
""",
    "undamped_1e6": """
bodies = [{ name = "a", mass = 1, inertia_com = 0 }, { name = "b", mass = 0.01, inertia_com = 0 }]
joints = [
  { name = "rail", type = "prismatic", parent = "world", child = "a", axis = [1, 0] },
  { name = "spring", type = "prismatic", parent = "a", child = "b", axis = [1, 0] },
]
effects = [
  { type = "joint_spring", name = "soft", joint = "rail", stiffness = 50 },
  { type = "joint_spring", name = "hard", joint = "spring", stiffness = 1e6 },
]
initial = { q = [0.2, 0.001] }
simulation = { t_end = 0.3 }
""",
    "stiff_servo": _link(
        '{ type = "pd", name = "servo", joint = "pin", target = "0.8*sin(2*t)",'
        ' target_rate = "1.6*cos(2*t)", stiffness = 1e6, damping = 3e3 }',
        q=0.0,
    ),
    "stiff_motor_lag": _link(
        '{ type = "pd", name = "servo", joint = "pin", target = "0.5*sin(3*t)", stiffness = 400,'
        " damping = 30, lag = 1e-5 }",
        q=0.0,
    ),
    # Orbits.
    "orbit_half": _kepler(0.5, 20),
    "orbit_nine": _kepler(0.9, 50),
    "orbit_99": _kepler(0.99, 30),
    "orbit_99_long": _kepler(0.99, 1000),
    "rosette": """
bodies = [{ name = "p", mass = 1, inertia_com = 1 }]
joints = [{ name = "path", type = "free", child = "p" }]
effects = [{ type = "field", name = "pull", body = "p", kind = "attract", strength = 2, power = 1, softening = 0.05 }]
initial = { q = { p_x = 1.5 }, v = { p_y_dot = 0.1 } }
simulation = { t_end = 20 }
""",
    # Rigid contacts: closed forms below.
    "bouncing": _ball(
        _wall("floor", "restitution = 0.8"), "q = [0, 1.1, 0], v = [0.7, 0.3, 2]", 2.5
    ),
    "slope": _ball(
        _wall("hill", "normal = [-0.28, 0.96], restitution = 0.7"),
        "q = [0, 0.9, 0], v = [0.5, 0, -1]",
        1.7,
    ),
    "boxed": _ball(BOXED, "q = [0.1, 0.8, 0], v = [4.3, 1, 0]", 2.0),
    "sliding": _ball(
        _wall("hill", "normal = [-0.6, 0.8], restitution = 0.0"),
        "q = [-0.06, 0.08, 0], v = [0, 0, 0]",
        1.5,
    ),
    "landing": _ball(
        _wall("floor", "restitution = 0.0"), "q = [0, 0.7, 0], v = [1.5, 0.2, 3]", 2.0
    ),
    # Soft contacts and stops.
    "soft_bounce": _ball(
        _wall("floor", "stiffness = 2e4, damping = 5", "spring_damper"),
        "q = [0, 0.6, 0], v = [0.4, 0, 0]",
        2.0,
    ),
    "rubber_bounce": _ball(
        _wall(
            "floor",
            "stiffness = 3e5, dissipation = 0.2, friction = 0.3, slip_speed = 0.05",
            "hunt_crossley",
        ),
        "q = [0, 0.4, 0], v = [1.5, 0, -4]",
        1.5,
    ),
    "soft_stop": _link(
        '{ type = "joint_stop", name = "stop", joint = "pin", low = -1.0, stiffness = 2000, damping = 4 }',
        q=0.7,
        t_end=3,
    ),
    # Controllers.
    "pd_lag": _link(
        '{ type = "pd", name = "c", joint = "pin", target = "-0.6", stiffness = 20, damping = 2, lag = 0.05 }'
    ),
    "pid": _link(
        '{ type = "pid", name = "c", joint = "pin", target = "0.4", stiffness = 30, damping = 3, integral_gain = 12 }'
    ),
    "pd_limited": _link(
        '{ type = "pd", name = "c", joint = "pin", target = "0.9*sin(1.5*t)", stiffness = 60, damping = 4, limit = 5.0 }'
    ),
    "own_controller": _link(
        '{ type = "controller", name = "c", states = { z = { initial = 0.0, rate = "5*(sin(2*t) - z) - pin_angle" } },'
        ' torques = { pin = "4*z - 0.5*pin_angle_dot" } }'
    ),
    # Drives.
    "kapitza": """
bodies = [{ name = "base", mass = 1, inertia_com = 0 }, { name = "rod", mass = 1, inertia_com = 0.02 }]
joints = [
  { name = "lift", type = "prismatic", parent = "world", child = "base", axis = [0, 1] },
  { name = "pin", type = "revolute", parent = "base", child = "rod", r_child = [-0.25, 0] },
]
effects = [
  { type = "gravity", g = 9.81 },
  { type = "driven", name = "shaker", joint = "lift", coordinate = "0.02*cos(200*t)" },
]
initial = { q = { pin_angle = 1.4 } }
simulation = { t_end = 3 }
""",
    "crank": """
bodies = [{ name = "crank", mass = 1, inertia_com = 0.01 }, { name = "rod", mass = 0.4, inertia_com = 0.004 }]
joints = [
  { name = "shaft", type = "revolute", parent = "world", child = "crank", r_child = [-0.1, 0] },
  { name = "pin", type = "revolute", parent = "crank", child = "rod", r_parent = [0.1, 0], r_child = [-0.2, 0] },
]
effects = [
  { type = "gravity", g = 9.81 },
  { type = "driven", name = "engine", joint = "shaft", coordinate = "3*t + 0.2*sin(5*t)" },
]
simulation = { t_end = 4 }
""",
    # Drag, friction, fields.
    "thrown": """
definitions = { gust = "3*(1 + sin(5*t))" }
bodies = [{ name = "ball", mass = 0.2, inertia_com = 2e-4 }]
joints = [{ name = "flight", type = "free", child = "ball" }]
effects = [
  { type = "gravity", g = 9.81 },
  { type = "drag", name = "air", body = "ball", quadratic = 0.01, wind = ["gust", 0] },
]
initial = { q = { ball_y = 1.0 }, v = { ball_x_dot = -8.0, ball_y_dot = 12.0 } }
simulation = { t_end = 3 }
""",
    "sticky_cart": """
bodies = [{ name = "cart", mass = 1, inertia_com = 0 }, { name = "pole", mass = 0.3, inertia_com = 0.01 }]
joints = [
  { name = "rail", type = "prismatic", parent = "world", child = "cart", axis = [1, 0] },
  { name = "pin", type = "revolute", parent = "cart", child = "pole", r_child = [0, 0.4] },
]
effects = [
  { type = "gravity", g = 9.81 },
  { type = "joint_friction", name = "grip", joint = "rail", coulomb = 1.5, speed = 0.01, viscous = 0.1 },
]
initial = { q = { pin_angle = 1.3 } }
simulation = { t_end = 4 }
""",
    "magnetic": """
dimensions = 3
bodies = [{ name = "ion", mass = 1, inertia_com = [1, 1, 1] }]
joints = [{ name = "path", type = "free", child = "ion" }]
initial = { v = [1.0, 0.2, 0.3, 0.1, 0.2, 0.3] }
simulation = { t_end = 15 }
[[effects]]
type = "field"
name = "b"
body = "ion"
force = ["vy*(3 + 0.5*x)", "-vx*(3 + 0.5*x)", "0.2*sin(2*t) - 0.1*z"]
""",
    # Chains, balls, springs.
    "six_links": """
chains = [{ name = "link", count = 6, mass = 0.4, inertia_com = 0.002, r_parent = [0.1, 0], r_child = [-0.1, 0] }]
effects = [{ type = "gravity", g = 9.81 }]
simulation = { t_end = 1.5 }
""",
    "damped_rope": """
chains = [{ name = "link", count = 12, mass = 0.05, inertia_com = 2e-5, r_parent = [0.05, 0], r_child = [-0.05, 0] }]
effects = [
  { type = "gravity", g = 9.81 },
  { type = "joint_friction", name = "fibre", joints = "all", viscous = 0.002 },
]
simulation = { t_end = 2 }
""",
    "ball_chain": """
dimensions = 3
bodies = [
  { name = "a", mass = 1, inertia_com = [0.02, 0.03, 0.04] },
  { name = "b", mass = 0.5, inertia_com = [0.01, 0.02, 0.015] },
]
joints = [
  { name = "j1", type = "ball", parent = "world", child = "a", r_child = [0, 0, 0.4] },
  { name = "j2", type = "ball", parent = "a", child = "b", r_parent = [0, 0, -0.4], r_child = [0.1, 0, 0.3] },
]
effects = [{ type = "gravity", g = 9.81 }, { type = "joint_spring", name = "limp", joint = "j2", stiffness = 0.5, damping = 0.02 }]
initial = { v = [2.0, 0.5, 3.0, 0, 1, 0] }
simulation = { t_end = 3 }
""",
    "universal_arm": """
dimensions = 3
bodies = [
  { name = "a", mass = 1, inertia_com = [0.02, 0.02, 0.01] },
  { name = "b", mass = 0.6, inertia_com = [0.01, 0.012, 0.008] },
]
joints = [
  { name = "u", type = "universal", parent = "world", child = "a", r_child = [0, 0, 0.3] },
  { name = "c", type = "cylindrical", parent = "a", child = "b", r_parent = [0, 0, -0.3], axis = [1, 0, 0] },
]
effects = [
  { type = "gravity", g = 9.81 },
  { type = "joint_spring", name = "s", joint = "c", coordinate = "c_slide", stiffness = 40, damping = 0.5 },
]
initial = { q = { u_angle_1 = 0.7 }, v = { u_angle_2_dot = 2.0, c_angle_dot = 5.0 } }
simulation = { t_end = 3 }
""",
    "elastic_pendulum": """
bodies = [{ name = "bob", mass = 1, inertia_com = 0.01 }]
joints = [{ name = "path", type = "free", child = "bob" }]
effects = [
  { type = "gravity", g = 9.81 },
  { type = "spring", name = "s", body_1 = "world", body_2 = "bob", stiffness = 40, rest_length = 0.8, damping = 0.1 },
]
initial = { q = { bob_x = 1.2 } }
simulation = { t_end = 8 }
""",
    "slack_rope": """
bodies = [{ name = "bob", mass = 1, inertia_com = 0.01 }]
joints = [{ name = "path", type = "free", child = "bob" }]
effects = [
  { type = "gravity", g = 9.81 },
  { type = "spring", name = "s", body_1 = "world", body_2 = "bob", stiffness = 500, rest_length = 1.0, damping = 2, tension_only = true },
]
initial = { q = { bob_x = 0.5, bob_y = 0.2 } }
simulation = { t_end = 3 }
""",
    "duffing": _link(
        '{ type = "joint_spring", name = "s", joint = "pin", law = "20*stretch**3 - 5*stretch", damping = 0.3 },'
        ' { type = "motor", name = "m", joint = "pin", torque = "3*cos(4*t)" }',
        t_end=8,
    ),
}

G = mpf(9.81)


def _kepler_end(eccentricity: float, periods: int) -> list[mpf]:
    """x, y, 0 and rates, of the orbit that begins at exactly the scene's doubles."""
    far, speed = 1 + eccentricity, ((1 - eccentricity) / (1 + eccentricity)) ** 0.5
    x, v = mpf(far), mpf(speed)
    a = 1 / (2 / x - v * v)
    e = x / a - 1
    n = a ** mpf(-1.5)
    mean = mp.pi + n * mpf(6.283185307179586 * periods)
    mean -= 2 * mp.pi * mp.floor(mean / (2 * mp.pi))
    anomaly = mp.findroot(lambda E: E - e * mp.sin(E) - mean, mp.pi)
    b, rate = a * mp.sqrt(1 - e * e), n / (1 - e * mp.cos(anomaly))
    return [
        -a * (mp.cos(anomaly) - e),
        -b * mp.sin(anomaly),
        mpf(0),
        a * mp.sin(anomaly) * rate,
        -b * mp.cos(anomaly) * rate,
        mpf(0),
    ]


def _bounced(
    q: list[float], v: list[float], t_end: float, walls: list[tuple[list[float], float, float]]
) -> list[mpf]:
    """A ball's end among walls (normal, offset, restitution), which strike without friction; those
    it does not leave again it slides along.
    """
    p, u = [mpf(c) for c in q[:2]], [mpf(c) for c in v[:2]]
    left, held = mpf(t_end), None
    planes = []
    for normal, offset, bounce in walls:
        length = mp.sqrt(sum(mpf(c) ** 2 for c in normal))
        planes.append(([mpf(c) / length for c in normal], mpf(offset) + mpf(0.1), mpf(bounce)))
    a = [mpf(0), -G]
    while True:
        strikes = []
        for k, (n, offset, _) in enumerate(planes):
            gap = n[0] * p[0] + n[1] * p[1] - offset
            rate, pull = n[0] * u[0] + n[1] * u[1], n[0] * a[0] + n[1] * a[1]
            if k == held:
                continue
            # gap + rate s + pull s²/2 = 0
            for s in (
                mp.polyroots([pull / 2, rate, gap], maxsteps=200, extraprec=200)
                if pull
                else ([-gap / rate] if rate else [])
            ):
                if abs(mp.im(s)) < mpf(10) ** -30 < mp.re(s):
                    strikes.append((mp.re(s), k))  # noqa: PERF401
        s, k = min(strikes, default=(mp.inf, -1))
        step = min(s, left)
        p = [x + w * step + c * step**2 / 2 for x, w, c in zip(p, u, a, strict=True)]
        u = [w + c * step for w, c in zip(u, a, strict=True)]
        left -= step
        if left == 0:
            return [*p, mpf(q[2]) + mpf(v[2]) * mpf(t_end), *u, mpf(v[2])]
        n, _, bounce = planes[k]
        rate = n[0] * u[0] + n[1] * u[1]
        u = [w - (1 + bounce) * rate * c for w, c in zip(u, n, strict=True)]
        if bounce == 0:
            held = k
            pull = n[0] * a[0] + n[1] * a[1]
            a = [c - pull * d for c, d in zip(a, n, strict=True)]


def _slid() -> list[mpf]:
    """From rest down a slope of 3 in 5, held from the start: ½ g sin t² along it."""
    n = [mpf(-0.6), mpf(0.8)]
    length = mp.sqrt(n[0] ** 2 + n[1] ** 2)
    n = [c / length for c in n]
    a = [mpf(0) + G * n[1] * n[0], -G + G * n[1] * n[1]]
    t = mpf(1.5)
    return [
        mpf(-0.06) + a[0] * t**2 / 2,
        mpf(0.08) + a[1] * t**2 / 2,
        mpf(0),
        a[0] * t,
        a[1] * t,
        mpf(0),
    ]


CLOSED: dict[str, Callable[[], list[mpf]]] = {
    "orbit_half": lambda: _kepler_end(0.5, 20),
    "orbit_nine": lambda: _kepler_end(0.9, 50),
    "orbit_99": lambda: _kepler_end(0.99, 30),
    "orbit_99_long": lambda: _kepler_end(0.99, 1000),
    "bouncing": lambda: _bounced([0, 1.1, 0], [0.7, 0.3, 2], 2.5, [([0, 1], 0, 0.8)]),
    "slope": lambda: _bounced([0, 0.9, 0], [0.5, 0, -1], 1.7, [([-0.28, 0.96], 0, 0.7)]),
    "boxed": lambda: _bounced([0.1, 0.8, 0], [4.3, 1, 0], 2.0, [([0, 1], 0, 0.9), ([1, 0], -1.0,
     0.8), ([-1, 0], -1.0, 0.8)]),
    "sliding": _slid,
    "landing": lambda: _bounced([0, 0.7, 0], [1.5, 0.2, 3], 2.0, [([0, 1], 0, 0.0)]),
}  # fmt: skip


def text(name: str) -> str:
    """A scene's text."""
    return f'name = "{name}"\n{SCENES[name]}'


def closed_end(name: str) -> list[mpf] | None:
    """The state at the end in closed form, in the scene's own order of states; None if there is
    none.
    """
    if name not in CLOSED:
        return None
    with mp.workdps(DIGITS):
        return CLOSED[name]()


def made(scene: str) -> tuple[Model, GeneratedModule, Simulation]:
    """Model and module of a scene of `SCENES`, of one that is built in, or of a scene's text, and
    how it is to be run.
    """
    own = scene if "\n" in scene else text(scene) if scene in SCENES else None
    tables = read_scene(scene) if own is None else parse_scene(own)
    model = assembled(elaborate(tables))
    return model, load_module(generated_code(model).module, model.name), tables.simulation


def case_of(scene: str, t_end: float | None = None, *, compiled: bool = False, **kept: Any) -> Case:
    """A scene's run, as `simulate --accuracy` makes it; in compiled code from the start on if
    `compiled`, else in Python.
    """
    model, module, wanted = made(scene)
    place: Callable[..., Problem] = lambda problem, *_: problem  # noqa: E731
    if compiled:
        accelerator = Accelerator(model, module, None, None)
        accelerator.compile()
        place = accelerator.of
    problem = place(problem_of(module, model=model))
    moved = moved_problem(module, model, start=problem.initial, compiled=place)
    kept = {"samples": 1001, "rest_speed": wanted.rest_speed, **kept}
    problem = under_scrutiny(problem, model, module)
    return Case(problem, t_end or wanted.t_end, module.UNITS, kept, moved=moved)
