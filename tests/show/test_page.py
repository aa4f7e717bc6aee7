"""The page of a run: whole, true to the run, small, safe to open. Its parts without a browser run
in node.
"""

import base64
import html
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from html_pages import Page
from live import NODE, run_in_node
from scenes import WEIGHT, lone

import eomgen
from eomgen.api.runs import Run
from eomgen.base.files import is_ours
from eomgen.base.templating import templates_folder
from eomgen.show.page import PageCode, page_data, render_page, save_page

NASTY = "</script><img src=x onerror=alert(1)> <!-- $x^2$ \u2028 鎖 {{ t }}"
needs_node = pytest.mark.skipif(NODE is None, reason="needs node, which runs JavaScript")

SCENE = """
name = "page_trial"
title = "Trial"
{settings}
[parameters]
m = {{ value = 1.3, unit = "kg" }}
l = 0.7
[[bodies]]
name = "first"
mass = "m"
inertia_com = 0.02
[[bodies]]
name = "second"
mass = 0.4
inertia_com = 0.01
[[joints]]
name = "pin"
type = "revolute"
parent = "world"
child = "first"
r_child = [0, "l"]
coordinate = "a"
[[joints]]
name = "elbow"
type = "revolute"
parent = "first"
child = "second"
r_parent = [0, "-l/2"]
r_child = [0, 0.4]
coordinate = "b"
[[effects]]
type = "gravity"
g = 9.81
[[effects]]
type = "spring"
name = "pull"
body_1 = "second"
body_2 = "world"
at_2 = [1.0, 0.2]
stiffness = 3.0
[initial]
q = {{ a = 1.0 }}
"""
IN_SPACE = lone(
    "ball",
    WEIGHT,
    body="top",
    on="tip",
    name="page_trial_in_space",
    dimensions=3,
    initial={"v": {"tip_wx": 0.3, "tip_wz": 5.0}},
    inertia_com=[0.1, 0.2, 0.3, 0, 0, 0],
    r_child=[0, 0, -0.3],
)


def planar(settings: str = "", more: str = "", **options: Any) -> Run:
    text = SCENE.format(settings=settings) + more
    return eomgen.simulate(text, t_end=1.0, **options)


@pytest.fixture(scope="module")
def run() -> Run:
    return planar(samples=41)


@pytest.fixture(scope="module")
def run_in_space() -> Run:
    return eomgen.simulate(IN_SPACE, t_end=1.0, samples=41)


def unpacked(run: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Times and states of a page's run."""
    t, y = (base64.b64decode(run[key]) for key in ("t", "y"))
    kind = "<f4" if run["single"] else "<f8"
    return np.frombuffer(t, "<f8"), np.frombuffer(y, kind).reshape(run["rows"], -1)


def test_a_page_holds_the_run(run: Run) -> None:
    page = Page(render_page(run.motion, run.page()))
    t, y = unpacked(page.data["run"])
    np.testing.assert_array_equal(t, run.t)
    np.testing.assert_array_equal(y, run.y)
    assert [state["name"] for state in page.data["states"]] == list(run.states)
    assert page.data["initial"] == run.y[0].tolist() and page.data["live"]
    assert [body["name"] for body in page.data["drawing"]["bodies"]] == ["first", "second"]
    assert "run stopped" not in page.text and run.motion.summary in page.text
    stopped = replace(run.motion, finished=False, message="<b>too fast</b>")
    assert "at t = 1 s: <b>too fast</b>" in Page(render_page(stopped, run.page())).text


def test_a_page_stands_alone(run: Run) -> None:
    source = render_page(run.motion, run.page())
    page = Page(source)
    code = source.replace(page.scripts[0], "")  # whose base64 may hold anything
    vendor = templates_folder() / "page" / "vendor"
    for path in ("three/three.min.js", "uplot/uplot.js", "uplot/uplot.css"):
        text = (vendor / path).read_text("utf-8")
        assert text.strip() in code
        code = code.replace(text.strip(), "")
    code = code.replace("http://www.w3.org/2000/svg", "")  # a name, which nothing loads
    assert not re.search(r"https?:|//[a-z]|@import|url\(|fetch\(|import\(|\beval\(", code)
    attributes = {name for _, attrs in page.tags for name in attrs}
    assert not {name for name in attributes if name.startswith("on")} | {"src", "href"} & attributes
    policy = next(a for t, a in page.tags if a.get("http-equiv") == "Content-Security-Policy")
    closed = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
    assert policy["content"] == closed
    # Whatever the script takes hold of is there or is made by it.
    ids = [attrs["id"] for _, attrs in page.tags if "id" in attrs]
    wanted = set(re.findall(r'byId\("([\w-]+)"\)', page.scripts[1]))
    assert len(wanted) > 20 and wanted <= set(ids) and len(ids) == len(set(ids))


def test_whatever_can_be_used_has_a_name(run: Run) -> None:
    page = Page(render_page(run.motion, run.page()))
    labelled = {attrs["for"] for tag, attrs in page.tags if tag == "label" and "for" in attrs}
    for tag, attrs in page.tags:
        if tag in ("canvas", "select", "output") or attrs.get("type") in ("range", "text"):
            assert attrs.get("aria-label") or attrs.get("id") in labelled, (tag, attrs)
    # A button without words has a label.
    source = (templates_folder() / "page" / "page.html").read_text("utf-8")
    buttons = re.findall(r"<button([^>]*)>(.*?)</button>", source)
    assert len(buttons) > 12
    for attributes, content in buttons:
        assert "aria-label" in attributes or re.search("[A-Za-z]{3}", re.sub("<.*?>", "", content))


def test_a_page_escapes_whatever_a_scene_says(run: Run) -> None:
    plain = Page(render_page(run.motion, run.page()))
    code = run.page()
    states = [{**state, "name": NASTY, "unit": NASTY} for state in code.table["states"]]
    parameters = [{**p, "about": NASTY, "name": NASTY} for p in code.table["parameters"]]
    table = {**code.table, "states": states, "parameters": parameters}
    motion = replace(run.motion, title=NASTY, integrator=NASTY, states=(NASTY,) * 4)
    source = render_page(motion, replace(code, table=table))
    page = Page(source)
    assert page.tags == plain.tags and page.scripts[1] == plain.scripts[1]
    assert page.data["title"] == page.data["states"][1]["name"] == NASTY
    assert " ".join(NASTY.replace("\u2028", " ").split()) in page.text
    assert "\u2028" not in source and "<!--" not in source
    assert html.escape("<img src=x") in source and "<img" not in source
    for bad in ("</script>", "</SCRIPT >", "<!-- "):
        with pytest.raises(AssertionError, match="would end its script"):
            render_page(run.motion, PageCode(f"// {bad}", run.page().table, live=False))


def test_sliders_of_joints_end_at_stops() -> None:
    """At the scene's parameters; a limit may be absent."""
    stop = (
        '[[effects]]\ntype = "joint_stop"\nname = "end"\njoint = "pin"\nhigh = "2*l"\nstiffness = 9'
    )
    scene = f"{SCENE.format(settings='')}{stop}"
    run = eomgen.simulate(scene, t_end=0.1, samples=3)
    assert run.page().table["limits"] == {"a": [None, pytest.approx(1.4)]}


def test_a_page_is_small_and_ours(run: Run, tmp_path: Path) -> None:
    save_page(run.motion, run.page(), tmp_path / "a.html")
    save_page(run.motion, run.page(), tmp_path / "a.html")  # ours may be written again
    written = (tmp_path / "a.html").read_bytes()
    assert is_ours(written) and written.decode() == render_page(run.motion, run.page())
    # A usual run of 10 s: 1001 rows; and one of many states, with an event in it.
    t = np.linspace(0.0, 10.0, 1001)
    still = {"kinetic_energy": t, "potential_energy": t, "joint_drift": np.zeros((1001, 2))}
    poses = np.resize(run.motion.poses, (1001, 2, 3))
    usual = replace(run.motion, t=t, y=np.resize(run.y, (1001, 4)), poses=poses, **still)
    assert len(render_page(usual, run.page())) < 1_000_000
    assert page_data(usual, run.page())["run"]["rows"] == 1001
    t = np.where(np.arange(1001) == 500, t[499], t)
    wide = np.random.default_rng(1).normal(size=(1001, 100))
    code = run.page()
    names = tuple(f"s{k}" for k in range(100))
    table = {**code.table, "states": [{"name": n, "unit": "m", "kind": "other"} for n in names]}
    motion = replace(usual, t=t, y=wide, states=names, units=("m",) * 100)
    data = page_data(motion, replace(code, table=table))
    kept, y = unpacked(data["run"])
    assert data["run"]["single"] and 200 < len(kept) < 400 and len(data["run"]["y"]) < 200_000
    assert (kept == t[499]).sum() == 2  # both sides of an event
    rows = np.searchsorted(t, kept, side="right") - 1
    rows[np.flatnonzero(kept == t[499])[0]] = 499
    np.testing.assert_array_equal(y, wide[rows].astype("f4"))


def test_a_page_that_only_replays(run: Run) -> None:
    """`--no-live`, also of a run whose states the live functions do not take."""
    code = run.page(live=False)
    page = Page(render_page(run.motion, code))
    assert not page.data["live"] and page.data["effects"] == []
    np.testing.assert_array_equal(unpacked(page.data["run"])[1], run.y)
    assert "geometry" in page.data and "pull it" not in page.text
    momenta = eomgen.simulate("two_body", form="momentum", t_end=0.5, samples=11)
    data = page_data(momenta.motion, momenta.page(live=False))
    np.testing.assert_array_equal(unpacked(data["run"])[1], momenta.y)


def test_a_page_of_momenta_is_live() -> None:
    """It shows the run in the states that its functions take."""
    runs = [
        eomgen.simulate("two_body", form=form, t_end=0.5, samples=11)
        for form in ("momentum", "velocity")
    ]
    data = page_data(runs[0].motion, runs[0].page())
    assert data["live"] and [s["name"] for s in data["states"]] == list(runs[1].states)
    np.testing.assert_allclose(unpacked(data["run"])[1], runs[1].y, atol=1e-8)


# ---- Parts of the page in node ----

DOCUMENT = """
const text = JSON.stringify(given.data);
const document = { getElementById: () => ({ textContent: text }) };
"""


def in_node(run: Run, code: PageCode, script: str, given: Any = None) -> Any:
    """What a script returns that has the page's data, tools, view and replay."""
    parts = ("data.js", "tools.js", "stage_view.js", "replay.js")
    data = page_data(run.motion, code)
    scripts = [(templates_folder() / "page" / name).read_text("utf-8") for name in parts]
    body = "\n".join([DOCUMENT, *scripts, script])
    return run_in_node(code.source, body, {"data": data, "more": given}, scripts=())


POSES = """
const replay = makeReplay(mechanism);
const { p, u } = replay;
const poses = (time) => Array.from(mechanism.bodyPoses(time, replay.stateAt(time), p, u));
return { rows: Array.from(replay.t, poses), between: given.more.map(poses) };
"""


@pytest.mark.every(3)
@needs_node
@pytest.mark.parametrize("live", [True, False])
@pytest.mark.parametrize("scene", ["plane", "driven", "space"])
def test_a_replay_goes_through_the_run(scene: str, live: bool, run_in_space: Run) -> None:
    """At its rows exactly; between them as a run with more rows does, by cubics."""
    drive = '[[effects]]\ntype = "driven"\nname = "d"\njoint = "elbow"\ncoordinate = "sin(3*t)"\n'
    if scene == "space":
        coarse, fine = run_in_space, eomgen.simulate(IN_SPACE, t_end=1.0, samples=81)
    else:
        more = drive if scene == "driven" else ""
        coarse, fine = (planar(more=more, samples=n) for n in (41, 81))
    between = fine.t[1::2]
    found = in_node(coarse, coarse.page(live=live), POSES, between.tolist())
    rows = np.array(found["rows"]).reshape(coarse.motion.poses.shape)
    np.testing.assert_allclose(rows, coarse.motion.poses, atol=1e-13)
    there = np.array(found["between"]).reshape(fine.motion.poses[1::2].shape)
    np.testing.assert_allclose(there, fine.motion.poses[1::2], atol=2e-5)
    linear = (coarse.motion.poses[1:] + coarse.motion.poses[:-1]) / 2
    assert (
        np.abs(linear - fine.motion.poses[1::2]).max()
        > 20 * np.abs(there - fine.motion.poses[1::2]).max()
    )


VIEW = """
const canvas = { clientWidth: 600, clientHeight: 400 };
const view = makeView(canvas);
const [p, u] = [given.data.parameters, given.data.inputs].map((list) => list.map((x) => x.value));
const poses = mechanism.bodyPoses(0, given.data.initial, p, u);
view.aim(poses);
const [x, y] = [123, 210];
const before = view.toWorld(x, y);
view.zoomBy(1.7, x, y);
const after = view.toWorld(x, y);
view.turn(31, -12);
view.move(5, 9);
const through = [0.3, -0.2, 0.5];
const there = view.toWorld(x, y, through);
const axes = view.axes();
const at = given.more;
const place = tools.place(poses, 0, at);
return {
  before, after, axes, screen: view.toScreen(there), scale: view.scale(),
  depth: tools.dot(tools.subtract(there, through), axes[2]),
  place, back: tools.pointOf(poses, 0, place), step: [0.03, 0.7, 45, 1].map(tools.roundLength),
};
"""


@needs_node
@pytest.mark.parametrize("dimensions", [2, 3])
def test_the_view_and_points_of_bodies(dimensions: int, run: Run, run_in_space: Run) -> None:
    shown = run if dimensions == 2 else run_in_space
    at = [0.2, -0.1, 0.4][:dimensions]
    found = in_node(shown, shown.page(), VIEW, at)
    # The point under the pointer stays there when the view zooms; the screen's plane is kept.
    np.testing.assert_allclose(found["after"], found["before"], atol=1e-12)
    np.testing.assert_allclose(found["screen"], [123, 210], atol=1e-9)
    assert abs(found["depth"]) < 1e-12
    axes = np.array(found["axes"])
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(np.cross(axes[0], axes[1]), axes[2], atol=1e-14)
    np.testing.assert_allclose(found["back"], at, atol=1e-14)
    pose = shown.motion.poses[0, 0]
    if dimensions == 3:
        expected = pose[:, :3] @ at + pose[:, 3]
    else:
        c, s = np.cos(pose[2]), np.sin(pose[2])
        expected = [pose[0] + c * at[0] - s * at[1], pose[1] + s * at[0] + c * at[1], 0.0]
    np.testing.assert_allclose(found["place"], expected, atol=1e-14)
    assert found["step"] == pytest.approx([0.02, 0.5, 20, 1])
