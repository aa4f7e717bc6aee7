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
}
S = {name: sp.Symbol(name) for name in "m M J A C l r k g f x R l_1 l_2 m_1 m_2 alpha".split()}
Q = {name: sp.Symbol(name) for name in ("theta", "phi", "psi", "x", "y", "r")}
D = {name: sp.Symbol(f"{name}_dot") for name in Q}
m, M, J, A, C, l, r, k, g, f, x, R = (S[n] for n in "m M J A C l r k g f x R".split())  # noqa: E741
l_1, l_2, m_1, m_2, alpha = (S[n] for n in ("l_1", "l_2", "m_1", "m_2", "alpha"))
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
        word = what.removesuffix("_ddot")
        lines = [x.right for x in steps if x.left.is_Symbol and x.left.name == f"{word}`ddot"]
        read = {sp.Symbol(f"{n}`dot"): s for n, s in D.items()}
        shown = [plain(e).xreplace(read) for e in lines]
        assert want in shown, (what, shown)


def test_forms_that_are_short_already_stay() -> None:
    """What a person would not change is not changed."""
    a, b, c = sp.symbols("a b c")
    for e in (a + b, a * (b + c), sin(a + b), a / (b + c), a**2 + b**2 - 2 * a * b * cos(c)):
        assert simplified(e) == e
