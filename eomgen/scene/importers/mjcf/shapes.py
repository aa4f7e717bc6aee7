"""Geoms of a compiled model as shapes of pictures."""

from typing import Any

from eomgen.scene.importers.mjcf.compiled import Compiled
from eomgen.scene.importers.mjcf.mechanism import Mechanism
from eomgen.scene.importers.mjcf.poses import angles, line_of, matrix_of
from eomgen.scene.importers.rotations import image

PLANE, HEIGHTS, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH, SDF = range(9)
"""MuJoCo's geom types (mjtGeom)."""
SHOWN = 3
"""Geoms of groups from this number on are not drawn by MuJoCo's viewer."""
THINNEST = 1e-3
"""Least edge of the box of a mesh, m: a flat one has none."""
DEGREES = 57.29577951308232


def shapes_of(model: Compiled, body: int, made: Mechanism) -> list[dict[str, Any]]:
    """The shapes of a body: its geoms that MuJoCo's viewer draws, or all if it draws none."""
    first = model["body_geomadr"][body]
    every = range(first, first + model["body_geomnum"][body])
    drawn = [g for g in every if model["geom_group"][g] < SHOWN and _rgba(model, g)[3] > 0]
    return [shape for g in (drawn or every) for shape in _shape(model, g, made)]


def _shape(model: Compiled, g: int, made: Mechanism) -> list[dict[str, Any]]:
    """The shape of a geom; none for a plane, and for a field of heights."""
    kind, (a, b, c) = model["geom_type"][g], model["geom_size"][g]
    at, quat = model["geom_pos"][g], model["geom_quat"][g]
    table: dict[str, Any]
    match kind:
        case _ if kind == SPHERE:
            table = {"type": "sphere", "radius": a, "center": at}
        case _ if kind in (CAPSULE, CYLINDER):
            ends = dict(zip(("start", "end"), line_of(at, quat, b), strict=True))
            size = {"width": 2 * a} if kind == CAPSULE else {"radius": a}
            table = {"type": "rod" if kind == CAPSULE else "cylinder", **ends, **size}
        case _ if kind == ELLIPSOID:
            table = {"type": "ellipsoid", "radii": [a, b, c], "center": at} | _turned(quat)
        case _ if kind == BOX:
            table = {"type": "box", "size": [2 * a, 2 * b, 2 * c], "center": at} | _turned(quat)
        case _ if kind in (MESH, SDF):
            bounds = model["geom_aabb"][g]
            arm = image(matrix_of(quat), bounds[:3])
            edges = [max(2 * half, THINNEST) for half in bounds[3:]]
            center = [x + d for x, d in zip(at, arm, strict=True)]
            table = {"type": "box", "size": edges, "center": center} | _turned(quat)
            made.remark("meshes are drawn as the boxes around them")
        case _:
            made.lost["planes and fields of heights"] += 1
            return []
    red, green, blue = (round(255 * min(max(x, 0.0), 1.0)) for x in _rgba(model, g)[:3])
    return [table | {"color": f"#{red:02x}{green:02x}{blue:02x}"}]


def _rgba(model: Compiled, g: int) -> list[float]:
    """The colour of a geom, of its material if it has one."""
    material = model["geom_matid"][g]
    found: list[float] = model["geom_rgba"][g] if material < 0 else model["mat_rgba"][material]
    return found


def _turned(quat: list[float]) -> dict[str, Any]:
    turned = angles(quat)
    return {"orientation_deg": [DEGREES * x for x in turned]} if any(turned) else {}
