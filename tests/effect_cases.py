"""Scenes with one effect each, every type and every key of it, in the plane and in space.

An effect's name is `marker`, and so everything that it brings has a name of its own. `<x y z>` in
its table stands for a vector of as many components as there are dimensions.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass

from campaign import some

TWO = """\
name = "mechanism"
{{outputs}}
[[bodies]]
name = "a"
mass = 1.1
inertia_com = {a}
[[bodies]]
name = "b"
mass = 0.7
inertia_com = {b}
[[joints]]
name = "flight"
type = "free"
child = "a"
[[joints]]
name = "hinge"
type = "revolute"
parent = "a"
child = "b"
{hinge}
coordinate = "q"
"""
THREE = f"""{TWO}[[bodies]]
name = "c"
mass = 0.4
inertia_com = {{c}}
[[joints]]
name = "rail"
type = "prismatic"
parent = "b"
child = "c"
axis = [0.6, 0.8{{z}}]
r_parent = [0.2, -0.1{{up}}]
coordinate = "s"
[[points]]
name = "tip"
body = "c"
at = [0.1, 0.2{{down}}]
"""
PINS = TWO.format(a=0.31, b=0.12, hinge="r_parent = [0.3, 0]\nr_child = [-0.2, 0]")
PLANE = THREE.format(
    a=0.31,
    b=0.12,
    c=0.05,
    hinge="r_parent = [0.3, 0.1]\nr_child = [-0.2, 0.05]",
    **dict.fromkeys(("z", "up", "down"), ""),
)
SPACE = THREE.replace("{{outputs}}", "dimensions = 3\n{{outputs}}").format(
    a=[0.31, 0.22, 0.27, 0.01, 0.02, -0.01],
    b=[0.12, 0.13, 0.14],
    c=[0.05, 0.06, 0.07],
    hinge="axis = [0.0, 0.6, 0.8]\nr_parent = [0.3, 0.1, 0.2]\nr_child = [-0.2, 0.05, 0.1]",
    z=", 0.0",
    up=", 0.1",
    down=", -0.1",
)
BASES = {"plane": PLANE, "space": SPACE, "pins": PINS}
"""`pins` is for the closed form."""


@dataclass(frozen=True)
class Case:
    """A scene with one effect, and the same scene that never had it.

    `conserves` sets parameters such that the effect stores what it takes, and gives it back: then
    its power is that of its potential energy. None: it has no potential energy at all.
    """

    name: str
    base: str
    table: str
    conserves: Mapping[str, float] | None

    def without(self, outputs: str = "") -> str:
        """The scene that never had it."""
        return BASES[self.base].format(outputs=outputs)

    def text(self, outputs: str = "") -> str:
        """The scene with the effect, written before everything else in it."""
        first, bodies, rest = self.without(outputs).partition("[[bodies]]")
        return f"{first}[[effects]]\n{self.table}\n{bodies}{rest}"


def _table(kind: str, base: str, body: str) -> str:
    count = 3 if base == "space" else 2

    def vector(found: re.Match[str]) -> str:
        return f"[{', '.join(found[1].split()[:count])}]"

    lines = body.replace("; ", "\n")
    return f'type = "{kind}"\nname = "marker"\n' + re.sub(r"<([^<>]+)>", vector, lines)


NO_ENERGY = None
CONSERVES: Mapping[str, float] = {}


def damped(*fields: str) -> Mapping[str, float]:
    """The effect loses nothing once these of its fields are 0."""
    return dict.fromkeys((f"marker_{field}" for field in fields), 0.0)


SPRING = 'body_1 = "world"; body_2 = "c"; at_1 = <0.2 0.3 0.1>; at_2 = <0.1 0 0.2>; '
FIELD = "center = <0.3 -0.2 0.1>; strength = 2.0; power = {}; softening = 0.4; "
GROUND = 'bodies = ["a", "b", "c"]; stiffness = 300.0; offset = 0.4; '
LOSSES = "friction = 0.4; slip_speed = 0.1; "
SHAPES = (
    'rod = { body = "a", at = <0.1 0 0>, end = <-0.3 0.2 0.1>, radius = 0.4 }, '
    'crate = { body = "b", half_sizes = <0.2 0.3 0.1>, radius = 0.5 }'
)
SERVO = 'joint = "hinge"; target = "0.3*sin(t)"; target_rate = "0.3*cos(t)"; '
GAINS = "stiffness = 8.0; damping = 1.3; "
EVERYWHERE: list[tuple[str, str, str, Mapping[str, float] | None]] = [
    ("gravity", "down", "g = 9.81", CONSERVES),
    ("gravity", "aslant", "g = 9.81; direction = <1.0 -2.0 3.0>", CONSERVES),
    ("gravity", "on some", 'g = 9.81; except_bodies = ["b"]', CONSERVES),
    ("point_gravity", "all", "mu = 4.0; at = <2.0 1.5 -1.0>", CONSERVES),
    ("point_gravity", "some", 'mu = 4.0; at = <2.0 1.5 1.0>; except_bodies = ["a"]', CONSERVES),
    ("pairwise", "gravitation", "gravitation = 3.0", CONSERVES),
    ("pairwise", "softened", 'bodies = ["a", "c"]; gravitation = 3.0; softening = 0.2', CONSERVES),
    ("pairwise", "springs", 'bodies = "all"; stiffness = 9.0; rest_length = 0.2; damping = 0.3',
     damped("damping")),
    ("pairwise", "law", 'law = "2/distance**3 + 0.1*rate"', NO_ENERGY),
    ("drag", "linear", 'body = "c"; linear = 0.7', NO_ENERGY),
    ("drag", "quadratic", 'bodies = ["a", "c"]; quadratic = 0.3; at = <0.1 0.1 0.2>', NO_ENERGY),
    ("drag", "equation", 'bodies = "all"; density = 1.2; area = 0.3; coefficient = 1.1', NO_ENERGY),
    ("drag", "wind", 'points = ["tip"]; linear = 0.4; wind = <"sin(t)" "0.2*x" 0.1>', NO_ENERGY),
    ("drag", "turning", 'body = "b"; turning_linear = 0.2; turning_quadratic = 0.1', NO_ENERGY),
    ("drag", "active", 'body = "b"; linear = -0.2; allow_active = true', NO_ENERGY),
    ("field", "formula",
     'body = "b"; kind = "formula"; force = <"-x*vx" "y*exp(-t*t)" "tanh(vz)">', NO_ENERGY),
    ("field", "attract", f'bodies = "all"; kind = "attract"; {FIELD.format(2)}', CONSERVES),
    ("field", "attract log", f'body = "a"; kind = "attract"; {FIELD.format(1)}', CONSERVES),
    ("field", "repel", f'body = "c"; kind = "repel"; at = <0 0.1 0>; {FIELD.format(3)}', CONSERVES),
    ("field", "vortex", f'points = ["tip"]; kind = "vortex"; {FIELD.format(2)}', NO_ENERGY),
    ("field", "avoid",
     'body = "a"; kind = "avoid"; center = <2 1 1>; steering = 3.0; radius = 0.5; reach = 4.0',
     NO_ENERGY),
    ("spring", "plain", SPRING + "stiffness = 30.0", CONSERVES),
    ("spring", "damped", SPRING + "stiffness = 30.0; damping = 2.0; rest_length = 0.3",
     damped("damping")),
    ("spring", "rope",
     SPRING + "stiffness = 30.0; damping = 2.0; rest_length = 0.3; tension_only = true",
     damped("damping")),
    ("spring", "law", SPRING + 'law = "40*stretch**3 + 0.3*rate"; rest_length = 0.2', NO_ENERGY),
    ("spring", "active", SPRING + "stiffness = -3.0; allow_active = true", CONSERVES),
    ("joint_spring", "damped", 'joint = "hinge"; stiffness = 12.0; damping = 0.4; rest = 0.2',
     damped("damping")),
    ("joint_spring", "several", 'joints = ["hinge", "rail"]; stiffness = 12.0', CONSERVES),
    ("joint_spring", "all", 'joints = "all"; stiffness = 12.0', CONSERVES),
    ("joint_spring", "one", 'joint = "hinge"; coordinate = "q"; stiffness = 12.0', CONSERVES),
    ("joint_spring", "law", 'joint = "rail"; law = "9*stretch + 40*stretch**3"', NO_ENERGY),
    ("joint_spring", "active", 'joint = "rail"; damping = -0.1; allow_active = true', NO_ENERGY),
    ("joint_friction", "viscous", 'joint = "rail"; viscous = 0.3', NO_ENERGY),
    ("joint_friction", "several", 'joints = ["hinge", "rail"]; viscous = 0.3', NO_ENERGY),
    ("joint_friction", "all", 'joints = "all"; viscous = 0.3', NO_ENERGY),
    ("joint_friction", "one", 'joint = "rail"; coordinate = "s"; viscous = 0.3', NO_ENERGY),
    ("joint_friction", "coulomb", 'joint = "hinge"; coulomb = 0.3; speed = 0.2', NO_ENERGY),
    ("joint_friction", "active", 'joint = "hinge"; viscous = -0.3; allow_active = true', NO_ENERGY),
    ("joint_stop", "both",
     'joint = "hinge"; low = -0.3; high = 0.2; stiffness = 60.0; damping = 3.0', damped("damping")),
    ("joint_stop", "several", 'joints = ["hinge", "rail"]; high = 0.1; stiffness = 60', CONSERVES),
    ("joint_stop", "all", 'joints = "all"; low = -0.1; stiffness = 60.0', CONSERVES),
    ("joint_stop", "one",
     'joint = "hinge"; coordinate = "q"; low = -0.1; high = 0.1; stiffness = 6', CONSERVES),
    ("joint_stop", "high", 'joint = "rail"; high = -0.2; stiffness = 60.0', CONSERVES),
    ("joint_stop", "active",
     'joint = "rail"; low = 0.1; stiffness = 60.0; damping = -0.1; allow_active = true',
     damped("damping")),
    ("joint_stop", "rigid", 'joint = "rail"; low = -0.2; restitution = 0.5', NO_ENERGY),
    ("tether", "ring",
     'length = 9.0; restitution = 0.4; through = [{ body = "world", at = <0 3 0> }, '
     '{ body = "a" }, { body = "b" }]',
     NO_ENERGY),
    ("contact", "spring and damper",
     f'law = "spring_damper"; against = "plane"; radius = 0.1; damping = 4.0; {GROUND}{LOSSES}',
     damped("damping", "friction")),
    ("contact", "Hunt and Crossley",
     f'law = "hunt_crossley"; radius = 0.1; radii = {{ b = 0.2 }}; dissipation = 0.3; '
     f"normal = <0.2 1 0.3>; {GROUND}{LOSSES}", damped("dissipation", "friction")),
    ("contact", "points",
     'law = "spring_damper"; points = ["tip"]; radius = 0.1; stiffness = 300.0; offset = 0.4',
     CONSERVES),
    ("contact", "corners",
     f'law = "spring_damper"; corners = <0.2 0.1 0.15>; at = <0.1 0 0>; {GROUND}', CONSERVES),
    ("contact", "ball",
     'law = "hunt_crossley"; against = "ball"; body = "c"; radius = 0.9; other = "a"; '
     "other_radius = 0.8; other_at = <0.1 0.1 0>; stiffness = 90.0", CONSERVES),
    ("contact", "each other",
     'law = "spring_damper"; against = "each_other"; bodies = "all"; radius = 0.7; '
     "stiffness = -40.0; allow_active = true", CONSERVES),
    ("contact", "shapes",
     f'law = "spring_damper"; offset = 0.4; stiffness = 300.0; {LOSSES}shapes = {{ {SHAPES}, '
     'egg = { body = "c", semi_axes = <0.3 0.2 0.4> }, '
     'hull = { body = "b", vertices = [<0.3 0.1 0>, <-0.2 0.3 0.1>, <0 -0.2 0.2>] } }',
     damped("friction")),
    ("contact", "shapes and shapes",
     f'law = "spring_damper"; against = "each_other"; stiffness = 90.0; shapes = {{ {SHAPES}, '
     'ball = { body = "c", radius = 0.9 } }; except_pairs = [["b", "c"]]', CONSERVES),
    ("contact", "some shapes and shapes",
     f'law = "spring_damper"; against = "each_other"; stiffness = 90.0; shapes = {{ {SHAPES}, '
     'ball = { body = "c", radius = 0.9 } }; pairs = [["rod", "ball"]]', CONSERVES),
    ("contact", "heights",
     f'law = "spring_damper"; against = "heights"; height = "0.4 + 0.3*sin(2*x)"; stiffness = 90; '
     f'{LOSSES}shapes = {{ {SHAPES} }}', damped("friction")),
    ("contact", "impact", 'law = "impact"; bodies = "all"; restitution = 0.5', NO_ENERGY),
    ("external_force", "constant", 'body = "b"; force = <1 2 3>; at = <0.1 0 0.2>', NO_ENERGY),
    ("external_force", "formula", 'body = "b"; axes = "body"; force = <"sin(3*t)" "q_dot*s" 0>',
     NO_ENERGY),
    ("external_force", "input", 'body = "c"; axes = "world"; force = "input"; at = <0 0.1 0>',
     NO_ENERGY),
    ("motor", "constant", 'joint = "hinge"; torque = 0.7', NO_ENERGY),
    ("motor", "one", 'joint = "hinge"; coordinate = "q"; torque = 0.7', NO_ENERGY),
    ("motor", "formula", 'joint = "rail"; torque = "atan2(q, 2) - min(s, t)"', NO_ENERGY),
    ("motor", "input", 'joint = "hinge"; torque = "input"', NO_ENERGY),
    ("pd", "plain", SERVO + GAINS, NO_ENERGY),
    ("pd", "one", SERVO + GAINS + 'coordinate = "q"', NO_ENERGY),
    ("pd", "limited", SERVO + GAINS + "limit = 0.8", NO_ENERGY),
    ("pd", "lags", SERVO + GAINS + "limit = 0.8; lag = 0.1", NO_ENERGY),
    ("pd", "active", SERVO + "stiffness = -1.0; damping = -0.1; allow_active = true", NO_ENERGY),
    ("pid", "plain", SERVO + GAINS + "integral_gain = 5.0", NO_ENERGY),
    ("pid", "one", SERVO + GAINS + 'integral_gain = 5.0; coordinate = "q"', NO_ENERGY),
    ("pid", "limited", SERVO + GAINS + "integral_gain = 5.0; limit = 1.0; lag = 0.1", NO_ENERGY),
    ("pid", "tracks", SERVO + GAINS + "integral_gain = 5.0; limit = 1.0; tracking = 0.3",
     NO_ENERGY),
    ("pid", "active",
     SERVO + "stiffness = 2.0; damping = -0.1; integral_gain = 5.0; allow_active = true",
     NO_ENERGY),
    ("controller", "states",
     'states = { marker_z = { initial = 0.3, rate = "q - 2*marker_z", unit = "rad", '
     'about = "marker" } }; torques = { hinge = "-3*marker_z", rail = "-s - log(1 + t*t)" }',
     NO_ENERGY),
    ("controller", "no state", 'torques = { hinge = "acos(tanh(q)) + asin(tanh(s))" }', NO_ENERGY),
    ("sampled_controller", "sensors",
     'period = 0.1; sensors = { marker_s = { value = "q", noise = 0.1, quantum = 0.01 } }; '
     'states = { marker_z = { next = "marker_z + marker_s" } }; delay = 0.25; seed = 3; '
     'inputs = {}; torques = { hinge = "-3*marker_s - marker_z", rail = "-s" }', NO_ENERGY),
    ("driven", "hinge", 'joint = "hinge"; coordinate = "0.3 - 0.3*cos(5*t)"', NO_ENERGY),
    ("driven", "rail", 'joint = "rail"; coordinate = "0.4*t*t*abs(t)"', NO_ENERGY),
]  # fmt: skip
TORQUES: dict[str, list[tuple[str, str]]] = {
    "plane": [("constant", "torque = 0.6"), ("formula", 'torque = "sqrt(1 + q**2)"')],
    "space": [
        ("constant", 'axes = "world"; torque = [0.1, 0.2, 0.3]'),
        ("formula", 'axes = "body"; torque = ["tan(0.1*q)", "max(t, 0)", 0]'),
    ],
}
CLOSED = (("gravity", "down"), ("external_force", "constant"), ("external_force", "input"))
CLOSED += (("motor", "constant"), ("motor", "input"))
"""What the closed form takes."""


def _cases() -> list[Case]:
    found = []

    def add(base: str, kind: str, label: str, body: str, conserves: Mapping[str, float] | None):
        name = f"{kind} {label}, {base}"
        found.append(Case(name, base, _table(kind, base, body), conserves))

    for kind, label, body, conserves in EVERYWHERE:
        add("plane", kind, label, body, conserves)
        add("space", kind, label, body, conserves)
        if (kind, label) in CLOSED:
            add("pins", kind, label, body.replace('"c"', '"b"'), conserves)
    for base, torques in TORQUES.items():
        for label, body in [*torques, ("input", 'torque = "input"')]:
            add(base, "external_torque", label, f'body = "b"; {body}', NO_ENERGY)
    return found


def _part() -> list[Case]:
    """The first case of each effect in the plane and in space; of the others a fifth in each."""
    met: dict[tuple[str, str], int] = {}
    found = []
    for case in CASES:
        label, base = case.name.rsplit(", ", 1)
        kind = label.split()[0]
        turn = met[kind, base] = met.get((kind, base), -1) + 1
        if base == "pins" or turn == 0 or turn % 5 == (1 if base == "plane" else 3):
            found.append(case)
    return found


CASES = _cases()
TRIED = some(_part(), CASES)
