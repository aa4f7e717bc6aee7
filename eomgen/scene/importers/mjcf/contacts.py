"""Contacts of geoms with the planes of the world as soft contacts of a scene.

MuJoCo's contact is a soft constraint: the acceleration a of the gap g meets a + R f = -b ġ - k d g
for its force f (documentation, "Computation", section "Parameters"), where d is the impedance,
R = (1 - d)/d A with the inverse A of the mass that the body of the geom has there, and b and k
follow from `solref`. Where a is small beside the right side, as at rest, this is the law
f = -K g - C ġ with K = k d²/((1 - d) A). d depends on the depth (`solimp`); K is taken where it
carries half of the weight of all bodies. A pyramid of friction has 2 (condim - 1) edges, each with
A (1 + μ²) and R of 2 μ²/impratio times that, whose forces add up: K is the larger by
impratio (condim - 1)/(μ² (1 + μ²)). C is such that K, C and the mass 1/A have the damping
ratio of b and k.
"""

import math
from typing import Any

import numpy as np

from eomgen.scene.importers import contacts as shapes
from eomgen.scene.importers.contacts import Contacts
from eomgen.scene.importers.mjcf.compiled import Compiled
from eomgen.scene.importers.mjcf.mechanism import Mechanism, Names
from eomgen.scene.importers.mjcf.poses import angles, matrix_of
from eomgen.scene.importers.mjcf.shapes import (
    BOX,
    CAPSULE,
    CYLINDER,
    DEGREES,
    ELLIPSOID,
    MESH,
    PLANE,
    SPHERE,
)
from eomgen.scene.importers.names import identifiers
from eomgen.scene.importers.rotations import image

NO_CONTACT = 1 << 4
"""MuJoCo's disable flag (mjtDisableBit)."""
KINDS = {
    SPHERE: "sphere",
    CAPSULE: "capsule",
    ELLIPSOID: "ellipsoid",
    CYLINDER: "cylinder",
    BOX: "box",
    MESH: "mesh",
}
PYRAMID = 0
"""MuJoCo's pyramidal cone of friction (mjtCone)."""
LEAST = 1e-4
"""MuJoCo's least impedance, mjMINIMP."""
DIGITS = 6
"""Significant digits of what is computed here."""


def add_contacts(model: Compiled, names: Names, made: Mechanism) -> None:
    """The contacts of geoms with planes of the world, and remarks."""
    found, off = Contacts(), bool(model["opt_disableflags"] & NO_CONTACT)
    planes = [g for g in _geoms(model, 0) if model["geom_type"][g] == PLANE]
    called = identifiers((model.names["geom"][g] for g in planes), "ground")
    for plane in planes:
        for k in range(1, model["nbody"]):
            for g in _geoms(model, k) if not off else ():
                if not _touch(model, plane, g):
                    continue
                kind = model["geom_type"][g]
                if kind not in KINDS:
                    found.lost["fields of heights and distance functions"] += 1
                    continue
                law = _law(model, plane, g, k)
                name = f"{called[model.names['geom'][plane]]}_{names.bodies[k]}"
                keys = {"name": name, **_half_space(model, plane), **law}
                found.add(keys, names.bodies[k], KINDS[kind], _shapes(model, plane, g, found))
    found.effects(made)
    pairs = sum(
        _touch(model, a, b)
        for a in range(model["ngeom"])
        for b in range(a)
        if PLANE not in (model["geom_type"][a], model["geom_type"][b])
    )
    if pairs and not off:
        found.lost["pairs of geoms that are no planes"] = pairs
    for remark in found.remarks():
        made.remark(remark)


def _geoms(model: Compiled, body: int) -> range:
    first = model["body_geomadr"][body]
    return range(first, first + model["body_geomnum"][body])


def _touch(model: Compiled, a: int, b: int) -> bool:
    """Whether two geoms may touch: by their bits, their bodies, and pairs that are excluded.

    Bodies that are welded together do not touch, nor do those that a joint connects, unless one of
    them is of the world.
    """
    types, with_ = model["geom_contype"], model["geom_conaffinity"]
    if not (types[a] & with_[b] or types[b] & with_[a]):
        return False
    bodies = [model["geom_bodyid"][g] for g in (a, b)]
    first, second = (model["body_weldid"][body] for body in bodies)
    above = [model["body_weldid"][model["body_parentid"][weld]] for weld in (first, second)]
    low, high = sorted(bodies)
    if first == second or (low << 16) + high in model["exclude_signature"]:
        return False
    return not (first and second) or not (above[0] == second or above[1] == first)


def _half_space(model: Compiled, plane: int) -> dict[str, Any]:
    normal = image(matrix_of(model["geom_quat"][plane]), (0.0, 0.0, 1.0))
    offset = math.fsum(n * x for n, x in zip(normal, model["geom_pos"][plane], strict=True))
    found: dict[str, Any] = {} if normal == (0.0, 0.0, 1.0) else {"normal": list(normal)}
    return found | ({"offset": offset} if offset else {})


def _law(model: Compiled, a: int, b: int, body: int) -> dict[str, float]:
    """Stiffness, damping and friction between two geoms, of which `b` is one of the body."""
    first, second = (model["geom_priority"][g] for g in (a, b))
    share = model["geom_solmix"][a], model["geom_solmix"][b]
    part = share[0] / sum(share) if sum(share) else 0.5
    part = part if first == second else float(first > second)

    def mixed(key: str) -> Any:
        return np.dot([part, 1 - part], [model[key][a], model[key][b]])

    high = [g for g, priority in ((a, first), (b, second)) if priority == max(first, second)]
    friction = max(model["geom_friction"][g][0] for g in high)
    condim = max(model["geom_condim"][g] for g in high)
    friction = friction if condim > 1 else 0.0
    solimp = mixed("geom_solimp")
    most = min(max(solimp[1], LEAST), 1 - LEAST)
    time, ratio = mixed("geom_solref")
    if time > 0:
        time = max(time, 2 * model["opt_timestep"])
        k = 1 / (most * time * ratio) ** 2
    else:
        k = -time / most**2
        ratio = -ratio / most / (2 * math.sqrt(k))
    mass = 1 / model["body_invweight0"][body][0]
    load = math.hypot(*model["opt_gravity"]) * sum(model["body_mass"]) / 2 or mass
    edges = 1.0
    if friction and model["opt_cone"] == PYRAMID:
        edges = model["opt_impratio"] * (condim - 1) / (friction**2 * (1 + friction**2))
    stiffness = _stiffness(k * mass * edges, solimp, load)
    found = {"stiffness": stiffness, "damping": 2 * ratio * math.sqrt(stiffness * mass)}
    return {**{key: float(f"{x:.{DIGITS}g}") for key, x in found.items()}, "friction": friction}


def _stiffness(k: float, solimp: Any, load: float) -> float:
    """K = k d²/(1 - d), N/m, at the depth where it carries a load, N, by bisection."""
    low, high = 0.0, 1.0

    def at(depth: float) -> float:
        d = _impedance(solimp, depth)
        return k * d * d / (1 - d)

    while high - low > 1e-9:
        middle = (low + high) / 2
        low, high = (low, middle) if at(middle) * middle > load else (middle, high)
    return at(high)


def _impedance(solimp: Any, depth: float) -> float:
    """MuJoCo's d at a depth, m: from one value to another within a width, by two powers."""
    first, last, width, middle, power = solimp
    x = min(depth / max(width, LEAST**2), 1.0)
    middle, power = min(max(middle, LEAST), 1 - LEAST), max(power, 1.0)
    if x <= middle:
        part = x**power / middle ** (power - 1)
    else:
        part = 1 - (1 - x) ** power / (1 - middle) ** (power - 1)
    return float(min(max(first + part * (last - first), LEAST), 1 - LEAST))


def _shapes(model: Compiled, plane: int, g: int, found: Contacts) -> list[shapes.Table]:
    """The shapes of a geom, larger by the margins of both: MuJoCo's contacts act from there."""
    kind, (a, b, c) = model["geom_type"][g], model["geom_size"][g]
    at, quat = model["geom_pos"][g], model["geom_quat"][g]
    turn = matrix_of(quat)
    margin = math.fsum(model["geom_margin"][x] - model["geom_gap"][x] for x in (plane, g))
    degrees = [DEGREES * angle for angle in angles(quat)]
    arm = image(turn, (0.0, 0.0, b))
    ends = np.subtract(at, arm).tolist(), np.add(at, arm).tolist()
    match kind:
        case _ if kind == SPHERE:
            tables = shapes.sphere(at, a)
        case _ if kind == CAPSULE:
            tables = shapes.capsule(*ends, a)
        case _ if kind == CYLINDER:
            tables = shapes.cylinder(*ends, a)
        case _ if kind == ELLIPSOID:
            tables = shapes.ellipsoid(at, (a, b, c), degrees)
        case _ if kind == BOX:
            tables = shapes.box(at, (a, b, c), degrees)
        case _:
            tables = [found.hull(_corners(model, g) @ np.array(turn).T + at)]
    if margin:
        tables = [table | {"radius": table.get("radius", 0.0) + margin} for table in tables]
    return tables


def _corners(model: Compiled, g: int) -> shapes.Array:
    """The vertices of a geom's mesh."""
    mesh = model["geom_dataid"][g]
    first, count = model["mesh_vertadr"][mesh], model["mesh_vertnum"][mesh]
    return np.array(model["mesh_vert"][first : first + count], dtype=float)
