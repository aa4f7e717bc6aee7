"""Scenes, models, derivations and runs in a cell of a notebook, as HTML.

Pages are in a frame with their own document, which shares nothing with the notebook: neither its
style nor its scripts.
"""

import base64
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape

from eomgen.base.displays import Displayed
from eomgen.base.errors import RunError
from eomgen.model.model import Model
from eomgen.show.motion import Motion
from eomgen.show.page import PageCode, render_page

DPI = 75
"""Pixels per inch of a run's figure."""
FEW = 30
"""Longer tables are cut off."""
TABLE, CELL = "border-collapse:collapse;margin:.4em 0", "text-align:left;padding:.15em .9em .15em 0"


@dataclass(frozen=True, repr=False)
class Cell(Displayed):
    """What a cell shows.

    html  text of the cell, which holds its pictures and scripts
    """

    html: str

    def _repr_html_(self) -> str:
        return self.html


def framed(page: str, title: str, *, height: int, scripts: bool = False) -> str:
    """A whole HTML page as a frame, `height` pixels high. Its scripts, if it may run any, cannot
    reach the notebook; it may offer files to be saved.
    """
    rights = "allow-scripts allow-downloads" if scripts else ""
    return (
        f'<iframe title="{escape(title)}" sandbox="{rights}" srcdoc="{escape(page)}" '
        f'style="width:100%;height:{height:d}px;border:1px solid #8884;border-radius:6px"></iframe>'
    )


def page_cell(motion: Motion, code: PageCode, height: int) -> Cell:
    """The page of a run. Raises `RunError` if no sample is finite."""
    page = render_page(motion, code)
    return Cell(framed(page, motion.heading, height=height, scripts=True))


def run_html(motion: Motion, report: Mapping[str, object], warnings: Sequence[str]) -> str:
    """The figure of a run, its warnings, and its report behind a click."""
    lines = [line for line in (motion.stopped, *warnings) if line]
    notes = "".join(f"<p>{escape(line)}</p>" for line in lines)
    rows = _table([(name, value) for name, value in report.items() if value != ""])
    figure = _figure(motion) or f"<b>{escape(motion.heading)}</b> {escape(motion.summary)}"
    return f"{notes}{figure}<details><summary>Report</summary>{rows}</details>"


def _figure(motion: Motion) -> str:
    """The figure as an image; nothing if no sample is finite."""
    from eomgen.show.figure import draw_motion
    from eomgen.show.style import style

    try:
        figure = draw_motion(motion)
    except RunError:
        return ""
    buffer = io.BytesIO()
    with style():
        figure.savefig(buffer, format="png", dpi=DPI)
    data = base64.b64encode(buffer.getvalue()).decode("ascii")
    about = escape(f"{motion.heading}: poses, coordinates, energies, errors")
    return f'<img src="data:image/png;base64,{data}" alt="{about}" style="max-width:100%">'


def scene_html(name: str, title: str, about: str = "") -> str:
    """A heading."""
    named = f" <code>{escape(name)}</code>" if title else ""
    sentence = f"<p>{escape(about)}</p>" if about else ""
    return f"<b>{escape(title or name)}</b>{named}{sentence}"


def model_html(model: Model) -> str:
    """The bodies with their joints, the effects, and a sketch at the initial state."""
    place = "in space" if model.dimensions == 3 else "in the plane"
    counts = f"{len(model.bodies)} bodies {place}, {model.freedom}"
    parents = ["world", *(body.name for body in model.bodies)]
    bodies = [
        (
            body.name,
            f"{model.value(body.mass):.6g} kg",
            f"{body.joint.type} {body.joint.name}",
            f"on {parents[body.parent + 1]}",
            ", ".join(c.name for c in body.positions),
        )
        for body in model.bodies
    ]
    effects = [(effect.name, effect.type) for effect in model.effects]
    named = ("body", "mass", "joint", "", "coordinates")
    held = [(each.name, len(each.row_names(model.dimensions))) for each in model.constraints]
    tables = _table(bodies, named) + _table(held, ("constraint", "equations"))
    tables += _table(effects, ("effect", "type"))
    return f"<p>{counts}</p>{tables}{_sketch(model)}"


def _sketch(model: Model) -> str:
    from eomgen.show.drawing import svg  # imports SymPy
    from eomgen.show.sketches import mechanism_sketch

    colours = "--paper:#fff;background:#fff;display:inline-block;border-radius:6px"
    return f'<div style="{colours};font:13px serif">{svg(mechanism_sketch(model, ()))}</div>'


def _table(rows: Iterable[Sequence[object]], names: Sequence[str] = ()) -> str:
    """A table of texts, with `names` of its columns or without; "" if it has no rows."""
    lines = [_row(row, "td") for row in rows]
    if len(lines) > FEW:
        lines[FEW:] = [_row([f"… {len(lines) - FEW} more"], "td")]
    head = [_row(names, "th")] if names else []
    return f'<table style="{TABLE}">{"".join(head + lines)}</table>' if lines else ""


def _row(cells: Sequence[object], kind: str) -> str:
    inner = "".join(f'<{kind} style="{CELL}">{escape(str(cell))}</{kind}>' for cell in cells)
    return f"<tr>{inner}</tr>"
