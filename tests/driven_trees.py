"""Random trees of which some joints are driven, and some coordinates locked."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from engine import MP
from spatial_trees import PLANE, SpatialTree, random_spatial_tree


def way(i: int, t: Any, on: Any) -> tuple[Any, Any, Any]:
    """The formula that drives joint i, with both derivatives by hand, over `math` or mpmath."""
    a, b, c, w = (on.mpf(x) if on is MP else x for x in (0.25, 0.5, 0.125, 1.5))
    s, e = w * t + i, on.exp(-t)
    return (
        a + b * on.sin(s) + c * t * t * e,
        b * w * on.cos(s) + c * e * (2 * t - t * t),
        -b * w * w * on.sin(s) + c * e * (2 - 4 * t + t * t),
    )


FORMULA = "0.25 + 0.5*sin(1.5*t + {}) + 0.125*t*t*exp(-t)"


@dataclass(frozen=True)
class Given:
    """A random tree, its scene, the same with drives and locks; which velocities are given."""

    tree: SpatialTree
    bare: str
    text: str
    driven: tuple[tuple[str, str], ...]
    locked: Mapping[str, tuple[str, float]]

    def values(self, t: Any, on: Any) -> tuple[dict[str, Any], dict[str, Any]]:
        """Coordinates and velocities that are given, and accelerations."""
        at: dict[str, Any] = {}
        accelerations: dict[str, Any] = {}
        for i, (position, velocity) in enumerate(self.driven):
            at[position], at[velocity], accelerations[velocity] = way(i, t, on)
        for position, (velocity, value) in self.locked.items():
            at |= {position: value, velocity: 0.0}
            accelerations[velocity] = 0.0
        return at, accelerations


@cache
def given(dimensions: int, seed: int, most: int, *, locks: bool = True) -> Given:
    """A tree of which about a third of the simple joints is driven, a fifth of the rest locked."""
    rng = np.random.default_rng([seed, 41])
    tree, bare = random_spatial_tree(seed, dimensions, most)
    driven, locked, text = [], {}, bare
    free = len(tree.velocities)
    for joint in (body.joint for body in tree.bodies):
        simple = joint.kind in ("revolute", "prismatic")
        plain = joint.kind != "ball" and (joint.kind != "free" or dimensions == PLANE)
        if simple and free > 1 and rng.random() < 0.35:
            text += (
                f'\n[[effects]]\ntype = "driven"\nname = "way{len(driven)}"\n'
                f'joint = "{joint.name}"\ncoordinate = "{FORMULA.format(len(driven))}"\n'
            )
            driven.append((joint.coordinates[0], joint.velocities[0]))
            free -= 1
            continue
        for position, velocity in zip(joint.coordinates, joint.velocities, strict=False):
            if locks and plain and free > 1 and rng.random() < 0.2:
                angle = rng.choice([rng.uniform(-2.0, 2.0), 0.5, math.pi / 2, 0.0])
                locked[position] = (velocity, float(angle))
                free -= 1
    text += "\n[locked]\n" + "".join(f"{c} = {value!r}\n" for c, (_, value) in locked.items())
    return Given(tree, bare, text, tuple(driven), locked)
