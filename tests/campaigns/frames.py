"""Pictures a second of pages in headless Chromium, with software in place of a graphics card.

    python tests/campaigns/frames.py PAGE.html … [--seconds 5] [--live]

A page plays meanwhile. It needs the extra `browser` and Chromium, which is at CHROMIUM or at
/usr/bin/chromium.
"""

import argparse
import os
from pathlib import Path

from playwright.sync_api import sync_playwright

FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
COUNT = """(seconds) => new Promise((done) => {
  const [begin, stamps] = [performance.now(), []];
  const tick = (now) => {
    stamps.push(now);
    if (performance.now() - begin < 1000 * seconds) requestAnimationFrame(tick);
    else done((1000 * (stamps.length - 1)) / (stamps[stamps.length - 1] - stamps[0]));
  };
  requestAnimationFrame(tick);
})"""

# Time that the page's own scripts take for a picture, ms; null for pages of another making.
OWN = """() => {
  if (typeof player === "undefined") return null;
  const { t, y, p, u } = player.current();
  const show = { traces: true, joints: true, shadows: true };
  const begin = performance.now();
  for (let i = 0; i < 30; i += 1) player.stage.draw(t, y, p, u, show);
  return (performance.now() - begin) / 30;
}"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("pages", nargs="+", type=Path)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--live", action="store_true", help="integrate in the page")
    parser.add_argument("--no-gl", action="store_true", help="for pages that draw without WebGL")
    given = parser.parse_args()
    flags = ["--no-sandbox", "--disable-gpu"] if given.no_gl else FLAGS
    chromium = os.environ.get("CHROMIUM", "/usr/bin/chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=flags)
        for path in given.pages:
            page = browser.new_page(viewport={"width": 1280, "height": 800})
            page.goto(path.resolve().as_uri())
            page.wait_for_timeout(1000)
            if given.live:
                page.click("#mode-live")
            rate = page.evaluate(COUNT, given.seconds)
            step = page.evaluate("window.eomgen?.step?.ms ?? null") if given.live else None
            cost = f", {step:.3f} ms a step" if step else ""
            own = page.evaluate(OWN)
            scripts = f", {own:.2f} ms a picture by its scripts" if own is not None else ""
            print(f"{path.name}: {rate:.1f} pictures/s{scripts}{cost}")
            page.close()
        browser.close()


if __name__ == "__main__":
    main()
