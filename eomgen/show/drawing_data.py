"""Everything drawn of a motion as data for a page: the picture, the camera and the floor."""

from typing import Any

from eomgen.show.motion import Motion
from eomgen.show.picture_data import Geometry, picture_data
from eomgen.show.solid import solids
from eomgen.show.view import cast_of, floor_under

BUDGET = 2500
"""About how many faces the bodies have by which the lowest point is found."""


def drawing_data(motion: Motion) -> tuple[dict[str, Any], Geometry]:
    """Tables and lists for JSON, and the formulas of parameters and time that they refer to.

    A number is a number, or `{"of": k}`, the k-th of these formulas. Keys:

    bodies, joints, traces, size    of the `Picture`
    marks     frames of its `marks`, each with the index of its symbol; ends: where links are held
    symbols   of marks, each a list of lines
    planes, balls, winds    its elements of these kinds
    camera    mode, center (m, world axes; in mode "follow" from the followed body's centre),
              height and width (m) that it shows at least, follow (an index or null), azimuth,
              elevation (degrees), background (null for the theme's)
    floor     z, step, x, y (m) of a grid; null in the plane
    """
    assert motion.picture is not None, "a motion of a run"
    tables, geometry = picture_data(motion.picture)
    view = motion.camera
    tables["camera"] = {
        "mode": view.mode,
        "center": motion.center.tolist(),
        "height": view.height,
        "width": view.width,
        "follow": None if view.follow is None else motion.bodies.index(view.follow),
        "azimuth": view.azimuth_deg,
        "elevation": view.elevation_deg,
        "background": None if view.themed else view.background,
    }
    tables["floor"] = None
    if motion.dimensions == 3:
        floor = floor_under(motion, cast_of(solids(motion.shapes, view.height, BUDGET)))
        tables["floor"] = {"z": floor.z, "step": floor.step, "x": floor.x, "y": floor.y}
    return tables, geometry
