"""The style of all figures, and how they are written: with the same bytes on every machine."""

import io
import re
import warnings
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import matplotlib.style
import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from eomgen.base.errors import RunError
from eomgen.base.files import check_writable, write_whole

# Paul Tol's bright scheme: distinguishable by colour-blind people, and mostly in grey.
PALETTE = ("#4477aa", "#ee6677", "#228833", "#aa3377", "#ccbb44", "#66ccee")
INK, FAINT, ALARM = "#222222", "#666666", "#a02c1c"

STYLE = {
    "font.family": ["DejaVu Sans"],  # comes with Matplotlib: the same font on every machine
    "font.size": 9.5,
    "mathtext.fontset": "dejavusans",
    "text.color": INK,
    "axes.edgecolor": "#999999",
    "axes.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.7,
    "lines.linewidth": 1.4,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.major.size": 0,
    "ytick.major.size": 0,
    "ytick.minor.size": 0,
    "legend.frameon": False,
    "legend.handlelength": 1.2,
    "savefig.dpi": 150,
    "svg.hashsalt": "eomgen",  # without a salt, the ids in an SVG are random
}

PAPER = {
    **STYLE,
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "axes.labelsize": 8.0,
    "axes.linewidth": 0.5,
    "grid.linewidth": 0.4,
    "lines.linewidth": 1.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.fontsize": 7.0,
    "savefig.dpi": 300,
    "pdf.fonttype": 42,  # TrueType: some journals refuse Type 3
}
"""The style of figures in a paper, where they are printed in the size that they are drawn in."""

METADATA: dict[str, dict[str, str | None]] = {
    ".png": {"Software": "eomgen"},
    ".svg": {"Creator": "eomgen", "Date": None},
    ".pdf": {"Creator": "eomgen", "CreationDate": None},
}
PDF_MARK = b"% eomgen figure\n"
"""A comment near the start of a PDF, by which `files` knows it: its metadata come at its end."""


class _MarkedPdf(io.BytesIO):
    """Takes what Matplotlib writes, and adds the mark after the second line of a PDF, which says
    that the rest is binary. Positions in the file are counted by `tell`, so they stay right.
    """

    def write(self, data: Any) -> int:
        count = super().write(data)
        if bytes(data[:2]) == b"%\xac":
            super().write(PDF_MARK)
        return count


def style(paper: bool = False) -> AbstractContextManager[None]:
    """A context with our style over Matplotlib's defaults, whatever the user's settings."""
    return matplotlib.style.context(["default", PAPER if paper else STYLE])


def check_figure(path: Path, *, force: bool = False) -> None:
    """Raise `RunError` if `path` has no suffix of a figure, or may not be written."""
    if path.suffix.lower() not in METADATA:
        raise RunError(
            f"{path}: a figure is written as .png, .svg or .pdf; '{path.suffix}' is none of them"
        )
    check_writable(path, force=force)


def write_figure(figure: Figure, path: Path, *, force: bool = False, paper: bool = False) -> None:
    """Write `figure`, drawn in the style of a `paper` or not, to `path`.

    Raises `RunError` as `check_figure` and `write_whole` do.
    """
    check_figure(path, force=force)
    suffix = path.suffix.lower()
    buffer = _MarkedPdf()
    with style(paper), warnings.catch_warnings():
        # A title in a script that the font lacks shows boxes, but the figure is still useful.
        warnings.filterwarnings("ignore", message=r"Glyph \d+ .* missing from font")
        _settle(figure)
        figure.savefig(buffer, format=suffix[1:], metadata=METADATA[suffix])
    write_whole(path, buffer.getvalue(), force=force)


def _settle(figure: Figure) -> None:
    """Lay the panels out and fix their positions.

    The last digits of the constrained layout depend on addresses in memory. Positions are rounded
    far above those digits and far below a pixel, so that files are the same every time.
    """
    engine = figure.get_layout_engine()
    if engine is None:
        return
    engine.execute(figure)
    figure.set_layout_engine("none")
    for axes in figure.axes:
        axes.set_position(Bbox(axes.get_position().get_points().round(6)))


def colours(count: int) -> list[str]:
    """Return `count` colours: from the palette if it has enough, else from a colour map."""
    if count <= len(PALETTE):
        return list(PALETTE[:count])
    return [to_hex(colour) for colour in colormaps["viridis"](np.linspace(0.0, 0.92, count))]


def mixed(paper: str, colour: str, share: float) -> str:
    """A mixture of `share` parts `colour` and the rest `paper`."""
    pairs = zip(to_rgb(paper), to_rgb(colour), strict=True)
    red, green, blue = ((1 - share) * below + share * above for below, above in pairs)
    return to_hex((red, green, blue))


def ink_on(paper: str) -> str:
    """A colour that contrasts with `paper`."""
    return INK if np.dot(to_rgb(paper), (0.2126, 0.7152, 0.0722)) > 0.4 else "#eeeeee"


GREEK = re.compile(
    "alpha|beta|gamma|delta|epsilon|zeta|eta|theta|iota|kappa|lambda|mu|nu|xi|pi|rho|sigma|tau|"
    "upsilon|phi|chi|psi|omega|Gamma|Delta|Theta|Lambda|Xi|Pi|Sigma|Upsilon|Phi|Psi|Omega"
)


def symbol(name: str) -> str:
    r"""Return `name` as mathtext: `phi_dot` as $\dot{\phi}$, `x_A` as $x_{A}$, `q1` as $q_{1}$.

    A text that is not an identifier is returned as plain text with its dollar signs escaped.
    """
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        return plain(name)
    head, *subscripts = [part for part in name.split("_") if part]
    accents = [part for part in subscripts[-1:] if part in ("dot", "ddot")]
    subscripts = subscripts[: len(subscripts) - len(accents)]
    split = re.fullmatch(r"([A-Za-z]+)(\d+)", head)
    if split:
        head, subscripts = split[1], [split[2], *subscripts]
    text = _letters(head)
    for accent in accents:
        text = rf"\{accent}{{{text}}}"
    if subscripts:
        text += "_{" + ",".join(map(_letters, subscripts)) + "}"
    return f"${text}$"


def _letters(word: str) -> str:
    if GREEK.fullmatch(word):
        return rf"\{word}"
    return word if len(word) == 1 or word.isdigit() else rf"\mathrm{{{word}}}"


def plain(text: str) -> str:
    """`text` escaped so that Matplotlib shows it unchanged, not as mathtext."""
    return text.replace("$", r"\$")
