"""A motion as one HTML page that plays it, from disk and without a network or other files."""

import base64
import re
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from eomgen.files import write_whole
from eomgen.scene.look import BARE, Shape, number
from eomgen.show.formulas import plain_data
from eomgen.show.motion import Array, Motion, thinned
from eomgen.show.solid import Indices, solids
from eomgen.show.view import AMBIENT, GLOSS, LIGHT, cast_of, floor_under, patches
from eomgen.templating import render

BUDGET = 4000
"""About how many faces all bodies in space have: as many as a browser can draw many times a
second."""


def render_page(motion: Motion, poses_source: str, parameters: tuple[float, ...]) -> str:
    """Return the page that plays `motion` from its state vector.

    `poses_source` is the JavaScript text of `function bodyPoses(y, p, t)`. It returns the poses of
    the bodies from the state `y` (ny,), the `parameters` `p` and the time: in the plane
    `[[x, y, angle], …]` (m, m, rad), in space `[[[r11, r12, r13, x], […], […]], …]`, rows of
    [world_R_body | position] (1, m). The page calls it for each picture. Arrays are embedded as
    exact float64. Raises `RunError` if no sample is finite.
    """
    assert not re.search(r"</script|<!--", poses_source, re.IGNORECASE), "would end its script"
    shown = thinned(motion)
    kept, camera = len(shown.t), motion.camera
    run: dict[str, Any] = {
        "states": motion.states,
        "units": motion.units,
        "colors": motion.colours,
        "traced": motion.traced,
        "anchors": motion.anchors,
        "camera": {
            "center": motion.center.tolist(),
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
    if motion.dimensions == 2:
        run["shapes"] = [[_in_plane(shape) for shape in shapes] for shapes in motion.shapes]
        if motion.planes:
            run["planes"] = [asdict(plane) for plane in motion.planes]
    else:
        run["camera"] |= {"azimuth": camera.azimuth_deg, "elevation": camera.elevation_deg}
        run |= _in_space(shown)
    if motion.balls:
        run["balls"] = [asdict(ball) for ball in motion.balls]
    context = {
        "heading": motion.heading,
        "summary": motion.summary + (f", {kept} of them here" if kept < len(motion.t) else ""),
        "stopped": motion.stopped,
        "space": motion.dimensions == 3,
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
    """Write the page of `render_page` to `path`. Raises `RunError` as both functions do."""
    write_whole(path, render_page(motion, poses_source, parameters), force=force)


def _in_plane(shape: Shape) -> dict[str, Any]:
    """A shape with its centre, which is the origin if the scene gives none."""
    table: dict[str, Any] = plain_data(shape, number)
    table.pop("orientation_deg", None)
    table["color"] = table["color"] or BARE
    if "center" in table:
        table["center"] = table["center"] or [0.0, 0.0]
    return table


def _in_space(motion: Motion) -> dict[str, Any]:
    """Faces of the bodies, floor and light, computed as for the figure."""
    parts = solids(motion.shapes, motion.camera.height, BUDGET)
    floor = floor_under(motion, cast_of(parts))
    squares = patches(motion, floor).tolist()
    return ({"patches": squares} if squares else {}) | {
        "quaternions": motion.quaternions,
        "meshes": [
            {
                "vertices": _packed_single(mesh.vertices),
                "faces": _packed_indices(mesh.faces),
                "across": _packed_indices(mesh.across),
                "thickness": mesh.thickness,
            }
            for mesh in parts.meshes
        ],
        "solids": parts.bodies,
        "floor": {
            "z": floor.z,
            "step": floor.step,
            "lines": floor.lines().tolist(),
            "through_origin": floor.through_origin().tolist(),
        },
        "light": {"toward": LIGHT.tolist(), "ambient": AMBIENT, "gloss": GLOSS},
    }


def _packed(values: Array) -> str:
    """Base64 of the float64 values in row-major order, little-endian."""
    return base64.b64encode(values.astype("<f8").tobytes()).decode("ascii")


def _packed_single(values: Array) -> str:
    """Base64 of the values as float32, precise enough for any screen."""
    most = float(np.finfo(np.float32).max)
    single = np.clip(values, -most, most).astype("<f4")
    return base64.b64encode(single.tobytes()).decode("ascii")


def _packed_indices(values: Indices) -> str:
    """Base64 of the indices as int16; no mesh has more faces than that."""
    assert np.abs(values).max(initial=0) < 2**15
    return base64.b64encode(values.astype("<i2").tobytes()).decode("ascii")
