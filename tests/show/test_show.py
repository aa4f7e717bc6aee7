"""Figures of a motion: true to its numbers, whole, and reproducible."""

import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from campaign import some
from matplotlib.figure import Figure
from matplotlib.mathtext import MathTextParser
from matplotlib.text import Text

from eomgen.base import templating
from eomgen.base.errors import RunError
from eomgen.base.files import is_ours
from eomgen.commands.main import main
from eomgen.run.trajectory import load_npz
from eomgen.scene.look import Box, Disc, Polygon, Rod, numbers
from eomgen.show.figure import draw_motion, save_figure
from eomgen.show.framing import View
from eomgen.show.motion import Motion, thinned
from eomgen.show.outlines import outline
from eomgen.show.style import GREEK, symbol, write_figure

NASTY = "</script><img src=x onerror=alert(1)> <!-- $x^2$ \u2028 鎖 \x01 {{ t }}"
ARM = 0.6
WORKED = {"works": np.outer(np.arange(201.0), (1.0, -1.0)), "effects": ("gravity", "air")}


def swinging(n: int = 201, duration: float = 4.0, **changes: Any) -> Motion:
    """A pendulum on a cart, made up rather than simulated; energy is off by 1e-9 at most."""
    t = np.linspace(0.0, duration, n)
    x, theta = 0.3 * np.sin(t), 2.0 * np.cos(3 * t)
    y = np.column_stack([x, theta, 0.3 * np.cos(t), -6.0 * np.sin(3 * t)])
    zero = np.zeros(n)
    cart = np.column_stack([x, zero, zero])
    arm = np.column_stack([x + ARM * np.sin(theta), -ARM * np.cos(theta), theta])
    kinetic = 2.0 + np.cos(6 * t)
    motion = Motion(
        name="cart_pole",
        title="Pendulum on a cart",
        t=t,
        y=y,
        states=("x", "theta", "x_dot", "theta_dot"),
        units=("m", "rad", "m/s", "rad/s"),
        positions=(0, 1),
        bodies=("cart", "pole"),
        shapes=(
            (Box(type="box", size=(0.5, 0.2)),),
            (
                Rod(type="rod", start=(0.0, ARM), end=(0.0, -0.4), width=0.06),
                Disc(type="disc", radius=0.1, center=(0.0, -0.4), color="#ee6677"),
            ),
        ),
        joints=("rail", "pivot"),
        poses=np.stack([cart, arm], axis=1),
        kinetic_energy=kinetic,
        potential_energy=5.0 + 1e-9 * t / duration - kinetic,
        joint_drift=np.column_stack([zero, 1e-12 * t]),
        framing=View(height=3.0, follow="pole"),
        integrator="rk4, dt = 0.02 s",
        finished=True,
        message="",
        anchors=((1, 0.0, ARM),),
    )
    return replace(motion, **changes)


def panel(figure: Figure, title: str) -> Any:
    return next(axes for axes in figure.axes if title in axes.get_title(loc="left"))


def test_figure_shows_the_numbers() -> None:
    motion = swinging()
    figure = draw_motion(motion)
    for title, expected in (
        ("Lengths", [motion.y[:, 0]]),
        ("Angles", [motion.y[:, 1]]),
        ("Energy", [motion.kinetic_energy, motion.potential_energy, 5.0 + 1e-9 * motion.t / 4.0]),
        # Kinetic energy reaches 3 J, potential energy spans 2 J.
        ("change of energy", [np.maximum(1e-9 * motion.t / 4.0 / 5.0, np.finfo(float).eps)]),
        ("Gap in the joints", np.maximum(motion.joint_drift.T, np.finfo(float).eps)),
    ):
        curves = panel(figure, title).get_lines()[: len(expected)]
        for curve, values in zip(curves, expected, strict=True):
            np.testing.assert_allclose(curve.get_xdata(), motion.t)
            np.testing.assert_allclose(curve.get_ydata(), values, rtol=1e-2, atol=1e-17)
    assert {text.get_text() for text in panel(figure, "Lengths").get_legend().texts} == {"$x$"}

    mechanism = panel(figure, "8 poses")
    assert len(mechanism.patches) == 8 * 3
    disc = mechanism.patches[-1].get_xy()[:-1]  # the last instant's pendulum bob
    x, y, angle = motion.poses[-1, 1]
    bob = np.array([x + 0.4 * np.sin(angle), y - 0.4 * np.cos(angle)])
    np.testing.assert_allclose(np.hypot(*(disc - bob).T), 0.1, rtol=1e-12)
    low, high = mechanism.dataLim.get_points()
    assert (low <= disc.min(axis=0)).all() and (high >= disc.max(axis=0)).all()


def test_outlines() -> None:
    triangle = Polygon(type="polygon", points=((0.0, 0.0), (2.0, 0.0), (0.0, 1.0)))
    np.testing.assert_array_equal(outline(triangle), [*map(numbers, triangle.points)])
    box = Box(type="box", size=(4.0, 2.0), center=(1.0, 0.0), angle=np.pi / 2)
    np.testing.assert_allclose(outline(box).min(axis=0), [0.0, -2.0], atol=1e-15)
    np.testing.assert_allclose(outline(box).max(axis=0), [2.0, 2.0], atol=1e-15)
    rod = outline(Rod(type="rod", start=(1.0, 1.0), end=(4.0, 5.0), width=0.4))
    # Every corner lies at half the width from the straight line between the two ends.
    along = np.clip((rod - 1.0) @ [0.6, 0.8], 0.0, 5.0)
    distance = np.hypot(*(rod - 1.0 - np.outer(along, [0.6, 0.8])).T)
    np.testing.assert_allclose(distance, 0.2, rtol=1e-12)


@pytest.mark.parametrize("suffix", some([".svg"], [".png", ".svg", ".pdf"]))
def test_figure_files_are_ours_and_reproducible(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    save_figure(swinging(), path)
    first = path.read_bytes()
    with matplotlib.rc_context({"axes.titlepad": 30.0, "font.size": 30.0, "svg.hashsalt": "x"}):
        before = dict(matplotlib.rcParams)
        save_figure(swinging(), path)  # what is ours may be written again
        assert dict(matplotlib.rcParams) == before
    assert path.read_bytes() == first
    assert is_ours(first)
    if suffix == ".svg":
        ElementTree.fromstring(first)


def test_figure_files_refused(tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"\.png, \.svg or \.pdf; '\.jpg' is none of them"):
        save_figure(swinging(), tmp_path / "a.jpg")
    foreign = tmp_path / "a.png"
    foreign.write_bytes(b"holiday")
    with pytest.raises(RunError, match="was not written by eomgen"):
        save_figure(swinging(), foreign)
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"holiday"]


BARE = {"shapes": ((), ()), "joints": (), "joint_drift": np.zeros((1, 0)), "anchors": ()}
STILL = {"kinetic_energy": np.zeros(201), "potential_energy": np.zeros(201)}
DIVERGED = np.where(np.arange(201) < 150, np.geomspace(1.0, 1e250, 201), np.nan)
MANY = {
    "y": np.ones((201, 40)),
    "states": tuple(f"phi_{k}" for k in range(40)),
    "units": ("rad",) * 40,
    "positions": tuple(range(40)),
}


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        pytest.param({"n": 1, "title": "", **BARE}, "cart_pole", id="one bare sample"),
        pytest.param({"joint_drift": np.zeros((201, 2)), **STILL}, "Energy", id="at rest"),
        pytest.param({"kinetic_energy": DIVERGED}, "to 2.98 s (full)", id="diverged"),
        pytest.param({"title": NASTY, "integrator": NASTY}, "鎖", id="nasty text"),
        pytest.param(WORKED, "Work of effects", id="works"),
        pytest.param(MANY, r"$\phi_{39}$", id="many states"),
        pytest.param(
            {"finished": False, "message": "no $\\step{$\nis small"},
            "The run stopped at t = 4 s: no $\\step{$ is small",
            id="unfinished",
        ),
    ],
)
@pytest.mark.every(4)
def test_odd_motions_are_drawn(tmp_path: Path, changes: dict[str, Any], said: str) -> None:
    motion = swinging(**changes)
    figure = draw_motion(motion)
    write_figure(figure, tmp_path / "a.svg")  # every warning is an error here
    assert any(said in text.get_text() for text in figure.findobj(Text))


def test_no_finite_sample() -> None:
    with pytest.raises(RunError, match="cart_pole: the run holds no finite sample"):
        thinned(swinging(kinetic_energy=np.full(201, np.inf)))


def test_symbols() -> None:
    assert symbol("theta") == r"$\theta$"
    assert symbol("phi_dot") == r"$\dot{\phi}$"
    assert symbol("x_A") == "$x_{A}$"
    assert symbol("q1_dot") == r"$\dot{q}_{1}$"
    assert symbol("theta_elbow_2_ddot") == r"$\ddot{\theta}_{\mathrm{elbow},2}$"
    assert symbol("cart_x") == r"$\mathrm{cart}_{x}$"
    assert symbol("dot") == r"$\mathrm{dot}$"
    assert symbol("$x") == r"\$x"
    names = [
        *GREEK.pattern.split("|"),
        "lambda_dot",
        "a_b_c_d",
        "x_dot_dot",
        "long_name_dot",
        "X9_9",
    ]
    parser = MathTextParser("path")
    for name in names:
        parser.parse(symbol(name))  # raises where the mathtext is wrong


@pytest.mark.parametrize("home", ["eomgen/templates", "templates"])
def test_templating(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, home: str) -> None:
    folder = tmp_path / home / "trial"
    folder.mkdir(parents=True)
    (folder / "whole").write_text(
        "{% for x in xs %}\n  {{ x }};\n  {% endfor %}\n{% include 'part' %}"
    )
    (folder / "part").write_text("{{ name }}\n")
    monkeypatch.setattr(templating, "PACKAGE", tmp_path / "eomgen")
    templating.environment.cache_clear()
    context = {"xs": ["<", 2], "name": "&"}
    assert templating.render("trial", "whole", context) == "  <;\n  2;\n&\n"
    assert templating.render("trial", "whole", context, html=True) == "  &lt;;\n  2;\n&amp;\n"
    with pytest.raises(
        AssertionError, match=r"trial/whole .* missing \['name'\], surplus \['nam'\]"
    ):
        templating.render("trial", "whole", {"xs": [], "nam": ""})
    templating.environment.cache_clear()


def test_a_run_that_blows_up_keeps_what_it_has(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Time, state and remedy in one line, exit code 1, and finite rows in every file."""
    command = ["simulate", "double_pendulum", "--integrator", "euler", "--dt", "0.1"]
    assert main([*command, "--t-end", "10", "-o", str(tmp_path)]) == 1
    err = capsys.readouterr().err
    assert err.count("eomgen: double_pendulum: stopped at t = ") == 1
    line = err.splitlines()[-1]
    assert "theta_1=" in line and "take --dt 0.0" in line and "implicit" in line
    run = load_npz(tmp_path / "double_pendulum.npz")
    assert not run.finished and len(run.t) > 5 and np.isfinite(run.y).all()
    table = np.loadtxt(tmp_path / "double_pendulum.csv", delimiter=",", skiprows=1)
    np.testing.assert_array_equal(table[:, 1:], run.y)
    for suffix in ("png", "html"):
        assert (tmp_path / f"double_pendulum.{suffix}").stat().st_size > 10_000


def test_what_showing_needs() -> None:
    code = "import eomgen.show.figure, eomgen.show.page, sys; print(*sys.modules)"
    output = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True
    )
    loaded = set(output.stdout.split())
    # pyplot wants a display; the rest would turn the way from scene to picture around.
    assert not loaded & {"matplotlib.pyplot", "sympy", "eomgen.commands.main", "eomgen.pipeline"}
    rooms = {"derivation", "program", "backends", "run", "study"}
    assert not {name for name in loaded if name.startswith("eomgen.")} & {
        f"eomgen.{r}" for r in rooms
    }
