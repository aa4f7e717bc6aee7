"""Equations of motion as textbooks write them, symbol by symbol: after simplification two forms of
the same expression are different here unless they have the same factors, sums and brackets.
"""

from functools import cache
from typing import Any

import pytest
import sympy as sp
from campaign import some

import eomgen
from eomgen.api.derivation import Derivation
from eomgen.derivation.simplified import simplified

FALL = 'effects = [{ type = "gravity", g = "g" }%s]'


def scene(parameters: str, bodies: str, joints: str, more: str = "", effects: str = "") -> str:
    """A scene with gravity; parameters without a value are numbers of no importance."""
    space = "inertia_com = [" in bodies or "[0, 0, 1]" in joints
    given = [name.split("=") for name in parameters.split()]
    values = ", ".join(
        f"{name} = {''.join(value) or f'{1 + i / 7:.3f}'}" for i, (name, *value) in enumerate(given)
    )
    return "\n".join(
        [
            'name = "one"',
            f"dimensions = {3 if space else 2}",
            f"parameters = {{ {values} }}",
            f"bodies = [{bodies}]",
            f"joints = [{joints}]",
            more,
            FALL % effects,
        ]
    )


def body(name: str, mass: str, inertia: str = "0") -> str:
    """A body."""
    return f'{{ name = "{name}", mass = "{mass}", inertia_com = {inertia} }},\n'


def joint(kind: str, parent: str, child: str, coordinate: str, **keys: str) -> str:
    """A joint, named after its coordinate."""
    more = "".join(f", {key} = {value}" for key, value in keys.items())
    return (
        f'{{ name = "j_{coordinate}", type = "{kind}", parent = "{parent}", child = "{child}", '
        f'coordinate = "{coordinate}"{more} }},\n'
    )


PUSH = ', { type = "motor", name = "f", joint = "j_x", torque = "input" }'
LOOP = (
    '{ name = "pin", type = "revolute", loop = true, parent = "%s", child = "%s", '
    "r_parent = %s, r_child = %s }\n"
)
TURN = ', { type = "motor", name = "tau", joint = "j_%s", torque = "input" }'
BALL = '[0, 0, "a"]'
DOWN, OUT = '[0, "l"]', '[0, 0, "l"]'
SCENES = {
    "pendulum": scene(
        "m l g", body("a", "m"), joint("revolute", "world", "a", "theta", r_child=DOWN)
    ),
    "cart-pole": scene(
        "M m l g",
        body("cart", "M") + body("a", "m"),
        joint("prismatic", "world", "cart", "x", axis="[1, 0]")
        + joint("revolute", "cart", "a", "theta", r_child=DOWN),
        effects=PUSH,
    ),
    "two-link": scene(
        "m_1 m_2 l_1 l_2 g",
        body("a", "m_1") + body("b", "m_2"),
        joint("revolute", "world", "a", "theta", r_child='[0, "l_1"]')
        + joint("revolute", "a", "b", "phi", r_child='[0, "l_2"]'),
    ),
    "furuta": scene(
        "M J m r l g",
        body("arm", "M", '["J", "J", "J"]') + body("a", "m", "[0, 0, 0]"),
        joint("revolute", "world", "arm", "phi", axis="[0, 0, 1]")
        + joint(
            "revolute", "arm", "a", "theta", axis="[1, 0, 0]", r_parent='["r", 0, 0]', r_child=OUT
        ),
    ),
    "spherical": scene(
        "m l g",
        body("turn", "0", "[0, 0, 0]") + body("a", "m", "[0, 0, 0]"),
        joint("revolute", "world", "turn", "phi", axis="[0, 0, 1]")
        + joint("revolute", "turn", "a", "theta", axis="[1, 0, 0]", r_child=OUT),
    ),
    "top": scene(
        "A C m l g",
        body("one", "0", "[0, 0, 0]")
        + body("two", "0", "[0, 0, 0]")
        + body("a", "m", '["A", "A", "C"]'),
        joint("revolute", "world", "one", "phi", axis="[0, 0, 1]")
        + joint("revolute", "one", "two", "theta", axis="[1, 0, 0]")
        + joint("revolute", "two", "a", "psi", axis="[0, 0, 1]", r_child='[0, 0, "-l"]'),
    ),
    "elastic": scene(
        "m k l g",
        body("rod", "0") + body("a", "m"),
        joint("revolute", "world", "rod", "theta")
        + joint("prismatic", "rod", "a", "r", axis="[0, -1]"),
        effects=', { type = "joint_spring", name = "s", joint = "j_r", '
        'stiffness = "k", rest = "l" }',
    ),
    "ball and beam": scene(
        "M J m g",
        body("beam", "M", '"J"') + body("a", "m"),
        joint("revolute", "world", "beam", "theta")
        + joint("prismatic", "beam", "a", "x", axis="[1, 0]"),
    ),
    "atwood": scene(
        "m_1 m_2 M R g",
        body("a", "m_1") + body("b", "m_2") + body("wheel", "M", '"M*R**2/2"'),
        joint("prismatic", "world", "a", "y", axis="[0, 1]")
        + joint("prismatic", "world", "b", "h", axis="[0, 1]")
        + joint("revolute", "world", "wheel", "theta"),
        'constraints = [{ type = "coupling", name = "rope", coordinate = "h", equals = "-y" }, '
        '{ type = "coupling", name = "grip", coordinate = "theta", equals = "y/R" }]',
    ),
    "yo-yo": scene(
        "m J r g",
        body("slide", "0") + body("a", "m", '"J"'),
        joint("prismatic", "world", "slide", "y", axis="[0, -1]")
        + joint("revolute", "slide", "a", "theta"),
        'constraints = [{ type = "coupling", name = "string", coordinate = "theta", '
        'equals = "y/r" }]',
    ),
    "rolling disc": scene(
        "m J r g alpha",
        body("slide", "0") + body("a", "m", '"J"'),
        joint("prismatic", "world", "slide", "x", axis="[1, 0]", orientation='"-alpha"')
        + joint("revolute", "slide", "a", "theta"),
        'constraints = [{ type = "coupling", name = "roll", coordinate = "theta", '
        'equals = "-x/r" }]',
    ),
    "compound pendulum": scene(
        "m J l g", body("a", "m", '"J"'), joint("revolute", "world", "a", "theta", r_child=DOWN)
    ),
    "acrobot": scene(
        "m_1 m_2 l_1 l_2 J_1 J_2 r g",
        body("a", "m_1", '"J_1"') + body("b", "m_2", '"J_2"'),
        joint("revolute", "world", "a", "theta", r_child='[0, "l_1"]')
        + joint("revolute", "a", "b", "phi", r_parent='[0, "l_1 - r"]', r_child='[0, "l_2"]'),
    ),
    "hoop": scene(
        "J M m R g",
        body("ring", "M", '["J", "J", "J"]') + body("a", "m", "[0, 0, 0]"),
        joint("revolute", "world", "ring", "phi", axis="[0, 0, 1]")
        + joint("revolute", "ring", "a", "theta", axis="[1, 0, 0]", r_child='[0, 0, "R"]'),
    ),
    "reaction wheel": scene(
        "m M J l g",
        body("a", "m") + body("wheel", "M", '"J"'),
        joint("revolute", "world", "a", "theta", r_child=DOWN)
        + joint("revolute", "a", "wheel", "phi"),
    ),
    "oscillator": scene(
        "m k c g",
        body("a", "m"),
        joint("prismatic", "world", "a", "x", axis="[1, 0]"),
        effects=', { type = "joint_spring", name = "s", joint = "j_x", stiffness = "k", '
        'damping = "c" }',
    ),
    "wedge": scene(
        "M m alpha g",
        body("wedge", "M") + body("a", "m"),
        joint("prismatic", "world", "wedge", "x", axis="[1, 0]")
        + joint("prismatic", "wedge", "a", "r", axis="[1, 0]", orientation='"-alpha"'),
    ),
    "crane": scene(
        "M m g",
        body("cart", "M") + body("rope", "0") + body("a", "m"),
        joint("prismatic", "world", "cart", "x", axis="[1, 0]")
        + joint("revolute", "cart", "rope", "theta")
        + joint("prismatic", "rope", "a", "r", axis="[0, -1]"),
    ),
    "rotors": scene(
        "J_1 J_2 k g",
        body("a", "1", '"J_1"') + body("b", "1", '"J_2"'),
        joint("revolute", "world", "a", "theta") + joint("revolute", "world", "b", "phi"),
    ),
    "scotch yoke": scene(
        "J m r g",
        body("crank", "1", '"J"') + body("a", "m"),
        joint("revolute", "world", "crank", "theta")
        + joint("prismatic", "world", "a", "x", axis="[1, 0]"),
        'constraints = [{ type = "coupling", name = "slot", coordinate = "x", '
        'equals = "r*cos(theta)" }]',
    ),
    "parabola": scene(
        "m k g",
        body("slide", "0") + body("a", "m"),
        joint("prismatic", "world", "slide", "x", axis="[1, 0]")
        + joint("prismatic", "slide", "a", "y", axis="[0, 1]"),
        'constraints = [{ type = "coupling", name = "wire", coordinate = "y", '
        'equals = "k*x**2/2" }]',
    ),
    "cart and rod": scene(
        "M m J l g",
        body("cart", "M") + body("a", "m", '"J"'),
        joint("prismatic", "world", "cart", "x", axis="[1, 0]")
        + joint("revolute", "cart", "a", "theta", r_child=DOWN),
    ),
    "cylindrical": scene(
        "M J m g",
        body("post", "M", '["J", "J", "J"]')
        + body("lift", "0", "[0, 0, 0]")
        + body("a", "m", "[0, 0, 0]"),
        joint("revolute", "world", "post", "theta", axis="[0, 0, 1]")
        + joint("prismatic", "post", "lift", "y", axis="[0, 0, 1]")
        + joint("prismatic", "lift", "a", "r", axis="[1, 0, 0]"),
    ),
    "free body": scene(
        "m J g",
        body("slide", "0") + body("lift", "0") + body("a", "m", '"J"'),
        joint("prismatic", "world", "slide", "x", axis="[1, 0]")
        + joint("prismatic", "slide", "lift", "y", axis="[0, 1]")
        + joint("revolute", "lift", "a", "theta"),
    ),
    "polar": scene(
        "m g",
        body("arm", "0") + body("a", "m"),
        joint("revolute", "world", "arm", "theta")
        + joint("prismatic", "arm", "a", "r", axis="[1, 0]"),
    ),
}
# Mechanisms with loops, and with a motion that is given.
SCENES |= {
    "kapitza": scene(
        "m l A nu g",
        body("pivot", "0") + body("a", "m"),
        joint("prismatic", "world", "pivot", "y", axis="[0, 1]")
        + joint("revolute", "pivot", "a", "theta", r_child=DOWN),
        effects=', { type = "driven", name = "shaker", joint = "j_y", coordinate = "A*cos(nu*t)" }',
    ),
    "governor": scene(
        "J M m a g",
        body("spindle", "1", '["J", "J", "J"]')
        + body("left", "m", "[0, 0, 0]")
        + body("right", "m", "[0, 0, 0]")
        + body("sleeve", "M", "[0, 0, 0]"),
        joint("revolute", "world", "spindle", "phi", axis="[0, 0, 1]")
        + joint("revolute", "spindle", "left", "theta", axis="[1, 0, 0]", r_child=BALL)
        + joint("revolute", "spindle", "right", "psi", axis="[1, 0, 0]", r_child=BALL)
        + joint("prismatic", "spindle", "sleeve", "y", axis="[0, 0, -1]"),
        'constraints = [{ type = "coupling", name = "arms", coordinate = "psi", '
        'equals = "-theta" }, { type = "coupling", name = "rods", coordinate = "y", '
        'equals = "2*a*cos(theta)" }]',
    ),
    "slider-crank": scene(
        "J m J_r m_r r=0.1 l=0.3 g",
        body("crank", "1", '"J"') + body("piston", "m") + body("rod", "m_r", '"J_r"'),
        joint("revolute", "world", "crank", "theta")
        + joint("prismatic", "world", "piston", "x", axis="[1, 0]")
        + joint("revolute", "piston", "rod", "beta")
        + LOOP % ("crank", "rod", '["r", 0]', '["l", 0]'),
        "initial = { q = { theta = 0.6 }, guess = { x = 0.4, beta = 3 } }",
        TURN % "theta",
    ),
    "four-bar": scene(
        "J_2 J_3 J_4 m a=0.1 b=0.3 c=0.25 d=0.3 g",
        body("crank", "1", '"J_2"') + body("rocker", "1", '"J_4"') + body("coupler", "m", '"J_3"'),
        joint("revolute", "world", "crank", "theta")
        + joint("revolute", "world", "rocker", "psi", r_parent='["d", 0]')
        + joint("revolute", "crank", "coupler", "phi", r_parent='["a", 0]')
        + LOOP % ("coupler", "rocker", '["b", 0]', '["c", 0]'),
        "initial = { q = { theta = 0.6 }, guess = { psi = 1.5 } }",
        TURN % "theta",
    ),
}
S = {
    name: sp.Symbol(name)
    for name in "m M J A C l r k g f x R l_1 l_2 m_1 m_2 alpha c J_1 J_2 nu a b d "
    "J_3 J_4 J_r m_r tau K_x kappa_x kappa_beta K_psi K_phi kappa_psi kappa_phi".split()
}
Q = {name: sp.Symbol(name) for name in ("theta", "phi", "psi", "beta", "x", "y", "r")}
D = {name: sp.Symbol(f"{name}_dot") for name in Q}
m, M, J, A, C, l, r, k, g, f, x, R = (S[n] for n in "m M J A C l r k g f x R".split())  # noqa: E741
l_1, l_2, m_1, m_2, alpha = (S[n] for n in ("l_1", "l_2", "m_1", "m_2", "alpha"))
c, J_1, J_2 = (S[n] for n in ("c", "J_1", "J_2"))
a, b, d, tau, J_3, J_4, J_r, m_r = (S[n] for n in "a b d tau J_3 J_4 J_r m_r".split())
K_x, K_psi, K_phi = (S[n] for n in ("K_x", "K_psi", "K_phi"))
kappa_x, kappa_beta = S["kappa_x"], S["kappa_beta"]
kappa_psi, kappa_phi = S["kappa_psi"], S["kappa_phi"]
theta, phi, psi, beta = (Q[n] for n in ("theta", "phi", "psi", "beta"))
w, u, v = D["theta"], D["phi"], D["x"]
sin, cos = sp.sin, sp.cos
FORMS: dict[tuple[str, str], Any] = {
    ("pendulum", "M"): [[l**2 * m]],
    ("pendulum", "theta_ddot"): -g * sin(theta) / l,
    ("cart-pole", "M"): [[M + m, m * l * cos(theta)], [m * l * cos(theta), m * l**2]],
    ("cart-pole", "V"): [-m * l * w**2 * sin(theta), 0],
    ("cart-pole", "G"): [0, m * g * l * sin(theta)],
    ("cart-pole", "x_ddot"): (f + m * l * w**2 * sin(theta) + m * g * sin(theta) * cos(theta))
    / (M + m * sin(theta) ** 2),
    ("two-link", "M"): [
        [
            (m_1 + m_2) * l_1**2 + m_2 * l_2**2 + 2 * m_2 * l_1 * l_2 * cos(phi),
            m_2 * l_2 * (l_2 + l_1 * cos(phi)),
        ],
        [m_2 * l_2 * (l_2 + l_1 * cos(phi)), m_2 * l_2**2],
    ],
    ("two-link", "V"): [
        -m_2 * l_1 * l_2 * u * (2 * w + u) * sin(phi),
        m_2 * l_1 * l_2 * w**2 * sin(phi),
    ],
    ("two-link", "G"): [
        (m_1 + m_2) * g * l_1 * sin(theta) + m_2 * g * l_2 * sin(theta + phi),
        m_2 * g * l_2 * sin(theta + phi),
    ],
    ("furuta", "M"): [
        [J + m * r**2 + m * l**2 * sin(theta) ** 2, m * l * r * cos(theta)],
        [m * l * r * cos(theta), m * l**2],
    ],
    ("furuta", "V"): [
        m * l * w * (2 * l * u * cos(theta) - r * w) * sin(theta),
        -m * l**2 * u**2 * sin(theta) * cos(theta),
    ],
    ("spherical", "M"): [[m * l**2 * sin(theta) ** 2, 0], [0, m * l**2]],
    ("spherical", "theta_ddot"): u**2 * sin(theta) * cos(theta) - g * sin(theta) / l,
    ("top", "M"): [
        [C * cos(theta) ** 2 + (A + m * l**2) * sin(theta) ** 2, 0, C * cos(theta)],
        [0, A + m * l**2, 0],
        [C * cos(theta), 0, C],
    ],
    ("top", "G"): [0, -m * g * l * sin(theta), 0],
    ("elastic", "M"): [[m * r**2, 0], [0, m]],
    ("elastic", "V"): [2 * m * r * w * D["r"], -m * r * w**2],
    ("ball and beam", "M"): [[J + m * x**2, 0], [0, m]],
    ("ball and beam", "x_ddot"): x * w**2 - g * sin(theta),
    ("atwood", "y_ddot"): g * (m_2 - m_1) / (m_1 + m_2 + M / 2),
    ("yo-yo", "y_ddot"): m * g * r**2 / (J + m * r**2),
    ("rolling disc", "x_ddot"): m * g * r**2 * sin(alpha) / (J + m * r**2),
    ("compound pendulum", "theta_ddot"): -m * g * l * sin(theta) / (J + m * l**2),
    ("acrobot", "M"): [
        [
            J_1 + J_2 + m_1 * l_1**2 + m_2 * r**2 + m_2 * l_2**2 + 2 * m_2 * r * l_2 * cos(phi),
            J_2 + m_2 * l_2**2 + m_2 * r * l_2 * cos(phi),
        ],
        [J_2 + m_2 * l_2**2 + m_2 * r * l_2 * cos(phi), J_2 + m_2 * l_2**2],
    ],
    ("acrobot", "V"): [
        -m_2 * r * l_2 * u * (2 * w + u) * sin(phi),
        m_2 * r * l_2 * w**2 * sin(phi),
    ],
    ("acrobot", "G"): [
        g * (m_1 * l_1 + m_2 * r) * sin(theta) + m_2 * g * l_2 * sin(theta + phi),
        m_2 * g * l_2 * sin(theta + phi),
    ],
    ("hoop", "M"): [[J + m * R**2 * sin(theta) ** 2, 0], [0, m * R**2]],
    ("hoop", "theta_ddot"): u**2 * sin(theta) * cos(theta) - g * sin(theta) / R,
    ("reaction wheel", "M"): [[J + (m + M) * l**2, J], [J, J]],
    ("reaction wheel", "G"): [(m + M) * g * l * sin(theta), 0],
    ("reaction wheel", "theta_ddot"): -g * sin(theta) / l,
    ("oscillator", "tau_s"): -k * x - c * v,
    ("wedge", "M"): [[M + m, m * cos(alpha)], [m * cos(alpha), m]],
    ("wedge", "x_ddot"): -m * g * sin(alpha) * cos(alpha) / (M + m * sin(alpha) ** 2),
    ("wedge", "r_ddot"): (M + m) * g * sin(alpha) / (M + m * sin(alpha) ** 2),
    ("crane", "M"): [
        [M + m, m * Q["r"] * cos(theta), m * sin(theta)],
        [m * Q["r"] * cos(theta), m * Q["r"] ** 2, 0],
        [m * sin(theta), 0, m],
    ],
    ("crane", "G"): [0, m * g * Q["r"] * sin(theta), -m * g * cos(theta)],
    ("rotors", "M"): [[J_1, 0], [0, J_2]],
    ("scotch yoke", "M"): [[J + m * r**2 * sin(theta) ** 2]],
    ("scotch yoke", "V"): [m * r**2 * w**2 * sin(theta) * cos(theta)],
    ("parabola", "x_ddot"): -k * x * (g + k * v**2) / (1 + k**2 * x**2),
    ("cart and rod", "M"): [[M + m, m * l * cos(theta)], [m * l * cos(theta), J + m * l**2]],
    ("cart and rod", "V"): [-m * l * w**2 * sin(theta), 0],
    ("polar", "theta_ddot"): -g * cos(theta) / r - 2 * D["r"] * w / r,
    ("polar", "r_ddot"): r * w**2 - g * sin(theta),
    ("cylindrical", "M"): [[J + m * r**2, 0, 0], [0, m, 0], [0, 0, m]],
    ("cylindrical", "V"): [2 * m * r * D["r"] * w, 0, -m * r * w**2],
    ("cylindrical", "G"): [0, m * g, 0],
    # Landau and Lifshitz, Mechanics, section 30: a pendulum whose point of support oscillates.
    ("kapitza", "theta_ddot"): -((g + sp.Symbol("y_ddot")) * sin(theta) / l),
    ("kapitza", "V"): [m * l * sp.Symbol("y_ddot") * sin(theta)],
    # Landau and Lifshitz, Mechanics, section 5, problem 4: two balls m and a sleeve M on arms and
    # rods a; the spindle J is left free.
    ("governor", "M"): [
        [J + 2 * m * a**2 * sin(theta) ** 2, 0],
        [0, 2 * a**2 * (m + 2 * M * sin(theta) ** 2)],
    ],
    ("governor", "V"): [
        2 * m * a**2 * u * w * sin(2 * theta),
        a**2 * (2 * M * w**2 - m * u**2) * sin(2 * theta),
    ],
    ("governor", "G"): [0, 2 * g * a * sin(theta) * (m + M)],
    # Norton, Design of Machinery, sections 6.7 and 11.4 (velocity ratios; the kinetic energy of
    # the links by that of the crank): β is the angle of the rod from the piston.
    ("slider-crank", "K_x"): r * sin(beta - theta) / cos(beta),
    ("slider-crank", "beta_dot"): r * w * cos(theta) / (l * cos(beta)),
    ("slider-crank", "M"): [
        [J + (m + m_r) * K_x**2 + J_r * r**2 * cos(theta) ** 2 / (l**2 * cos(beta) ** 2)]
    ],
    ("slider-crank", "V"): [
        (m + m_r) * K_x * kappa_x + J_r * kappa_beta * r * cos(theta) / (l * cos(beta))
    ],
    # The same; θ₃ = θ + φ and θ₄ = ψ in Norton's letters, (6.18).
    ("four-bar", "K_psi"): a * sin(phi) / (c * sin(theta + phi - psi)),
    ("four-bar", "K_phi"): a * sin(psi - theta) / (b * sin(theta + phi - psi)) - 1,
    ("four-bar", "M"): [[J_2 + m * a**2 + J_3 * (1 + K_phi) ** 2 + J_4 * K_psi**2]],
    ("four-bar", "V"): [J_3 * (1 + K_phi) * kappa_phi + J_4 * K_psi * kappa_psi],
    ("four-bar", "F_r"): tau,
    ("free body", "M"): [[m, 0, 0], [0, m, 0], [0, 0, J]],
    ("free body", "G"): [0, m * g, 0],
}


@cache
def derived(name: str) -> Derivation:
    """The derivation of a mechanism."""
    return eomgen.derive(SCENES[name])


def plain(e: Any) -> Any:
    """An expression over symbols without assumptions."""
    return e.xreplace({s: sp.Symbol(s.name) for s in e.free_symbols})


@pytest.mark.parametrize(
    "name", some(("pendulum", "two-link", "atwood", "kapitza", "slider-crank"), tuple(SCENES))
)
def test_textbook_forms(name: str) -> None:
    """M, V, G and accelerations have the factors, sums and brackets of the textbook."""
    found = derived(name)
    steps = [line for step in found.steps for line in step.equations]
    for (other, what), want in FORMS.items():
        if other != name:
            continue
        if what in ("M", "V", "G"):
            ours = plain(getattr(found, what))
            assert ours == sp.Matrix(want), (what, ours)
            continue
        word = what.replace("_ddot", "`ddot").replace("_dot", "`dot")
        lines = [x.right for x in steps if getattr(x.left, "name", "") == word]
        read = {sp.Symbol(f"{n}`dot"): s for n, s in D.items()}
        read |= {sp.Symbol(f"{n}`ddot"): sp.Symbol(f"{n}_ddot") for n in D}
        shown = [plain(e).xreplace(read) for e in lines]
        assert want in shown, (what, shown)


def test_forms_that_are_short_already_stay() -> None:
    """What a person would not change is not changed."""
    a, b, c = sp.symbols("a b c")
    for e in (a + b, a * (b + c), sin(a + b), a / (b + c), a**2 + b**2 - 2 * a * b * cos(c)):
        assert simplified(e) == e


@pytest.mark.parametrize("name", some(("slider-crank",), ("slider-crank", "four-bar")))
def test_velocity_forces_are_half_the_rate_of_the_inertia(name: str) -> None:
    """J(θ) θ̈ + ½ J'(θ) θ̇² = τ (Eksergian): V of one freedom from its M alone."""
    found = derived(name)
    (inertia,), (force,) = (plain(found.written_out(e)) for e in (found.M, found.V))
    rates = {theta: w, w: sp.S.Zero}
    speed = sp.Symbol("theta_dot")
    inertia, force = inertia.xreplace({speed: w}), force.xreplace({speed: w})
    numbers = {sp.Symbol(p.name): p.default for p in found.model.parameters}
    for angle in (0.4, 1.1):
        at = {**numbers, theta: angle, w: 2.0}
        want = sum(sp.diff(inertia, x) * rates[x] for x in rates) * w / 2
        assert abs((force - want).subs(at).evalf()) < 1e-12
