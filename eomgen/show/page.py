"""A run as one HTML page that plays it, and goes on live, from disk and without a network."""

import base64
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eomgen.base.errors import RunError
from eomgen.base.files import write_whole
from eomgen.base.templating import render, templates_folder
from eomgen.show.drawing_data import drawing_data
from eomgen.show.motion import Array, Motion
from eomgen.show.picture_data import geometry_values

MOST_NUMBERS = 16_000
"""As many numbers of states as a page holds in double precision, or twice as many in single."""
MOST_ROWS, ENOUGH_ROWS = 2000, 500
"""Between rows the page interpolates with the slopes of the motion, so that `ENOUGH_ROWS` show a
usual run; fewer are in double precision only if they are all that the run has.
"""


@dataclass(frozen=True)
class PageCode:
    """The mechanism of a page.

    source  JavaScript source of `const mechanism`
    table   entries of the page's data that describe its arguments and results
    live    whether a page can integrate it
    smooth  whether its derivative at the given inputs is that of the run
    events  contacts that came to rest or lifted: t (s), contact, kind
    y       rows of the run in the table's states, (n, ny); None if the run has these states
    why     why it is not live, or ""
    """

    source: str
    table: Mapping[str, Any]
    live: bool
    smooth: bool = True
    events: tuple[Mapping[str, Any], ...] = ()
    y: Array | None = None
    why: str = ""


def page_data(motion: Motion, code: PageCode) -> dict[str, Any]:
    """All that the page of a motion knows, as tables and lists for JSON.

    Raises `RunError` if no sample is finite.
    """
    drawing, geometry = drawing_data(motion)
    table = dict(code.table)
    names = [state["name"] for state in table["states"]]
    own = list(motion.states) == names
    y = motion.y if code.y is None else code.y
    run = _run(motion, y, code.smooth)
    data: dict[str, Any] = {
        **table,
        "name": motion.name,
        "title": motion.title,
        "heading": motion.heading,
        "dimensions": motion.dimensions,
        "bodies": list(motion.bodies),
        "quaternions": [list(four) for four in motion.quaternions] if own else table["quaternions"],
        "keepsEnergy": motion.keeps_energy,
        "live": code.live,
        "drawing": drawing,
        "run": run | {"events": list(code.events)},
    }
    if not code.live:
        values = {p["name"]: p["value"] for p in table["parameters"]}
        data["geometry"] = geometry_values(geometry, values)
    else:
        data["initial"] = y[np.flatnonzero(np.isfinite(y).all(axis=1))[0]].tolist()
    return data


def render_page(motion: Motion, code: PageCode) -> str:
    """Return the page of a motion, which computes with `code`.

    Raises `RunError` if no sample is finite.
    """
    assert not re.search(r"</script|<!--", code.source, re.IGNORECASE), "would end its script"
    data = page_data(motion, code)
    three = templates_folder() / "page" / "vendor" / "three"
    # The licence asks for itself to be in all copies.
    licence = (three / "LICENSE").read_text(encoding="utf-8").replace("*/", "* /")
    context: Mapping[str, object] = {
        "heading": motion.heading,
        "summary": _summary(motion, data["run"]["rows"]),
        "stopped": motion.stopped,
        "space": motion.dimensions == 3,
        "live": code.live,
        "data": data,
        "mechanism": code.source,
        "steps": _steps() if code.live else "",
        "three": f"/*\n{licence}*/\n{(three / 'three.min.js').read_text(encoding='utf-8')}",
    }
    return render("page", "page.html", context, html=True)


def _steps() -> str:
    """The engine of live pages, printed once for all of them."""
    # Imported here because only live pages need them.
    from eomgen.engine.printed import steps_of_pages
    from eomgen.store import kept_text

    return kept_text("steps of pages", steps_of_pages)


def save_page(motion: Motion, code: PageCode, path: Path, force: bool = False) -> None:
    """Write the page of `render_page` to `path`. Raises `RunError` as both functions do."""
    write_whole(path, render_page(motion, code), force=force)


def _summary(motion: Motion, kept: int) -> str:
    return motion.summary + (f", {kept} of them here" if kept < len(motion.t) else "")


def _run(motion: Motion, y: Array, smooth: bool) -> dict[str, Any]:
    """The finite rows of a run, fewer if there are many."""
    finite = np.flatnonzero(np.isfinite(y).all(axis=1) & np.isfinite(motion.t))
    if not len(finite):
        raise RunError(f"{motion.name}: the run holds no finite sample, so nothing can be shown")
    width = max(1, y.shape[1])
    fits = min(MOST_ROWS, MOST_NUMBERS // width)
    single = fits < min(ENOUGH_ROWS, len(finite))
    rows = _kept(motion.t[finite], min(MOST_ROWS, 2 * fits) if single else fits)
    return {
        "rows": len(rows),
        "t": _packed(motion.t[finite[rows]], "<f8"),
        "y": _packed(y[finite[rows]], "<f4" if single else "<f8"),
        "single": single,
        "smooth": smooth,
    }


def _kept(t: Array, most: int) -> NDArray[np.int64]:
    """Indices of at most about `most` of the rows at times `t`: evenly spread ones, and both rows
    of an event, between which the state jumps.
    """
    most = max(most, 2)
    if len(t) <= most:
        return np.arange(len(t))
    jumps = np.flatnonzero(np.diff(t) == 0.0)
    jumps = jumps[: most // 4]
    even = np.linspace(0, len(t) - 1, most - 2 * len(jumps)).round().astype(int)
    return np.unique(np.concatenate([even, jumps, jumps + 1]))


def _packed(values: Array, kind: str) -> str:
    """Base64 of the values in row-major order, as little-endian numbers of a kind."""
    most = float(np.finfo(np.float32).max)
    numbers = np.clip(values, -most, most) if kind == "<f4" else values
    return base64.b64encode(numbers.astype(kind).tobytes()).decode("ascii")
