"""Draws the pictures of live pages in docs/pictures.md: `python tools/page_pictures.py`.

It needs Playwright and Chromium, whose path may be in CHROMIUM.
"""

import os
import shutil
import tempfile
from pathlib import Path
from typing import Any

import eomgen
from eomgen.show.page import save_page

FOLDER = Path(__file__).parent.parent / "docs" / "pictures"
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
SIZE = {"width": 1080, "height": 640}
STEPS = "(n) => { for (let k = 0; k < n; k += 1) forth.click(); }"


def equations(page: Any) -> None:
    """A crank and its rocker with the terms of gravity marked."""
    page.evaluate("eomgen.goTo(0.7)")
    page.locator("button.term[data-effect=gravity]").first.click()


def comparison(page: Any) -> None:
    """A double pendulum, and the same with a lighter upper rod."""
    page.click("#mode-live")
    page.evaluate("() => { if (eomgen.playing) play.click(); }")
    page.click("#restart")
    page.click("#keep")
    field = page.locator("#parameters .field").first
    field.fill("0.8")
    field.press("Enter")
    page.evaluate(STEPS, 700)
    for name in ("equations", "poses"):
        page.locator(f"#{name}-panel").evaluate("(e) => { e.open = false; }")
    page.select_option(".plots-bar select", "2")


def phase(page: Any) -> None:
    """The linkage, set to a point of its phase plane and let go."""
    page.locator("#equations-panel").evaluate("(e) => { e.open = false; }")
    page.get_by_text("+ Phase portrait").click()
    plot = page.locator(".plot").last
    plot.get_by_text("Set state").click()
    over = plot.locator(".u-over").bounding_box()
    page.mouse.click(over["x"] + 0.15 * over["width"], over["y"] + 0.35 * over["height"])
    page.evaluate(STEPS, 200)
    for _ in range(2):  # what is above leaves the sight of it
        page.locator(".plot").first.get_by_role("button", name="Remove this plot").click()


PICTURES = {
    "page_equations": ("four_bar", equations),
    "page_comparison": ("double_pendulum", comparison),
    "page_phase": ("four_bar", phase),
}


def main() -> None:
    """Write the pictures."""
    from playwright.sync_api import sync_playwright

    chromium = os.environ.get("CHROMIUM") or shutil.which("chromium")
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as folder:
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        for name, (scene, act) in PICTURES.items():
            path = Path(folder) / f"{name}.html"
            run = eomgen.simulate(scene, t_end=2.0, samples=201)
            save_page(run.motion, run.page(), path)
            page = browser.new_page(viewport=SIZE)
            page.goto(f"{path.as_uri()}#still")
            act(page)
            page.wait_for_timeout(500)
            page.screenshot(path=FOLDER / f"{name}.png")
            page.close()
        browser.close()


if __name__ == "__main__":
    main()
