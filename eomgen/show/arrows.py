"""What pictures show of formulas at points of the region of a motion: arrows of fields and wind,
lines of the ground.
"""

from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from eomgen.language.formula import ZERO, Constant, Formula, names_in
from eomgen.language.rewriting import constant, with_names
from eomgen.model.model import Model
from eomgen.scene.effects.elements import Field, GroundLine, Heights, Vector, Wind

Array = NDArray[np.float64]
ARROWS = {2: (9, 7), 3: (4, 4, 3)}
"""Number of arrows of a field along each axis, in the plane and in space."""
BROAD, STEPS, LINES = 1.0, 60, 12
"""Half the width of ground relative to that of the region; parts of a line, and of the width."""
AROUND = 0.1
"""How much larger than that of the centres of mass the region is on each side."""


def field_arrows(field: Field, model: Model, low: Array, high: Array) -> Field:
    """A field of a formula with arrows in a region from `low` to `high`, m, if it can have any."""
    if field.formula is None:
        return field
    counts = ARROWS[model.dimensions]
    axes = [np.linspace(a, b, k) for a, b, k in zip(low, high, counts, strict=True)]
    points = tuple(constant(*place) for place in product(*axes))
    forces = [_at(field.formula, point, model) for point in points]
    found = tuple(force for force in forces if force is not None)
    return replace(field, points=points, forces=found) if len(found) == len(points) else field


def wind_at(wind: Wind, model: Model, place: Array) -> Wind:
    """A wind with its velocity at a place of the world, m."""
    at = constant(*place)
    return replace(wind, at=at, velocity=_at(wind.formula, at, model))


def region_of(places: Array) -> tuple[Array, Array]:
    """The region around points (n, d), m, at least half as high and deep as it is wide."""
    low, high = places.min(axis=0), places.max(axis=0)
    half = np.maximum((high - low) / 2, float((high - low).max()) / 4) * (1 + 2 * AROUND)
    middle = (low + high) / 2
    return middle - half, middle + half


def _at(formula: Vector | None, point: Vector, model: Model) -> Vector | None:
    """The formulas at rest at a point; None if they depend on more than parameters and time."""
    if formula is None:
        return None
    names: dict[str, Formula] = dict(zip("xyz", point, strict=False))
    names |= dict.fromkeys(("vx", "vy", "vz"), ZERO)
    names.setdefault("z", ZERO)
    found = tuple(with_names(part, names) for part in formula)
    known = {"t", *model.defaults}
    return found if all(name in known for part in found for name in names_in(part)) else None


def ground_lines(ground: Heights, low: Array, high: Array) -> Heights:
    """The same with lines over the region between two corners, and as far again around it."""
    if ground.formula is None:
        return ground
    middle, half = (low + high)[:-1] / 2, BROAD * (high - low).max()
    lines = []
    for axis in range(len(middle)):
        places = np.linspace(middle[axis] - half, middle[axis] + half, STEPS + 1).tolist()
        others = [0.0]
        if len(middle) == 2:
            other = middle[1 - axis]
            others = np.linspace(other - half, other + half, LINES + 1).tolist()
        for across in others:
            points = []
            for place in places:
                own, beside = Constant(place), Constant(across)
                names = {"xy"[axis]: own, "yx"[axis]: beside}
                points.append((place, with_names(ground.formula, names)))
            lines.append(GroundLine(axis, across, tuple(points)))
    return replace(ground, lines=tuple(lines))
