"""Figures and pages of a motion: true to its numbers, whole, reproducible, and safe to open."""

import base64
import json
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.mathtext import MathTextParser
from matplotlib.text import Text

from eomgen import templating
from eomgen.errors import RunError
from eomgen.files import is_ours
from eomgen.scene.look import Box, Disc, Polygon, Rod, number, numbers
from eomgen.show.figure import draw_motion, save_figure
from eomgen.show.formulas import plain_data
from eomgen.show.framing import View
from eomgen.show.motion import Motion, thinned
from eomgen.show.outlines import outline
from eomgen.show.page import render_page, save_page
from eomgen.show.style import GREEK, symbol, write_figure

NASTY = "</script><img src=x onerror=alert(1)> <!-- $x^2$ \u2028 鎖 \x01 {{ t }}"
ARM = 0.6
WORKED = {"works": np.outer(np.arange(201.0), (1.0, -1.0)), "effects": ("gravity", "air")}
POSES = """function bodyPoses(y, p) {
  const [x, theta] = y;
  return [[x, 0, 0], [x + p[0] * Math.sin(theta), -p[0] * Math.cos(theta), theta]];
}"""


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
        camera=View(height=3.0, follow="pole"),
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


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
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
        pytest.param({"joint_drift": np.zeros((201, 2)), **STILL}, "exactly 0", id="at rest"),
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
@pytest.mark.every(2)
def test_odd_motions_are_drawn(tmp_path: Path, changes: dict[str, Any], said: str) -> None:
    motion = swinging(**changes)
    figure = draw_motion(motion)
    write_figure(figure, tmp_path / "a.svg")  # every warning is an error here
    assert any(said in text.get_text() for text in figure.findobj(Text))
    render_page(motion, POSES, (ARM,))


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


class Page(HTMLParser):
    """What a browser makes of a page: tags with attributes, scripts, and the text of the rest."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: list[str] = []
        self.text = ""
        self.feed(page)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag == "script":
            self.scripts.append("")

    def handle_data(self, data: str) -> None:
        if self.cdata_elem == "script":
            self.scripts[-1] += data
        else:
            self.text += data

    def run(self) -> dict[str, Any]:
        """The data that the page plays, arrays unpacked."""
        data: dict[str, Any] = json.loads(self.scripts[0])
        for key in ("t", "y", "kinetic", "potential"):
            data[key] = np.frombuffer(base64.b64decode(data[key]), dtype="<f8")
        return data


def test_page_holds_the_motion() -> None:
    motion = swinging()
    page = Page(render_page(motion, POSES, (ARM,)))
    run = page.run()
    np.testing.assert_array_equal(run["t"], motion.t)
    np.testing.assert_array_equal(run["y"], motion.y.ravel())
    np.testing.assert_array_equal(run["kinetic"], motion.kinetic_energy)
    np.testing.assert_array_equal(run["potential"], motion.potential_energy)
    assert run["states"] == list(motion.states) and run["units"] == list(motion.units)
    assert run["parameters"] == [ARM] and run["anchors"] == [[1, 0.0, ARM]]
    assert run["camera"]["follow"] == 1 and run["camera"]["height"] == 3.0
    box = {"type": "box", "size": [0.5, 0.2], "center": [0.0, 0.0], "angle": 0.0}
    assert run["shapes"][0] == [{**box, "color": "#4477aa"}]
    rod, disc = (plain_data(shape, number) for shape in motion.shapes[1])
    assert run["shapes"][1] == [{**rod, "color": "#4477aa"}, disc]
    assert run["colors"] == ["#4477aa", "#4477aa"] and run["traced"] == [0, 1]
    assert page.scripts[1].strip() == POSES
    assert "run stopped" not in page.text
    stopped = replace(motion, finished=False, message="<b>too fast</b>")
    assert "at t = 4 s: <b>too fast</b>" in Page(render_page(stopped, POSES, (ARM,))).text


def test_page_stands_alone() -> None:
    source = render_page(swinging(), POSES, (ARM,))
    page = Page(source)
    code = source.replace(page.scripts[0], "")  # whose base64 may hold anything
    assert not re.search(r"https?:|//[a-z]|@import|url\(|fetch\(|import\(", code)
    attributes = {name for _, attrs in page.tags for name in attrs}
    assert not {name for name in attributes if name.startswith("on")} | {"src", "href"} & attributes
    policy = next(a for t, a in page.tags if a.get("http-equiv") == "Content-Security-Policy")
    assert policy["content"] is not None and "default-src 'none'" in policy["content"]
    # Whatever the script takes hold of is there, and whatever can be pressed has a name.
    ids = [attrs["id"] for _, attrs in page.tags if "id" in attrs]
    wanted = set(re.findall(r'byId\("(\w+)"\)', page.scripts[2]))
    assert wanted and wanted <= set(ids) and len(ids) == len(set(ids))
    for tag, attrs in page.tags:
        if tag in ("button", "select", "canvas") or attrs.get("type") == "range":
            assert attrs.get("aria-label"), (tag, attrs)


def test_page_escapes_whatever_a_scene_says() -> None:
    plain = Page(render_page(swinging(), POSES, (ARM,)))
    texts: dict[str, Any] = {"title": NASTY, "integrator": NASTY, "states": ("x", NASTY, "y", "z")}
    source = render_page(swinging(**texts), POSES, (ARM,))
    page = Page(source)
    assert page.tags == plain.tags and page.scripts[1:] == plain.scripts[1:]
    assert page.run()["states"][1] == NASTY
    assert "</script><img src=x onerror=alert(1)> <!-- $x^2$ 鎖 {{ t }}" in page.text
    assert "\u2028" not in source and "<!--" not in source
    for bad in ("</script>", "</SCRIPT >", "<!-- "):
        with pytest.raises(AssertionError, match="would end its script"):
            render_page(swinging(), f"function bodyPoses(y, p) {{}} // {bad}", (ARM,))


def test_page_size(tmp_path: Path) -> None:
    wide = {"y": np.random.default_rng(1).normal(size=(1001, 8)), "states": tuple("abcdefgh")}
    usual = swinging(n=1001, duration=10.0, units=("m",) * 8, **wide)
    save_page(usual, POSES, (ARM,), tmp_path / "a.html")
    save_page(usual, POSES, (ARM,), tmp_path / "a.html")  # ours may be written again
    written = (tmp_path / "a.html").read_bytes()
    assert len(written) < 250_000
    assert is_ours(written)
    assert written.decode() == render_page(usual, POSES, (ARM,))
    long = swinging(n=20_001)
    times = Page(render_page(long, POSES, (ARM,))).run()["t"]
    assert len(times) == 3000 and (np.diff(times) > 0).all()
    assert (times[0], times[-1]) == (long.t[0], long.t[-1])


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


def test_what_showing_needs() -> None:
    code = "import eomgen.show.figure, eomgen.show.page, sys; print(*sys.modules)"
    output = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True
    )
    loaded = set(output.stdout.split())
    # pyplot wants a display; the rest would turn the way from scene to picture around.
    assert not loaded & {"matplotlib.pyplot", "sympy", "eomgen.cli", "eomgen.pipeline"}
    rooms = {"derivation", "program", "backends", "run", "study"}
    assert not {name for name in loaded if name.startswith("eomgen.")} & {
        f"eomgen.{r}" for r in rooms
    }
