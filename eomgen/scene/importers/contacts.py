"""Collision geometry of robot files as shapes of contacts."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from eomgen.base.errors import listed
from eomgen.scene.importers.pairs import MOST_PAIRS, ROUNDING, Part, Pose, nearest_pairs
from eomgen.scene.importers.parts import Parts
from eomgen.scene.importers.rotations import angles_of, rotation, to_axis
from eomgen.scene.importers.vectors import Vector

Array = npt.NDArray[np.float64]
Table = dict[str, Any]

SLIP_SPEED = "slip_speed"
"""The parameter of the slip within which friction of contacts is smoothed, m/s."""
SLIP = 0.01
RIM = 0.01
"""Thickness of the disc at each end of a cylinder as a part of its radius."""
MOST_VERTICES = 16
"""Greatest number of vertices of the hull of a mesh that are taken."""
NEAR = 1e-3
"""No more vertices are taken if none is farther than this outside of their hull, m."""
DIGITS = 9
"""Decimals of a vertex, m."""


@dataclass
class Contacts:
    """Contacts of a robot, as they are collected.

    shapes  by effect: name, body and law; in each the shapes by name
    pairs   of shapes that touch each other, by effect
    made    how many there are of each kind, taken whole or as more shapes
    lost    likewise of those that have no counterpart
    off     how far a mesh's hull is outside of that of the vertices taken, at most, m
    notes   other remarks
    """

    shapes: dict[tuple[tuple[str, Any], ...], dict[str, Table]] = field(default_factory=dict)
    pairs: dict[tuple[tuple[str, Any], ...], list[list[str]]] = field(default_factory=dict)
    made: Counter[str] = field(default_factory=Counter)
    lost: Counter[str] = field(default_factory=Counter)
    off: float = 0.0
    notes: list[str] = field(default_factory=list)

    def add(self, law: Mapping[str, Any], part: Part) -> None:
        """Add a part that touches a plane by a law: keys of an effect, with its name."""
        own = self.shapes.setdefault(tuple(law.items()), {})
        self.made[part.kind] += 1
        for shape in part.shapes:
            own[f"{part.body}_{len(own) + 1}"] = {"body": part.body} | shape

    def add_pairs(
        self,
        parts: Sequence[Part],
        pairs: Iterable[tuple[int, int]],
        poses: Mapping[str, Pose],
        law: Callable[[int, int], Mapping[str, Any]],
        apart: bool = False,
    ) -> None:
        """Add the pairs of parts that touch each other, each by its law; with `apart` only those
        that do not touch in the bodies' poses.
        """
        cores, known = list[tuple[str, Table]](), dict[int, int]()
        for i, one in enumerate(parts):
            if one.core is not None:
                known[i] = len(cores)
                cores.append((one.body, one.core))
        every = list(pairs)
        both = [(known[i], known[j]) for i, j in every if i in known and j in known]
        self.lost["pairs with ellipsoids, meshes or flat cylinders"] += len(every) - len(both)
        found, touching, many = nearest_pairs(cores, both, poses, lambda gap: gap > 0 or not apart)
        self.lost["pairs that touch at the start"] += touching
        self.lost[f"pairs beyond the {MOST_PAIRS} nearest at the start"] += many
        numbers, used = list(known), set[int]()
        for pair in found:
            first, second = (numbers[i] for i in pair)
            key = tuple({"against": "each_other", **law(first, second)}.items())
            own = self.shapes.setdefault(key, {})
            names = [f"{parts[i].body}_{i + 1}" for i in (first, second)]
            for name, core in zip(names, pair, strict=True):
                own[name] = {"body": cores[core][0]} | cores[core][1]
            self.pairs.setdefault(key, []).append(names)
            used.update((first, second))
        if found:
            self.notes.append(f"soft contacts of shapes with each other: {len(found)} pairs")
        kinds = {parts[i].kind for i in used}
        if "box" in kinds:
            rounding = f"{100 * ROUNDING:g} % of their smallest half size"
            self.notes.append(f"boxes that touch other shapes are rounded by {rounding}")
        if "cylinder" in kinds:
            self.notes.append("cylinders touch other shapes as the capsules within them")

    def hull(self, corners: Array) -> Table:
        """The hull of a mesh's corners in body axes."""
        vertices, off = hull_vertices(corners)
        self.off = max(self.off, off)
        return {"at": [0.0, 0.0, 0.0], "vertices": np.round(vertices, DIGITS).tolist()}

    def effects(self, parts: Parts) -> None:
        """Add the effects, and the parameter that they share."""
        taken = {effect.get("name") for effect in parts.effects}
        for keys, shapes in self.shapes.items():
            table = {"type": "contact", "law": "spring_damper", **dict(keys)}
            name, number = table["name"], 1
            while table["name"] in taken:
                number += 1
                table["name"] = f"{name}_{number}"
            taken.add(table["name"])
            if table["friction"]:
                table["slip_speed"] = SLIP_SPEED
                about = "slip within which friction of contacts is smoothed"
                parts.parameters[SLIP_SPEED] = {"value": SLIP, "unit": "m/s", "about": about}
            else:
                del table["friction"]
            if pairs := self.pairs.get(keys):
                table["pairs"] = pairs
            parts.effects.append(table | {"shapes": shapes})

    def remarks(self) -> Iterator[str]:
        """What touches the ground and other shapes, and what does not."""
        kinds = ", ".join(f"{count} {_several(kind, count)}" for kind, count in self.made.items())
        yield f"soft contacts with the ground: {kinds or 'none'}"
        yield from self.notes
        if self.off:
            yield (
                f"hulls of meshes have at most {MOST_VERTICES} vertices in contacts; what is left "
                f"out is within {1e3 * self.off:.1f} mm"
            )
        if lost := [f"{what} ({count})" for what, count in self.lost.items() if count]:
            yield f"left out of contacts: {listed(lost)}"


def _several(kind: str, count: int) -> str:
    ending = "es" if kind.endswith(("sh", "x")) else "s"
    return kind + ending * (count != 1)


def sphere(at: Sequence[float], radius: float) -> list[Table]:
    """A sphere."""
    return [{"at": list(at), "radius": radius}]


def capsule(start: Sequence[float], end: Sequence[float], radius: float) -> list[Table]:
    """A capsule from one end of its axis to the other."""
    return [{"at": list(start), "end": list(end), "radius": radius}]


def box(at: Sequence[float], half: Sequence[float], degrees: Sequence[float]) -> list[Table]:
    """A box turned by angles about x, y and z."""
    return [_turned({"at": list(at), "half_sizes": list(half)}, degrees)]


def ellipsoid(at: Sequence[float], radii: Sequence[float], degrees: Sequence[float]) -> list[Table]:
    """An ellipsoid, likewise."""
    return [_turned({"at": list(at), "semi_axes": list(radii)}, degrees)]


def cylinder(start: Sequence[float], end: Sequence[float], radius: float) -> list[Table]:
    """The rims of a cylinder: at each end a flat ellipsoid, as thick as `RIM` says, that does not
    reach beyond it.
    """
    axis = np.subtract(end, start)
    length = float(np.linalg.norm(axis))
    thick = min(RIM * radius, length / 4)
    x, y, z = (axis / length).tolist()
    degrees = [math.degrees(angle) for angle in angles_of(to_axis((x, y, z)))]
    inward = thick * axis / length
    ends = (np.add(start, inward), np.subtract(end, inward))
    half = [radius, radius, thick]
    return [_turned({"at": at.tolist(), "semi_axes": half}, degrees) for at in ends]


def _turned(table: Table, degrees: Sequence[float]) -> Table:
    return table | ({"orientation_deg": list(degrees)} if any(degrees) else {})


def hull_vertices(corners: Array) -> tuple[Array, float]:
    """At most `MOST_VERTICES` vertices (k, 3) of the hull of points, each the farthest outside of
    the hull of those before; and how far the hull reaches beyond theirs, m.
    """
    points = _vertices(corners)
    ways = np.concatenate([np.eye(3), -np.eye(3)])
    chosen = list(dict.fromkeys(np.argmax(points @ ways.T, axis=0).tolist()))
    while True:
        outside = _beyond(points, points[chosen])
        far = int(np.argmax(outside))
        if outside[far] <= NEAR or len(chosen) == MOST_VERTICES or far in chosen:
            return points[chosen], max(0.0, float(outside[far]))
        chosen.append(far)


def _vertices(corners: Array) -> Array:
    """The vertices of the hull of points; of points in a plane, these."""
    from scipy.spatial import ConvexHull, QhullError

    points: Array = np.unique(corners, axis=0)
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except (QhullError, ValueError):
        return points


def _beyond(points: Array, chosen: Array) -> Array:
    """How far each point is beyond the hull of some, m: where these have none, from the nearest."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        faces = ConvexHull(chosen).equations
    except (QhullError, ValueError):
        apart = np.linalg.norm(points[:, None] - chosen, axis=2)
        return np.asarray(apart.min(axis=1))
    return np.asarray((points @ faces[:, :3].T + faces[:, 3]).max(axis=1))


def depth_below(shape: Table, turn: Array, at: Array) -> float:
    """How far a shape of a body reaches below z = 0 of the world, m, for the body's pose there."""
    down: Array = -turn[2]
    core = [np.array(shape["at"])]
    if "end" in shape:
        core.append(np.array(shape["end"]))
    core = [core[0] + vertex for vertex in shape.get("vertices", ())] or core
    rounding: float = shape.get("radius", 0.0) - float(at[2])
    reach = max(float(down @ point) for point in core) + rounding
    own = np.array(rotation(_radians(shape.get("orientation_deg", (0.0, 0.0, 0.0)))))
    if "half_sizes" in shape:
        return reach + float(np.abs(down @ own * shape["half_sizes"]).sum())
    if "semi_axes" in shape:
        return reach + float(np.linalg.norm(down @ own * shape["semi_axes"]))
    return reach


def _radians(degrees: Sequence[float]) -> Vector:
    x, y, z = map(math.radians, degrees)
    return (x, y, z)
