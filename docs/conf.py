"""The site: `sphinx-build docs out/site`; `python tools/site.py` adds the gallery and versions."""

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent.parent / "tools"))
import entry_pages

from eomgen.base.version import __version__

project = "eomgen"
version = release = __version__
extensions = ["myst_parser"]
html_theme = "furo"
html_title = f"eomgen {release}"
myst_heading_anchors = 3
# Links to files of the repository that are no pages stay as they are.
suppress_warnings = ["myst.xref_missing"]
exclude_patterns = ["out"]
# The schema of scenes, at a fixed address for editors.
html_extra_path = ["../eomgen/scenes/scene.schema.json"]
html_static_path = ["../templates/derivation/formulas.css"]
html_css_files = ["formulas.css"]


def setup(app: Any) -> None:
    """Formulas of the reference are drawn by the browser, without a script from elsewhere."""
    app.connect("source-read", with_formulas)
    app.connect("build-finished", accessible)


def with_formulas(_: Any, page: str, source: list[str]) -> None:
    """The text of a page of the reference with MathML in place of TeX."""
    folder, _, name = page.rpartition("/")
    if folder == "reference" and name in entry_pages.ENTRIES:
        source[0] = entry_pages.entry_page(name, entry_pages.as_mathml)


ACCESSIBLE = {
    '<p class="caption" role="heading">': '<p class="caption" role="heading" aria-level="2">',
    '<aside class="sidebar-drawer">': '<aside class="sidebar-drawer" aria-label="All pages">',
    '<aside class="toc-drawer': '<aside aria-label="On this page" class="toc-drawer',
    '<div class="content-icon-container">': (
        '<div class="content-icon-container" role="region" aria-label="View of this page">'
    ),
    "<pre>": '<pre tabindex="0">',
}
"""What the theme leaves out for those who read by ear or without a pointer."""


def accessible(app: Any, _: Any) -> None:
    """Names for the parts of each page, and code that keys can scroll."""
    for file in Path(app.outdir).glob("**/*.html"):
        if "live" in file.parts or "gallery" in file.parts:
            continue
        text = file.read_text("utf-8")
        for before, after in ACCESSIBLE.items():
            text = text.replace(before, after)
        file.write_text(text, "utf-8")
