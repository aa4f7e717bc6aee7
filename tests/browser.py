"""Pages in headless Chromium: opening them, and what each of them must do."""

import importlib.util
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from eomgen.api.runs import Run
from eomgen.show.framing import bounds_of
from eomgen.show.view import eye_axes

CHROMIUM = (
    os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
)
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
DESK, PHONE = (1000, 640), (390, 844)
TIMES = 10
FILLED = 1 / 3
"""Least part of the picture's width or height that bodies fill in the course of a motion."""
NARROW = 4 / 3
PATIENCE = 20_000
"""Longest time that a page may take to do something, ms."""


def missing() -> str:
    """Why pages cannot be opened here; "" if they can."""
    if importlib.util.find_spec("playwright") is None:
        return "needs Playwright: pip install -e '.[browser]'"
    if CHROMIUM is None:
        return "needs Chromium: apt-get install chromium, or its path in CHROMIUM"
    return ""


@contextmanager
def chromium() -> Iterator[Any]:
    """A browser, which is closed at the end."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        try:
            yield browser
        finally:
            browser.close()


@dataclass
class Opened:
    """A page, and what it has said and asked for since it was opened."""

    page: Any
    path: Path
    said: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)

    def __getattr__(self, name: str) -> Any:
        """What the page tells of itself."""
        return self.page.evaluate(f"window.eomgen.{name}")

    def at(self, t: float) -> None:
        """Show the recorded run at a time."""
        self.page.evaluate("(t) => window.eomgen.goTo(t)", t)
        self.drawn()

    def drawn(self) -> None:
        """Wait for two pictures."""
        self.page.evaluate(
            "() => new Promise((f) => requestAnimationFrame(() => requestAnimationFrame(f)))"
        )

    def until(self, condition: str, given: Any = None) -> None:
        """Wait for a condition of the page."""
        self.page.wait_for_function(condition, arg=given, timeout=PATIENCE)

    def size(self) -> tuple[float, float]:
        """Width and height of the picture, CSS pixels."""
        return tuple(self.page.evaluate("[stage.clientWidth, stage.clientHeight]"))

    def pause(self) -> None:
        """Stop the motion where it is, without moving the pointer."""
        self.page.evaluate("() => { if (window.eomgen.playing) play.click(); }")
        assert not self.playing

    def go_live(self) -> None:
        """At the start of a live motion that stands."""
        if self.mode != "live":
            self.page.click("#mode-live")
        self.pause()
        self.page.click("#restart")


@contextmanager
def opened(
    browser: Any, path: Path, size: tuple[int, int] = DESK, **options: Any
) -> Iterator[Opened]:
    """A page that stands still at the start of its run. It says and asks for nothing by itself."""
    width, height = size
    context = browser.new_context(viewport={"width": width, "height": height}, **options)
    page = context.new_page()
    page.set_default_timeout(PATIENCE)
    found = Opened(page, path)
    page.on("console", lambda m: found.said.append(m.text) if m.type == "error" else None)
    page.on("pageerror", lambda error: found.said.append(str(error)))
    page.on("dialog", lambda dialog: (found.said.append(dialog.message), dialog.dismiss()))
    page.on("request", lambda request: found.asked.append(request.url))
    page.goto(f"{path.resolve().as_uri()}#still")
    try:
        yield found
        assert not found.said, found.said
        assert len(found.asked) == 1, found.asked
    finally:
        context.close()


# ---- What a page must do; `run` is the run that it shows ----


def rows_of(run: Run) -> list[int]:
    """Samples at about equal distances, that are not at an event: a page shows its last row."""
    rows = np.linspace(0, len(run.t) - 1, TIMES).round().astype(int)
    return [int(np.searchsorted(run.t, run.t[row], side="right")) - 1 for row in rows]


def on_screen(run: Run, rows: list[int], size: tuple[float, float]) -> tuple[np.ndarray, ...]:
    """Centres of mass (n, nb, 2), and lowest and highest corner (n, 2) of all bodies, as the camera
    of the run's picture shows them in a canvas, CSS pixels right and up from its middle.
    """
    camera = run.motion.camera
    eye = (
        np.eye(3)
        if run.motion.dimensions == 2
        else eye_axes(camera.azimuth_deg, camera.elevation_deg)
    )
    bounds = bounds_of(run.motion.shapes, run.motion.poses, eye, rows)
    center = np.zeros(run.motion.dimensions) if camera.center is None else np.array(camera.center)
    middle = (eye[: len(center), : len(center)] @ center)[:2]
    focus = np.tile(middle, (len(rows), 1))
    if camera.follow is not None:
        focus = focus + bounds.centres[:, run.motion.bodies.index(camera.follow)]
    width, height = size
    scale = min(height / camera.height, width / (camera.width or NARROW * camera.height))
    centres = (bounds.centres - focus[:, None]) * scale
    return centres, (bounds.low - focus) * scale, (bounds.high - focus) * scale


def check_places(opened: Opened, run: Run, filled: float = FILLED) -> float:
    """At ten times bodies are where the state has them, within a pixel, all within the picture, of
    which they fill a part in the course of these times. Returns that part.
    """
    rows, size = rows_of(run), opened.size()
    centres, low, high = on_screen(run, rows, size)
    half = np.array(size) / 2
    for k, row in enumerate(rows):
        opened.at(float(run.t[row]))
        shown = (np.array(opened.screen) - half) * [1, -1]
        off = np.abs(shown - centres[k]).max()
        assert off <= 1, f"at t = {run.t[row]} a body is {off:.1f} pixels away"
        assert (low[k] >= -half - 1).all() and (high[k] <= half + 1).all(), (
            f"at t = {run.t[row]} bodies reach beyond the picture"
        )
    part = float(((high.max(axis=0) - low.min(axis=0)) / size).max())
    assert part >= filled, f"bodies fill only {part:.2f} of the picture"
    return part


def check_playing(opened: Opened) -> None:
    """It plays, pauses, and stands."""
    opened.at(0.0)
    opened.page.click("#play")
    opened.until("() => window.eomgen.playing && window.eomgen.time > 0.02")
    opened.page.click("#play")
    before = opened.time
    opened.drawn()
    assert opened.time == before and not opened.playing


def check_scrubbing(opened: Opened, run: Run) -> None:
    """The slider of time leads to the state there."""
    row = rows_of(run)[-4]
    opened.page.locator("#time").evaluate(
        "(e, t) => { e.value = t; e.dispatchEvent(new Event('input')); }", float(run.t[row])
    )
    opened.drawn()
    assert abs(opened.time - run.t[row]) < 1e-9
    expected = run.motion.places[row]
    size = np.abs(run.motion.places).max() + run.motion.camera.height
    assert np.abs(np.array(opened.centers) - expected).max() < 1e-4 * size


STEPS = "(n) => { for (let k = 0; k < n; k += 1) forth.click(); }"


def check_slider(opened: Opened, steps: int = 5) -> str:
    """A slider of a parameter or an input changes the live motion. Returns its name."""
    opened.go_live()
    opened.page.evaluate(STEPS, steps)
    first = np.array(opened.state)
    for slider in opened.page.locator(
        "#parameters input[type=range], #inputs input[type=range]"
    ).all():
        before = slider.input_value()
        move = "(e, x) => { e.value = x; e.dispatchEvent(new Event('input')); }"
        slider.evaluate(move, 0.5)
        opened.page.click("#restart")
        opened.page.evaluate(STEPS, steps)
        change = np.abs(np.array(opened.state) - first).max()
        changed = change > 1e-10 * np.abs(first).max()
        slider.evaluate(move, before)
        opened.page.evaluate("document.querySelectorAll('.undo').forEach((e) => e.click())")
        if changed:
            return str(slider.get_attribute("data-name"))
    raise AssertionError("no slider changes the motion")


ALONE = """async (end) => {
  const picture = () => new Promise((f) => requestAnimationFrame(() => requestAnimationFrame(f)));
  const where = async () => { await picture(); return window.eomgen.centers; };
  const shown = [];
  while (window.eomgen.time < end - 1e-9) {
    const last = window.eomgen.time + 2 * (window.eomgen.step.seconds ?? 0) >= end;
    if (last) shown.push(await where());
    forth.click();
  }
  shown.push(await where());
  return shown.slice(-2);
}"""
"""Makes the steps of a motion up to a time; where bodies are before and after it."""


def check_dragging(opened: Opened) -> None:
    """A body that is dragged moves otherwise than if it is left alone."""
    opened.go_live()
    opened.drawn()
    spot = opened.page.evaluate(
        """() => { for (const [x, y] of window.eomgen.screen) {
             const hit = window.eomgen.pick(x, y);
             if (hit) return [hit.body, x, y];
           } return null; }"""
    )
    assert spot is not None, "no body is where its centre of mass is"
    body, x, y = spot
    box = opened.page.locator("#stage").bounding_box()
    mouse = opened.page.mouse
    mouse.move(box["x"] + x, box["y"] + y)
    mouse.down()
    assert opened.page.locator("#stage").get_attribute("data-grip") == str(body)
    for k in range(1, 6):
        mouse.move(box["x"] + x + 12 * k, box["y"] + y - 12 * k)
        opened.drawn()
    opened.until("() => window.eomgen.time > 0.1 || window.eomgen.error")
    opened.pause()
    pulled, end = np.array(opened.centers), opened.time
    mouse.up()
    assert opened.error is None, opened.error
    opened.page.click("#restart")
    # A method with steps of its own choice comes to other times: it is compared at both beside.
    alone = opened.page.evaluate(ALONE, end)
    away = min(np.abs(np.array(centers) - pulled).max() for centers in alone)
    assert away > 1e-3 * opened.view["height"], f"the pull moved it by {away:.2g} m only"


FOCUS = """() => { const at = document.activeElement;
  return [at?.id || at?.className || '', at === document.body]; }"""


def check_keys(opened: Opened) -> None:
    """Everything by keys alone: time, mode, view, theme, and what Tab leads to."""
    page, press = opened.page, opened.page.keyboard.press
    opened.at(0.0)
    page.locator("body").evaluate("() => document.activeElement.blur()")
    press("End")
    end = opened.time
    press("Home")
    assert opened.time < end
    press("ArrowRight")
    opened.drawn()
    assert 0 < opened.time < end
    press("Space")
    opened.until("() => window.eomgen.playing")
    press("Space")
    assert not opened.playing
    zoom = opened.view["zoom"]
    press("+")
    assert opened.view["zoom"] > zoom
    press("0")
    assert opened.view["zoom"] == zoom
    press("t")
    assert page.evaluate("document.documentElement.dataset.theme") == "dark"
    press("t")
    seen, around = set(), 0
    for _ in range(400):
        press("Tab")
        name, is_body = page.evaluate(FOCUS)
        seen.add(name)
        around += is_body
        if around == 2:  # from where the focus was to the end, and all from the start
            break
    assert {"theme", "stage", "play", "time", "speed"} <= seen, seen
    sliders = [name for name in seen if name.startswith(("parameters-", "inputs-"))]
    if page.evaluate("DATA.live"):
        assert "mode-live" in seen
        if sliders:
            page.focus(f"#{sorted(sliders)[0]}")
            before = opened.parameters + opened.inputs
            press("ArrowRight")
            opened.drawn()
            assert opened.parameters + opened.inputs != before and opened.mode == "live"
        page.focus("#stage")
        press("l")
        press("l")
        assert opened.mode == ("live" if sliders else "replay")


def check_layout(opened: Opened, run: Run) -> None:
    """All that the page has lies in its window or its panels, plots leave no state out, and a
    message of the page covers no scale of arrows.
    """
    page = opened.page
    assert page.evaluate("document.documentElement.scrollHeight <= innerHeight")
    names = page.locator(".plot-name").all_inner_texts()
    assert len(run.states) > 40 or set(run.states) <= set(names), names
    page.evaluate(
        "for (const id of ['message', 'legend']) document.getElementById(id).hidden = false"
    )
    page.evaluate("tools.byId('message').textContent = 'a line '.repeat(40)")
    page.evaluate("tools.byId('legend').innerHTML ||= '<li>1 N</li>'")
    message, legend = (page.locator(f"#{name}").bounding_box() for name in ("message", "legend"))
    assert message["y"] + message["height"] <= legend["y"]


def check_phone(opened: Opened, run: Run) -> None:
    """Nothing is wider than the screen of a phone, and the bodies are in the picture."""
    width = PHONE[0]
    assert opened.page.evaluate("document.documentElement.scrollWidth") <= width
    for name in ("stage", "play", "time", "theme", "fit"):
        box = opened.page.locator(f"#{name}").bounding_box()
        assert box and box["x"] >= 0 and box["x"] + box["width"] <= width, name
    assert opened.size()[0] > 0.85 * width and opened.size()[1] > 150
    check_places(opened, run, filled=0.2)


def check_page(browser: Any, path: Path, run: Run) -> str:
    """All of it, on a page that `run` wrote. Returns a line on what was found."""
    with opened(browser, path) as page:
        part = check_places(page, run)
        check_playing(page)
        check_scrubbing(page, run)
        check_keys(page)
        slider = ""
        if page.page.evaluate("DATA.live"):
            slider = check_slider(page)
            check_dragging(page)
        check_layout(page, run)
    with opened(browser, path, PHONE, has_touch=True, is_mobile=True) as page:
        check_phone(page, run)
    return f"bodies fill {part:.2f}; {slider or 'no live page'}"
