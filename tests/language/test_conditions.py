"""Conditions on parameters: what a scene is refused for, --set and a module's p are refused for."""

import re
from pathlib import Path

import numpy as np
import pytest
from campaign import some
from engine import quick

from eomgen.base.errors import RunError, SceneError
from eomgen.commands.main import main
from eomgen.language.conditions import of_inertia
from eomgen.language.formula import Constant
from eomgen.model.elaborate import elaborate
from eomgen.run.module import as_problem
from eomgen.scene.reader import parse_scene

PLANE = """
name = "held"
parameters = {{ {values} }}
bodies = [
    {{ name = "rod", mass = "m", inertia_com = "I" }},
    {{ name = "bob", mass = "m_bob", inertia_com = "I_bob" }},
]
joints = [
    {{ name = "hinge", type = "revolute", parent = "world", child = "rod", r_child = ["-a", 0], motor_inertia = "J" }},
    {{ name = "wrist", type = "revolute", parent = "rod", child = "bob", r_parent = ["a", 0], r_child = ["-a/b", 0] }},
]
effects = [
    {{ type = "joint_spring", name = "k", joint = "hinge", stiffness = "k", damping = "d" }},
    {{ type = "joint_stop", name = "stop", joint = "hinge", low = "low", high = "high", \
stiffness = "k", damping = "d" }},
    {{ type = "spring", name = "band", body_1 = "rod", body_2 = "world", stiffness = "k", \
rest_length = "s" }},
    {{ type = "pid", name = "holds", joint = "wrist", target = 0, stiffness = "k + 1", \
damping = "d", integral_gain = "i", limit = "2*most" }},
]
"""  # noqa: E501
HELD = {
    "m": 1.0, "I": 0.1, "m_bob": 0.0, "I_bob": 0.0, "a": 0.5, "b": 2.0, "J": 0.01, "k": 3.0,
    "d": 0.1, "low": -1.0, "high": 1.0, "s": 0.2, "i": 1.0, "most": 5.0,
}  # fmt: skip
SPACE = """
name = "thrown"
dimensions = 3
parameters = {{ {values} }}
bodies = [
    {{ name = "nut", mass = "m", inertia_com = ["A", "B", "C"] }},
    {{ name = "bolt", mass = "m", inertia_com = ["A", "B", "C", "D", "E", "F"] }},
]
joints = [
    {{ name = "flight", type = "free", child = "nut" }},
    {{ name = "other", type = "free", child = "bolt" }},
]
effects = [
    {{ type = "contact", name = "ground", body = "nut", law = "impact", against = "ball", \
radius = "r", other_radius = "R", restitution = "e", friction = "f", slip_speed = "s" }},
]
"""
THROWN = {
    "m": 1.0, "A": 2.0, "B": 2.5, "C": 3.0, "D": 0.1, "E": 0.2, "F": -0.1, "r": 0.0, "R": 0.5,
    "e": 0.5, "f": 0.3, "s": 0.01,
}  # fmt: skip
TRIED = (-1e101, -3.0, -0.5, 0.0, 0.3, 1.5, 100.0, 1e60, 1e101)


def written_out(text: str, values: dict[str, float]) -> str:
    """A scene with these values of its parameters."""
    return text.format(values=", ".join(f"{name} = {value}" for name, value in values.items()))


@pytest.mark.parametrize(("text", "values"), [(PLANE, HELD), (SPACE, THROWN)])
def test_scene_and_module_refuse_alike(text: str, values: dict[str, float]) -> None:
    """Each parameter in turn, and two at once: what no scene may hold, no p may, in one line that
    has the scene's words in it; and what a scene may hold runs.
    """
    module = quick(written_out(text, values)).module
    rng = np.random.default_rng(17)
    names = list(values)
    cases = [{name: value} for name in names for value in TRIED]
    cases += [
        dict(zip(rng.choice(names, 2), rng.choice(TRIED, 2), strict=True)) for _ in range(150)
    ]
    refused = 0
    for case in cases:
        case = {str(name): float(value) for name, value in case.items()}
        try:
            elaborate(parse_scene(written_out(text, values | case)))
            words = ""
        except SceneError as error:
            words = str(error).splitlines()[0]
        try:
            module.initial_state(case)
            said = ""
        except ValueError as error:
            said = str(error)
        # Of masses and of what it divides by, the module asks more: that they are above zero.
        own = "the mass matrix is singular" in said or "is not positive: change the" in said
        own = own or "too large or too small for floats" in said
        assert bool(said) == bool(words) or own, (case, said, words)
        assert "\n" not in said
        refused += bool(words)
    assert 100 < refused < len(cases) - 20


def test_set_is_refused_as_the_scene_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A body that nothing could be made of does not tumble."""
    for command in ("simulate", "accuracy", "linearise"):
        rest = ["-o", str(tmp_path / "out")] if command == "simulate" else []
        assert main([command, "tumbling_body", "--set", "I_1=100", *rest]) == 1
        err = capsys.readouterr().err
        assert err.count("\n") == 1, err
        assert "body 'nut' has principal moments 100, 0.000333333, 0.000458333; no body" in err
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_a_run_with_parameters_is_refused() -> None:
    """The way of studies and batches, too."""
    module = quick(written_out(PLANE, HELD)).module
    with pytest.raises(RunError, match=r"^parameters high, low: effects\[1\].low: 2 is not below"):
        as_problem(module, {"low": 2.0})


def test_inertias_by_minors_and_by_moments() -> None:
    """The condition on inertias holds exactly where that on principal moments does: in any pose,
    at any scale, and for rods and laminas, which are on the edge of it.
    """
    rng = np.random.default_rng(3)
    for _ in range(some(400, 30_000)):
        moments = rng.uniform(-0.1, 1.0, 3) ** rng.integers(1, 4)
        match rng.integers(4):
            case 0:
                moments = np.array([0.0, moments[1], moments[1]])
            case 1:
                moments[0] = moments[1] + moments[2]
            case 2:
                moments[2] = moments[0] + moments[1] * (1 + 10.0 ** rng.uniform(-8, 0))
        q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        matrix = (q * moments) @ q.T * 10.0 ** rng.uniform(-60, 60)
        entries = [
            matrix[0, 0],
            matrix[1, 1],
            matrix[2, 2],
            matrix[0, 1],
            matrix[0, 2],
            matrix[1, 2],
        ]
        a, b, c = sorted(moments)
        size = float(abs(moments).max())
        slack = min(a, a + b - c) / size
        if -1e-8 < slack < -1e-10:
            continue  # as far off as numbers that were rounded may be
        given = [Constant(x) for x in entries]
        conditions = of_inertia("bodies[0].inertia_com", "b", Constant(1.0), given, {})
        found = any(condition.problem({}) for condition in conditions)
        assert found == (slack < 0 and slack <= -1e-8), (moments, slack)


def spun(inertia: str, more: str = "") -> str:
    """A free body in space with an inertia."""
    body = f'{{ name = "nut", mass = 1.0, inertia_com = {inertia}{more} }}'
    joint = '{ name = "flight", type = "free", child = "nut" }'
    return f'name = "spun"\ndimensions = 3\nbodies = [{body}]\njoints = [{joint}]\n'


@pytest.mark.parametrize(
    ("inertia", "kind"),
    [
        ("[0.333, 0.333, 0.666]", "exact"),
        ("[0.333, 0.333, 0.6665]", "printed"),
        ("[0.333, 0.333, 0.668]", "wrong"),
        # The same, turned by 45 degrees.
        ("[0.333, 0.4995, 0.4995, 0, 0, 0.1665]", "exact"),
        ("[0.333, 0.49975, 0.49975, 0, 0, 0.16675]", "printed"),
        ("[0.333, 0.5005, 0.5005, 0, 0, 0.1675]", "wrong"),
    ],
)
def test_inertias_as_printed_are_taken_with_a_notice(inertia: str, kind: str) -> None:
    """Up to 0.1 % beyond what a body can have; more is refused unless the body says so."""
    moments = np.array([float(x) for x in re.findall(r"-?[\d.]+", inertia)])
    xx, yy, zz, xy, xz, yz = [*moments, 0, 0, 0][:6]
    principal = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    beyond = (principal[2] - principal[0] - principal[1]) / principal[2]
    assert {"exact": beyond < 1e-9, "printed": 1e-9 < beyond < 1e-3, "wrong": beyond > 1e-3}[kind]
    if kind == "wrong":
        with pytest.raises(SceneError, match="principal moments"):
            elaborate(parse_scene(spun(inertia)))
    else:
        notices = elaborate(parse_scene(spun(inertia))).notices
        assert len(notices) == (kind == "printed")
        assert all("bodies[0].inertia_com: a principal moment of" in line for line in notices)
    model = elaborate(parse_scene(spun(inertia, ', inertia_check = "off"')))
    assert not model.notices
    with pytest.raises(SceneError, match="unknown value 'of'"):
        parse_scene(spun(inertia, ', inertia_check = "of"'))
