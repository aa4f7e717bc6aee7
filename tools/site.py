"""Build the site for a host: python tools/site.py [OUT] [SCENE ...]

OUT (out/site) gets a folder for this version, with the pages, their inventory `objects.inv`, the
live gallery of the scenes (all built-in ones), the live pages of the course and of the reference,
and an `index.html` that leads to all versions that are there, the newest first. Copy OUT to any
host of static files.
`pip install -e '.[docs]'` brings what it needs.
"""

import re
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).parent.parent
PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta http-equiv="refresh" content="0; url={newest}/index.html">
<title>eomgen</title>
<h1>eomgen</h1>
<ul>
{items}
</ul>
</html>
"""


def main() -> None:
    """Build; see above."""
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "out" / "site"
    sys.path.insert(0, str(ROOT))
    from eomgen.base.version import __version__

    folder = out / __version__
    python = [sys.executable, "-m"]
    subprocess.run([*python, "sphinx", "-W", "-q", ROOT / "docs", folder], check=True)
    scenes = ["--scene", *sys.argv[2:]] if len(sys.argv) > 2 else []
    gallery = [*python, "eomgen", "gallery", "-o", folder / "gallery", "--force", *scenes]
    subprocess.run(gallery, cwd=ROOT, check=True)
    import entry_pages
    import pages

    own = [name for name in pages.LESSONS if name not in pages.BUILT_IN_LESSONS]
    live(folder / "course" / "live", map(pages.lesson_scene, own))
    live(folder / "reference" / "live", map(entry_pages.scene_text, entry_pages.ENTRIES))
    known = [path.parent.name for path in out.glob("*/objects.inv")]
    known.sort(key=lambda name: [int(part) for part in re.findall(r"\d+", name)], reverse=True)
    items = "\n".join(f'<li><a href="{name}/index.html">{name}</a></li>' for name in known)
    (out / "index.html").write_text(PAGE.format(newest=known[0], items=items), "utf-8")


def live(folder: Path, scenes: Iterable[str]) -> None:
    """The live pages of scenes that are given as text."""
    import eomgen

    folder.mkdir(parents=True, exist_ok=True)
    eomgen.gallery(folder, list(scenes), force=True)


if __name__ == "__main__":
    main()
