"""The site: `sphinx-build docs out/site`; `python tools/site.py` adds the gallery and versions."""

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
