"""Links as bodies of a scene."""

from typing import Any

from eomgen.scene.importers.attributes import child, number, vector
from eomgen.scene.importers.rotations import rotated_inertia, rotation
from eomgen.scene.importers.xml_elements import Element

ENTRIES = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
TOLERANCE = 2e-4
"""Part of the trace by which a principal moment may exceed the other two; scenes allow more."""


def body_table(element: Element, name: str, what: str) -> tuple[dict[str, Any], bool]:
    """The table of a link: in its own axes, without mass if it has no inertia; and whether its
    inertia is one that no body can have, which is then not checked.

    Raises `SceneError` for what is missing or negative, or an inertia that is not positive.
    """
    inertial = element.first("inertial")
    if inertial is None:
        zeros = [0.0, 0.0, 0.0]
        return {"name": name, "mass": 0.0, "inertia_com": zeros, "com": zeros}, False
    mass = number(child(inertial, "mass", what), "value", what)
    if mass < 0:
        raise inertial.error(f"{what}: its mass {mass:g} is negative; give a number >= 0")
    given = child(inertial, "inertia", what)
    entries = [number(given, key, what, 0.0 if key[1] != key[2] else None) for key in ENTRIES]
    if mass == 0 and any(entries):
        raise given.error(f"{what}: has an inertia but no mass; give it a mass, or no inertia")
    origin = inertial.first("origin")
    moments = _principal(entries)
    if moments[0] < -1e-9 * max(map(abs, moments)):
        raise given.error(
            f"{what}: its inertia has a principal moment of {moments[0]:.3g} kg m^2, which is "
            "negative; correct the entries"
        )
    table: dict[str, Any] = {
        "name": name,
        "mass": mass,
        "inertia_com": rotated_inertia(entries, rotation(vector(origin, "rpy", what))),
        "com": list(vector(origin, "xyz", what)),
    }
    excess = moments[2] - moments[0] - moments[1]
    strange = excess > TOLERANCE * sum(moments) or moments[0] < 0
    if strange:
        table["inertia_check"] = "off"
    return table, strange


def _principal(entries: list[float]) -> list[float]:
    """The principal moments, in ascending order."""
    import numpy as np  # here, so that reading names does not load it

    xx, yy, zz, xy, xz, yz = entries
    scale = max(map(abs, entries)) or 1.0
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) / scale
    return [float(x) * scale for x in np.linalg.eigvalsh(matrix)]
