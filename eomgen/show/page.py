"""A motion as one HTML page that plays it: no network, no second file, opens from disk."""

import base64
import re
from pathlib import Path

from eomgen.files import write_whole
from eomgen.show.motion import Array, Motion, thinned
from eomgen.templating import render


def render_page(motion: Motion, poses_source: str, parameters: tuple[float, ...]) -> str:
    """Return the page that plays `motion` from its state vector.

    `poses_source` is the JavaScript text of `function bodyPoses(y, p)`, which returns
    `[[x, y, angle], …]` (m, m, rad) of the bodies from the state `y` (ny,) and `parameters` `p`;
    the page calls it for every picture it draws. Arrays lie in the page as float64, bit for bit.
    Raises `RunError` if no sample is finite.
    """
    assert not re.search(r"</script|<!--", poses_source, re.IGNORECASE), "would end its script"
    shown = thinned(motion)
    kept, camera = len(shown.t), motion.camera
    run = {
        "states": motion.states,
        "units": motion.units,
        "shapes": [[shape.model_dump() for shape in shapes] for shapes in motion.shapes],
        "anchors": motion.anchors,
        "camera": {
            "center": camera.center,
            "height": camera.height,
            "follow": None if camera.follow is None else motion.bodies.index(camera.follow),
            "background": camera.background,
        },
        "parameters": parameters,
        "t": _packed(shown.t),
        "y": _packed(shown.y),
        "kinetic": _packed(shown.kinetic_energy),
        "potential": _packed(shown.potential_energy),
    }
    context = {
        "heading": motion.heading,
        "summary": motion.summary + (f", {kept} of them here" if kept < len(motion.t) else ""),
        "stopped": motion.stopped,
        "run": run,
        "poses_source": poses_source,
    }
    return render("page", "page.html", context, html=True)


def save_page(
    motion: Motion,
    poses_source: str,
    parameters: tuple[float, ...],
    path: Path,
    force: bool = False,
) -> None:
    """Write the page of `render_page` to `path`; raises `RunError` as `write_whole` does."""
    write_whole(path, render_page(motion, poses_source, parameters), force=force)


def _packed(values: Array) -> str:
    """Base64 of the float64 values, row after row, least byte first."""
    return base64.b64encode(values.astype("<f8").tobytes()).decode("ascii")
