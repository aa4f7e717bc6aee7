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
    """A scene with gravity; parameters are numbers of no importance."""
    space = "inertia_com = [" in bodies or "[0, 0, 1]" in joints
    values = ", ".join(f"{name} = {1 + i / 7:.3f}" for i, name in enumerate(parameters.split()))
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
S = {
    name: sp.Symbol(name)
    for name in "m M J A C l r k g f x R l_1 l_2 m_1 m_2 alpha c J_1 J_2".split()
}
Q = {name: sp.Symbol(name) for name in ("theta", "phi", "psi", "x", "y", "r")}
D = {name: sp.Symbol(f"{name}_dot") for name in Q}
m, M, J, A, C, l, r, k, g, f, x, R = (S[n] for n in "m M J A C l r k g f x R".split())  # noqa: E741
l_1, l_2, m_1, m_2, alpha = (S[n] for n in ("l_1", "l_2", "m_1", "m_2", "alpha"))
c, J_1, J_2 = (S[n] for n in ("c", "J_1", "J_2"))
theta, phi = Q["theta"], Q["phi"]
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
    "name", some(("pendulum", "cart-pole", "two-link", "atwood"), tuple(SCENES))
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
        word = what.replace("_ddot", "`ddot")
        lines = [x.right for x in steps if x.left.is_Symbol and x.left.name == word]
        read = {sp.Symbol(f"{n}`dot"): s for n, s in D.items()}
        shown = [plain(e).xreplace(read) for e in lines]
        assert want in shown, (what, shown)


def test_forms_that_are_short_already_stay() -> None:
    """What a person would not change is not changed."""
    a, b, c = sp.symbols("a b c")
    for e in (a + b, a * (b + c), sin(a + b), a / (b + c), a**2 + b**2 - 2 * a * b * cos(c)):
        assert simplified(e) == e
