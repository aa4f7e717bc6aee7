"""Pages in headless Chromium; tests/campaigns/browser.py tries those of all built-in scenes."""

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from browser import check_page, chromium, missing, opened
from matplotlib.patches import Polygon
from matplotlib.path import Path as Outline
from notebook import cells

import eomgen
from eomgen.api.runs import Run
from eomgen.show.figure import draw_motion
from eomgen.show.gallery import Exhibit, gallery_page, thumbnail
from eomgen.show.page import render_page, save_page

pytestmark = [pytest.mark.apart, pytest.mark.skipif(bool(missing()), reason=missing())]

NASTY = "</script><img src=x onerror=alert(1)><b id=hacked>{{ 7*7 }}\u2028"


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as found:
        yield found


@pytest.fixture(scope="module")
def run() -> Run:
    return eomgen.simulate("double_pendulum", t_end=2.0, samples=201)


def test_a_page_does_what_it_must(
    browser: Any, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("browser.TIMES", 5)
    save_page(run.motion, run.page(), tmp_path / "page.html")
    assert "bodies fill" in check_page(browser, tmp_path / "page.html", run)


def test_cells_of_a_notebook_are_no_higher_than_a_screen(browser: Any) -> None:
    """As wide as a notebook: a scene, a model, equations, a module, a run, its page, numbers."""
    page = browser.new_page(viewport={"width": 1000, "height": 900})
    heights = []
    for cell in cells():
        page.set_content(f"<div id=cell style='font: 14px sans-serif'>{cell}</div>")
        page.wait_for_function("[...document.images].every((image) => image.complete)")
        heights.append(
            page.evaluate("document.querySelector('#cell').getBoundingClientRect().height")
        )
    page.close()
    assert len(heights) == 8 and all(10 < height <= 900 for height in heights), heights


def test_hostile_texts_do_nothing(browser: Any, run: Run, tmp_path: Path) -> None:
    code = run.page()
    table = {
        **code.table,
        "states": [{**s, "name": NASTY + s["name"], "unit": NASTY} for s in code.table["states"]],
        "parameters": [{**p, "about": NASTY, "unit": NASTY} for p in code.table["parameters"]],
        "effects": [{**e, "name": NASTY} for e in code.table["effects"]],
    }
    motion = replace(run.motion, title=NASTY, integrator=NASTY, message=NASTY, finished=False)
    path = tmp_path / "hostile.html"
    path.write_text(render_page(motion, replace(code, table=table)), "utf-8")
    exhibit = Exhibit(NASTY, NASTY, NASTY, "a.html", 1, thumbnail(run.motion), True, NASTY)
    (tmp_path / "index.html").write_text(gallery_page([exhibit]), "utf-8")
    for name in ("hostile.html", "index.html"):
        with opened(browser, tmp_path / name) as page:
            if name == "hostile.html":
                page.page.click("#mode-live")
                page.until("() => window.eomgen.time > 0.05")
            page.page.wait_for_timeout(100)
            assert page.page.locator("#hacked, img[src=x]").count() == 0
            assert page.page.locator("h1, h2").filter(has_text="<img src=x").count() == 1


SENT = """() => new Promise((done) => {
  const refused = [];
  document.addEventListener("securitypolicyviolation", (event) => {
    refused.push(event.effectiveDirective);
    if (refused.length === 3) done(refused.sort());
  });
  fetch("https://example.invalid/").catch(() => null);
  new Image().src = "https://example.invalid/a.png";
  const script = document.createElement("script");
  script.src = "https://example.invalid/a.js";
  document.head.append(script);
})"""


def test_pictures_are_saved_and_nothing_is_sent(browser: Any, run: Run, tmp_path: Path) -> None:
    """In vectors: bodies are where the page shows them, curves have their values, and a PDF has no
    pixels. The content security policy is closed, whatever a script in the page would try.
    """
    save_page(run.motion, run.page(), tmp_path / "page.html")
    with opened(browser, tmp_path / "page.html") as page:
        sent: list[str] = []
        page.page.on("requestfinished", lambda request: sent.append(request.url))
        page.at(1.0)
        drawn = []
        plot = ".plot-tools >> text=SVG"
        for button, which in (("#save-svg", 0), (plot, 0), (plot, -1)):
            with page.page.expect_download() as found:
                page.page.locator(button).nth(which).click()
            drawn.append(ElementTree.parse(found.value.path()).getroot())
        assert (float(drawn[0].get("width", 0)), float(drawn[0].get("height", 0))) == page.size()
        fills = [
            corners(path.get("d", ""))
            for path in drawn[0].iter(f"{SVG}path")
            if path.get("fill") not in (None, "none")
        ]
        for center in page.page.evaluate("window.eomgen.screen"):
            # A rod's outline is symmetrical about its centre of mass.
            assert min(np.abs((f.min(0) + f.max(0)) / 2 - center).max() for f in fills) < 0.1
        path = drawn[1].find(f".//{SVG}svg/{SVG}path")
        assert path is not None
        curve = corners(path.get("d", ""))
        times, values = run.t, run[run.states[0]]
        x, y = (np.interp(curve[:, 0], curve[[0, -1], 0], times[[0, -1]]), curve[:, 1])
        wanted = np.interp(x, times, values)
        slope, level = np.polyfit(wanted, y, 1)
        assert slope < 0 and np.abs(slope * wanted + level - y).max() < 0.1
        # The total energy is below its parts, and wider, whatever its place in the legend.
        names = [text.text for text in drawn[2].iter(f"{SVG}text")][:3]
        assert names == ["kinetic energy", "potential energy", "total energy"]
        legend = [path.get("stroke") for path in drawn[2].iter(f"{SVG}path")][:3]
        curves = drawn[2].findall(f".//{SVG}svg/{SVG}path")
        assert [path.get("stroke") for path in curves] == [legend[2], *legend[:2]]
        assert float(curves[0].get("stroke-width", 0)) > float(curves[1].get("stroke-width", 0))
        assert b"/Subtype /Image" not in page.page.pdf()
        assert page.page.evaluate(SENT) == ["connect-src", "img-src", "script-src-elem"]
        assert not [url for url in sent if "invalid" in url]
        assert all("Content Security Policy" in text for text in page.said)
        page.said.clear()
        del page.asked[1:]


SVG = "{http://www.w3.org/2000/svg}"


HILLS = """\
name = "hills"
bodies = [{ name = "ball", mass = 1.0, inertia_com = 0.01 }]
joints = [{ name = "flight", type = "planar", parent = "world", child = "ball" }]
parameters = { high = 0.3 }
initial = { q = { flight_y = 1.0 }, v = { flight_x_dot = 2.0 } }
[[effects]]
type = "contact"
name = "ground"
body = "ball"
against = "heights"
height = "high*sin(2*x)"
radius = 0.1
law = "spring_damper"
stiffness = 1e4
"""


def test_ground_is_full_below_its_line(browser: Any, tmp_path: Path) -> None:
    """On a page, in a picture that is saved from it, and in a figure."""
    run = eomgen.simulate(HILLS, t_end=0.5, samples=11)
    save_page(run.motion, run.page(), tmp_path / "page.html")
    places = np.array(
        [(x, y) for x in np.linspace(-0.5, 1.4, 9) for y in (-0.9, -0.31, -0.1, 0.2, 0.5)]
    )
    ground = places[:, 1] < 0.3 * np.sin(2 * places[:, 0])
    with opened(browser, tmp_path / "page.html") as found:
        found.at(0.1)
        with found.page.expect_download() as saved:
            found.page.click("#save-svg")
        seen = found.page.evaluate("(all) => all.map(eomgen.toScreen)", places.tolist())
        drawn = ElementTree.parse(saved.value.path()).iter(f"{SVG}path")
    first = next(path for path in drawn if path.get("fill") not in (None, "none"))
    faces = [Outline(face) for face in corners(first.get("d", "")).reshape(-1, 3, 2)]
    assert (np.any([face.contains_points(seen) for face in faces], axis=0) == ground).all()
    axes = draw_motion(run.motion).axes[0]
    below = [p for p in axes.get_children() if isinstance(p, Polygon) and p.zorder < 0.5]
    assert len(below) == 1 and (Outline(below[0].get_xy()).contains_points(places) == ground).all()


def corners(path: str) -> np.ndarray:
    """The corners of a path, (n, 2)."""
    return np.array([tuple(map(float, x.split(","))) for x in re.findall(r"[-\d.]+,[-\d.]+", path)])


def test_a_force_and_its_terms_light_each_other_up(browser: Any, tmp_path: Path) -> None:
    """A press on a term marks the arrows of its effect; a click on an arrow its terms."""
    run = eomgen.simulate("cart_pole", t_end=0.5, samples=21)
    save_page(run.motion, run.page(), tmp_path / "page.html")
    with opened(browser, tmp_path / "page.html") as found:
        page = found.page
        term = page.locator("button.term[data-effect=gravity]:visible")
        found.at(0.2)
        sides = (
            page.locator(".equation")
            .nth(1)
            .evaluate(
                """(e) => [...e.querySelectorAll(".term:not(:empty)")].filter((x) => x.offsetParent)
              .map((x) => [x.matches(".inertia"), x.querySelector(".value").textContent])"""
            )
        )
        left, right = ([float(x.replace("−", "-")) for own, x in sides if own == k] for k in (1, 0))
        assert sum(left) == pytest.approx(sum(right), rel=1e-3) and len(sides) > 3
        term.press("Enter")
        assert term.get_attribute("aria-pressed") == "true" and found.lit == "gravity"
        page.click("#show-menu summary")
        page.check("#show-forces")
        term.press("Enter")
        assert found.lit is None
        found.drawn()
        x, y = found.screen[1]
        box = page.locator("#stage").bounding_box()
        page.mouse.click(box["x"] + x, box["y"] + y + 15)
        assert found.lit == "gravity" and found.mode == "replay"
        assert term.get_attribute("aria-pressed") == "true"


STEPPED = "(n) => { for (let k = 0; k < n; k += 1) forth.click(); return eomgen.state; }"


def test_a_kept_run_goes_on_beside(browser: Any, run: Run, tmp_path: Path) -> None:
    """B is the motion that there would be without the change, and a link keeps both."""
    save_page(run.motion, run.page(), tmp_path / "page.html")
    with opened(browser, tmp_path / "page.html") as found:
        page = found.page
        found.go_live()
        alone = page.evaluate(STEPPED, 100)
        page.click("#restart")
        page.click("#keep")
        page.locator("#parameters .field").first.fill("0.6")
        page.locator("#parameters .field").first.press("Enter")
        page.locator("#step-half").click()
        found.pause()
        page.evaluate(STEPPED, 200)
        found.drawn()
        assert found.kept["state"] == pytest.approx(alone, abs=1e-12)
        assert np.abs(np.array(found.state) - alone).max() > 1e-3
        told = page.locator("#difference").inner_text()
        assert "m_1 = 1\u00a0kg" in told and "J more" in told and "m away" in told
        page.click("#link")
        page.wait_for_function("location.hash.startsWith('#live=')")
        other = page.context.new_page()
        other.goto("about:blank")
        other.goto(page.url)
        kept = other.evaluate("eomgen.kept")
        assert kept["state"] == pytest.approx(alone, abs=1e-12)
        assert kept["parameters"] == found.kept["parameters"] != found.parameters
        other.close()
        page.click("#keep")
        found.drawn()
        assert found.kept is None and page.locator("#difference").is_hidden()


OPEN = "() => Math.max(...mechanism.constraintResiduals(eomgen.time, eomgen.state, eomgen.parameters, eomgen.inputs).map(Math.abs))"  # noqa: E501


def test_a_state_is_set_in_the_phase_plane_and_by_sliders(browser: Any, tmp_path: Path) -> None:
    """By pointer and keys; loops stay closed. One slider for the one freedom of a linkage."""
    run = eomgen.simulate("four_bar", t_end=0.2, samples=11)
    save_page(run.motion, run.page(), tmp_path / "page.html")
    with opened(browser, tmp_path / "page.html") as found:
        page = found.page
        page.get_by_text("+ Phase portrait").click()
        plot = page.locator(".plot").last
        plot.get_by_text("Set state").click()
        start = np.array(found.state)
        over = plot.locator(".u-over").bounding_box()
        places = []
        for x in (0.4, 0.6):
            page.mouse.click(over["x"] + x * over["width"], over["y"] + 0.3 * over["height"])
            places.append(found.state)
            assert page.evaluate(OPEN) < 1e-9
        assert found.mode == "live" and not found.playing
        (angle, rate), further = np.array(places)[0, [0, 3]], np.array(places)[1, [0, 3]]
        assert further[0] > angle and further[1] == pytest.approx(rate, rel=1e-9)
        assert np.abs(np.array(places[0]) - start)[1:3].max() > 1e-3
        page.keyboard.press("ArrowUp")
        assert found.state[3] > rate and found.state[0] == pytest.approx(further[0], abs=1e-9)
        (slider,) = page.locator("#poses input").all()
        slider.evaluate("(e) => { e.value = 1.5; e.dispatchEvent(new Event('input')); }")
        assert found.state[0] == pytest.approx(1.5, abs=1e-9) and page.evaluate(OPEN) < 1e-9
        page.click("#play")
        found.until("() => document.getElementById('poses').disabled")


def test_a_state_is_typed_and_a_link_keeps_it(browser: Any, tmp_path: Path) -> None:
    """The motion stands there; a link opens the same state, parameters, effects, method and plots.
    What a link says of nothing that is known changes nothing.
    """
    run = eomgen.simulate("peaucellier", t_end=0.2, samples=11)
    save_page(run.motion, run.page(), tmp_path / "page.html")
    with opened(browser, tmp_path / "page.html") as found:
        page, start, free = found.page, np.array(found.state), len(run.model.coordinates)
        page.locator("#values .field").first.fill(f"{start[0] + 0.01}")
        page.locator("#values .field").first.press("Enter")
        assert found.mode == "live" and not found.playing
        moved = np.array(found.state) - start
        assert moved[0] == pytest.approx(0.01, abs=1e-9) and np.abs(moved[1:free]).max() > 1e-3
        page.locator("#parameters .field").last.fill("0.7")
        page.locator("#parameters .field").last.press("Enter")
        page.locator("#effects input").first.uncheck()
        found.pause()
        page.click("#link")
        page.wait_for_function("location.hash.startsWith('#live=')")
        kept = found.state, found.parameters, found.time, found.step["method"]
        address = page.url
        other = page.context.new_page()
        for link in (address, page.url.split("#")[0] + "#live=%7B%22t%22:", address + "%7D"):
            other.goto("about:blank")
            other.goto(link)
            shown = other.evaluate(
                "[eomgen.state, eomgen.parameters, eomgen.time, eomgen.step.method, eomgen.mode]"
            )
            same = np.allclose(shown[0], kept[0], rtol=0, atol=1e-12) and shown[1] == kept[1]
            assert same == (link == address), link
        other.close()
