"""Contacts of geoms with planes and each other as soft contacts of a scene.

MuJoCo's contact is a soft constraint: the acceleration a of the gap g meets a + R f = -b ġ - k d g
for its force f (documentation, "Computation", section "Parameters"), where d is the impedance,
R = (1 - d)/d A with the inverse A of the mass that the bodies of the geoms have there, and b and k
follow from `solref`. Where a is small beside the right side, as at rest, this is the law
f = -K g - C ġ with K = k d²/((1 - d) A). d depends on the depth (`solimp`); K is taken where it
carries half of the weight of all bodies. A pyramid of friction has 2 (condim - 1) edges, each with
A (1 + μ²) and R of 2 μ²/impratio times that, whose forces add up: K is the larger by
impratio (condim - 1)/(μ² (1 + μ²)). C is such that K, C and the mass 1/A have the damping
ratio of b and k.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from eomgen.scene.importers import contacts as shapes
from eomgen.scene.importers.contacts import Contacts
from eomgen.scene.importers.mjcf.compiled import Compiled
from eomgen.scene.importers.mjcf.mechanism import Mechanism, Names
from eomgen.scene.importers.mjcf.poses import angles, cleaned, line_of, matrix_of
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
from eomgen.scene.importers.pairs import Part, Pose, part
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


@dataclass(frozen=True)
class Mixed:
    """What MuJoCo mixes of two geoms, or a `<pair>` says of them."""

    friction: float
    condim: int
    solref: Any
    solimp: Any
    margin: float


def add_contacts(model: Compiled, names: Names, made: Mechanism, *, each_other: bool) -> None:
    """The contacts of geoms with planes, with each other if wished, and remarks."""
    found, off = Contacts(), bool(model["opt_disableflags"] & NO_CONTACT)
    touching = {} if off else _touching(model)
    planes = [g for g in range(model["ngeom"]) if model["geom_type"][g] == PLANE]
    called = identifiers((model.names["geom"][g] for g in planes), "ground")
    pairs = dict[tuple[int, int], Mixed]()
    for (a, b), mixed in touching.items():
        if {model["geom_type"][a], model["geom_type"][b]} - {PLANE} - {*KINDS}:
            found.lost["fields of heights and distance functions"] += 1
        elif PLANE not in (model["geom_type"][a], model["geom_type"][b]):
            pairs[a, b] = mixed
        else:
            plane, g = (a, b) if model["geom_type"][a] == PLANE else (b, a)
            body = names.bodies[model["geom_bodyid"][g]]
            name = f"{called[model.names['geom'][plane]]}_{body}"
            law = _law(model, mixed, _mass(model, a, b))
            keys = {"name": name, **_half_space(model, plane, names), **law}
            found.add(keys, _part(model, g, body, mixed.margin, found))
    if each_other:
        _add_pairs(model, names, pairs, found)
    elif pairs:
        found.lost["pairs of geoms that are no planes"] = len(pairs)
    found.effects(made)
    for remark in found.remarks():
        made.remark(remark)


def _add_pairs(
    model: Compiled, names: Names, pairs: Mapping[tuple[int, int], Mixed], found: Contacts
) -> None:
    """The contacts of geoms with each other. Their masses are rounded to powers of 4, so that many
    share a law.
    """
    parts, unread = list[Part](), Contacts()  # vertices of meshes are not taken here
    for g in range(model["ngeom"]):
        body, kind = names.bodies[model["geom_bodyid"][g]], model["geom_type"][g]
        margin = model["geom_margin"][g] - model["geom_gap"][g]
        known = kind in KINDS and kind != MESH
        parts.append(
            _part(model, g, body, margin, unread) if known else Part(body, "mesh", (), None)
        )

    def law(a: int, b: int) -> dict[str, Any]:
        mass = 4.0 ** round(math.log(_mass(model, a, b), 4))
        return {"name": "self", **_law(model, pairs[a, b], mass)}

    found.add_pairs(parts, pairs, _poses(model, names), law)


def _poses(model: Compiled, names: Names) -> dict[str, Pose]:
    """The poses of all bodies in the file's own position."""
    turns, places = [np.eye(3)], [np.zeros(3)]
    for k in range(1, model["nbody"]):
        above = model["body_parentid"][k]
        turns.append(turns[above] @ np.array(matrix_of(model["body_quat"][k])))
        places.append(places[above] + turns[above] @ np.array(model["body_pos"][k]))
    return dict(zip(names.bodies, zip(turns, places, strict=True), strict=True))


def _touching(model: Compiled) -> dict[tuple[int, int], Mixed]:
    """The geoms that may touch: those of a `<pair>`, and those that MuJoCo's filters let touch."""
    found = {
        (a, b): _mixed(model, a, b)
        for a, b in combinations(range(model["ngeom"]), 2)
        if _touch(model, a, b)
    }
    for p in range(model["npair"]):
        a, b = sorted((model["pair_geom1"][p], model["pair_geom2"][p]))
        found[a, b] = Mixed(
            model["pair_friction"][p][0],
            model["pair_dim"][p],
            model["pair_solref"][p],
            model["pair_solimp"][p],
            model["pair_margin"][p] - model["pair_gap"][p],
        )
    return found


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


def _half_space(model: Compiled, plane: int, names: Names) -> dict[str, Any]:
    normal = cleaned(image(matrix_of(model["geom_quat"][plane]), (0.0, 0.0, 1.0)))
    offset = math.fsum(n * x for n, x in zip(normal, model["geom_pos"][plane], strict=True))
    found: dict[str, Any] = {} if normal == [0.0, 0.0, 1.0] else {"normal": tuple(normal)}
    if body := model["geom_bodyid"][plane]:
        found["other"] = names.bodies[body]
    return found | ({"offset": offset} if offset else {})


def _mixed(model: Compiled, a: int, b: int) -> Mixed:
    first, second = (model["geom_priority"][g] for g in (a, b))
    share = model["geom_solmix"][a], model["geom_solmix"][b]
    part = share[0] / sum(share) if sum(share) else 0.5
    part = part if first == second else float(first > second)

    def mixed(key: str) -> Any:
        return np.dot([part, 1 - part], [model[key][a], model[key][b]])

    high = [g for g, priority in ((a, first), (b, second)) if priority == max(first, second)]
    return Mixed(
        max(model["geom_friction"][g][0] for g in high),
        max(model["geom_condim"][g] for g in high),
        mixed("geom_solref"),
        mixed("geom_solimp"),
        math.fsum(model["geom_margin"][g] - model["geom_gap"][g] for g in (a, b)),
    )


def _mass(model: Compiled, a: int, b: int) -> float:
    """1/A of two geoms, kg; if A is 0, as on an axis, the mass of all bodies."""
    inverse = sum(model["body_invweight0"][model["geom_bodyid"][g]][0] for g in (a, b))
    return 1 / inverse if inverse else math.fsum(model["body_mass"])


def _law(model: Compiled, mixed: Mixed, mass: float) -> dict[str, float]:
    """Stiffness, damping and friction between two geoms with a mass 1/A, kg."""
    friction = mixed.friction if mixed.condim > 1 else 0.0
    most = min(max(mixed.solimp[1], LEAST), 1 - LEAST)
    time, ratio = mixed.solref
    if time > 0:
        time = max(time, 2 * model["opt_timestep"])
        k = 1 / (most * time * ratio) ** 2
    else:
        k = -time / most**2
        ratio = -ratio / most / (2 * math.sqrt(k))
    load = math.hypot(*model["opt_gravity"]) * sum(model["body_mass"]) / 2 or mass
    edges = 1.0
    if friction and model["opt_cone"] == PYRAMID:
        edges = model["opt_impratio"] * (mixed.condim - 1) / (friction**2 * (1 + friction**2))
    stiffness = _stiffness(k * mass * edges, mixed.solimp, load)
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


def _part(model: Compiled, g: int, body: str, margin: float, found: Contacts) -> Part:
    """A geom as a part of a body, larger by a margin: MuJoCo's contacts act from there."""
    kind, (a, b, c) = model["geom_type"][g], model["geom_size"][g]
    at, quat = model["geom_pos"][g], model["geom_quat"][g]
    degrees = [DEGREES * angle for angle in angles(quat)]
    ends = line_of(at, quat, b)
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
            tables = [found.hull(_corners(model, g) @ np.array(matrix_of(quat)).T + at)]
    if margin:
        tables = [table | {"radius": table.get("radius", 0.0) + margin} for table in tables]
    return part(body, KINDS[kind], tables)


def _corners(model: Compiled, g: int) -> shapes.Array:
    """The vertices of a geom's mesh."""
    mesh = model["geom_dataid"][g]
    first, count = model["mesh_vertadr"][mesh], model["mesh_vertnum"][mesh]
    return np.array(model["mesh_vert"][first : first + count], dtype=float)
