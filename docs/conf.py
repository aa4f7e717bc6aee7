"""The site: `sphinx-build docs out/site`."""

project = "eomgen"
extensions = ["myst_parser"]
html_theme = "furo"
html_title = "eomgen"
myst_heading_anchors = 3
# Links to files of the repository that are no pages stay as they are.
suppress_warnings = ["myst.xref_missing"]
exclude_patterns = ["out"]
