"""The first page of a gallery: of each scene a picture, its title, a sentence, and a link."""

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from eomgen.base.templating import render
from eomgen.show.motion import Motion, paths, thinned
from eomgen.show.plane import draw_plane
from eomgen.show.space import draw_space
from eomgen.show.style import METADATA, style
from eomgen.show.view import eye_axes

WIDE, HIGH, DPI = 3.6, 2.7, 120
"""Size of a picture, inches, and its pixels per inch."""
SEEN = 0.4
"""The pose is that after this part of the run."""


@dataclass(frozen=True)
class Exhibit:
    """A scene of a gallery.

    page     name of the file of its page
    size     of that page, bytes
    picture  PNG
    live     whether the page integrates by itself
    stopped  why the run ended early, or ""
    """

    name: str
    title: str
    about: str
    page: str
    size: int
    picture: bytes
    live: bool
    stopped: str = ""


def thumbnail(motion: Motion) -> bytes:
    """A small picture of a motion, as PNG: the mechanism and the paths of its bodies; in the plane
    also where it was before, unless the camera follows it.

    Raises `RunError` if no sample is finite.
    """
    whole = thinned(motion)
    last = round(SEEN * (len(whole.t) - 1))
    before = _rows(whole, np.arange(_first(whole, last), last + 1))
    single = whole.camera.mode == "follow" or whole.dimensions == 3
    with style():
        figure = Figure(figsize=(WIDE, HIGH), dpi=DPI, facecolor=whole.camera.background)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), facecolor=whole.camera.background)
        if whole.dimensions == 2:
            draw_plane(axes, _rows(whole, np.array([last])) if single else before)
        else:
            draw_space(axes, _rows(whole, np.array([last])))
            _draw_paths(axes, before)
        for cross in axes.child_axes:
            cross.remove()
        axes.set_axis_off()
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=DPI, metadata=METADATA[".png"])
    return buffer.getvalue()


def _first(motion: Motion, last: int) -> int:
    """The sample from which to `last` no body moves farther than the picture is high, or as far."""
    moved = np.linalg.norm(np.diff(motion.places[: last + 1], axis=0), axis=-1).max(axis=1)
    way = np.cumsum(moved[::-1])
    return last - int(np.searchsorted(way, motion.camera.height))


def _draw_paths(axes: Axes, motion: Motion) -> None:
    """The paths in space, unless the camera follows a body: then they lead out of the picture."""
    if motion.camera.mode == "follow":
        return
    eye = eye_axes(motion.camera.azimuth_deg, motion.camera.elevation_deg)
    for path, colour in paths(motion):
        seen = path @ eye.T
        axes.plot(seen[:, 0], seen[:, 1], color=colour, linewidth=0.8, alpha=0.5, zorder=2)


def _rows(motion: Motion, rows: NDArray[np.int_]) -> Motion:
    """Some samples of a motion."""
    return replace(
        motion,
        t=motion.t[rows],
        y=motion.y[rows],
        poses=motion.poses[rows],
        kinetic_energy=motion.kinetic_energy[rows],
        potential_energy=motion.potential_energy[rows],
        joint_drift=motion.joint_drift[rows],
        works=None,
    )


def gallery_page(exhibits: Sequence[Exhibit]) -> str:
    """The page that shows exhibits in their order. It has no script and loads nothing."""
    shown = [
        {
            "title": exhibit.title or exhibit.name,
            "about": exhibit.about,
            "page": exhibit.page,
            "picture": base64.b64encode(exhibit.picture).decode("ascii"),
            "facts": _facts(exhibit),
            "stopped": exhibit.stopped,
        }
        for exhibit in exhibits
    ]
    return render("gallery", "gallery.html.jinja", {"exhibits": shown}, html=True)


def _facts(exhibit: Exhibit) -> str:
    return f"{exhibit.name} · {'live' if exhibit.live else 'replay'} · {megabytes(exhibit.size)}"


def megabytes(size: int) -> str:
    """A number of bytes in words."""
    return f"{size / 1e6:.2f} MB"
