"""Random mechanisms with loops, closed by construction; nothing here imports eomgen.

A loop joint is put between two bodies of a random tree at a random state. Its place on the parent
and its own coordinates are drawn; its place on the child and its orientation follow, so that it is
closed there. The velocities are the nearest to random ones that keep it so.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation
from spatial_newton_euler import STILL, BodyMotion, at_rest, loop_rows, mass_matrix, velocities_of
from spatial_trees import (
    PLANE,
    SPACE,
    Loop,
    SpatialTree,
    TreeJoint,
    Vector,
    Vectors,
    Z,
    random_spatial_tree,
    random_state,
)

LOOP_KINDS: dict[int, tuple[str, ...]] = {
    PLANE: ("revolute", "revolute", "prismatic", "weld"),
    SPACE: ("ball", "revolute", "prismatic", "cylindrical", "universal", "planar", "weld"),
}
BLOCKED = {
    PLANE: {"revolute": 2, "prismatic": 2, "weld": 3},
    SPACE: {"ball": 3, "revolute": 5, "prismatic": 5, "cylindrical": 4, "universal": 4, "planar": 3,
            "weld": 6},
}  # fmt: skip
"""How many directions each kind blocks."""
WORST = 1e5
"""A mechanism of a greater condition is drawn again: its data's last places decide on more than the
tenth digit.
"""
TRIES = 60
"""Loops that are drawn before a tree is given up."""
LEAST = 1e-3
"""The least singular value of the rows of loops, relative to the greatest: below, draw another."""


@dataclass(frozen=True, eq=False)
class Closed:
    """A mechanism with loops at a state that closes them; `text` is its scene.

    `condition` is that of the mass matrix M or of J M⁻¹ Jᵀ, the greater, with a diagonal of 1; J is
    of the rows of the loops.
    """

    tree: SpatialTree
    text: str
    q: np.ndarray
    v: np.ndarray
    condition: float


def random_loops(
    seed: int, dimensions: int, most: int, loops: int, kinds: Sequence[str] = ()
) -> Closed:
    """A mechanism of up to `most` bodies with so many loops, of every joint type or of some
    `kinds`, whose rows are independent and leave it a freedom.
    """
    kinds = kinds or LOOP_KINDS[dimensions]
    rng = np.random.default_rng([seed, dimensions, most, loops])
    while True:
        tree, text = random_spatial_tree(int(rng.integers(2**31)), dimensions, most)
        freedoms = len(tree.velocities)
        if len(tree.bodies) < 2 or freedoms <= loops * min(BLOCKED[dimensions].values()):
            continue
        q, v = random_state(tree, rng)
        bodies, velocities = at_rest(tree, q), velocities_of(tree, q)
        rows = np.zeros((0, freedoms))
        for _ in range(TRIES):
            if len(tree.loops) == loops:
                case = closed(tree, text, q, v)
                if case.condition > WORST:
                    break
                return case
            kind = kinds[int(rng.integers(len(kinds)))]
            if len(rows) + BLOCKED[dimensions][kind] >= freedoms:
                continue
            loop = _drawn(rng, tree, bodies, kind)
            more = loop_rows(replace(tree, loops=(loop,)), bodies, velocities)
            if _condition(np.vstack([rows, more])) < 1 / LEAST:
                tree, rows = replace(tree, loops=(*tree.loops, loop)), np.vstack([rows, more])


def closed(tree: SpatialTree, text: str, q: np.ndarray, v: np.ndarray) -> Closed:
    """A tree at a state that closes its loops, with the velocities that keep them closed; `text` is
    its scene without them.
    """
    velocities = velocities_of(tree, q)
    rows = loop_rows(tree, at_rest(tree, q), velocities)
    v = v - np.linalg.pinv(rows, rcond=1e-9) @ (rows @ v)
    start = [f"{name} = {float(x)!r}" for name, x in zip(tree.coordinates, q, strict=True)]
    speeds = [f"{name} = {float(x)!r}" for name, x in zip(tree.velocities, v, strict=True)]
    initial = f"[initial]\nq = {{ {', '.join(start)} }}\nv = {{ {', '.join(speeds)} }}\n"
    tables = [text, *(written(tree, loop) for loop in tree.loops), initial]
    mass = mass_matrix(tree, q, velocities)
    loops = rows @ np.linalg.solve(mass, rows.T)
    return Closed(tree, "\n".join(tables), q, v, max(_scaled(mass), _scaled(loops)))


def _scaled(matrix: np.ndarray) -> float:
    """The condition of a symmetric matrix whose diagonal is made 1."""
    sizes = np.sqrt(np.abs(np.diag(matrix)))
    return float(np.linalg.cond(matrix / np.outer(sizes, sizes)))


def _condition(rows: np.ndarray) -> float:
    """Of rows made unit; infinite if one is 0."""
    sizes = np.linalg.norm(rows, axis=1)
    if sizes.min(initial=1.0) < LEAST:
        return float("inf")
    return float(np.linalg.cond(rows / sizes[:, np.newaxis]))


def _drawn(
    rng: np.random.Generator, tree: SpatialTree, bodies: list[BodyMotion], kind: str
) -> Loop:
    """A loop joint that is closed where the bodies are."""
    n, space = len(tree.bodies), tree.dimensions == SPACE
    parent, child = (int(k) for k in rng.choice(np.arange(-1, n), 2, replace=False))
    axes: Vectors = (Z,)
    if kind == "prismatic" or (space and kind in ("revolute", "cylindrical")):
        axes = (direction(rng, tree.dimensions),)
    elif kind == "universal":
        axes = (direction(rng, 3), direction(rng, 3))
        while abs(np.dot(*axes)) > 0.8:
            axes = (axes[0], direction(rng, 3))
    at = np.zeros(3)
    at[: tree.dimensions] = np.round(rng.uniform(-0.8, 0.8, tree.dimensions), 3)
    angle = rng.uniform(-3.0, 3.0, 2)
    slide = np.zeros(3)
    match kind:
        case "revolute":
            turn = Rotation.from_rotvec(angle[0] * np.array(axes[0]))
        case "cylindrical":
            turn = Rotation.from_rotvec(angle[0] * np.array(axes[0]))
        case "universal":
            one, two = (
                Rotation.from_rotvec(a * np.array(x)) for a, x in zip(angle, axes, strict=True)
            )
            turn = one * two
        case "ball":
            turn = Rotation.from_quat(rng.normal(size=4))
        case "planar":
            turn = Rotation.from_rotvec(angle[0] * np.array(Z))
        case _:
            turn = Rotation.identity()
    if kind in ("prismatic", "cylindrical"):
        slide = rng.uniform(-0.5, 0.5) * np.array(axes[0])
    elif kind == "planar":
        slide[:2] = rng.uniform(-0.5, 0.5, 2)
    ends = Ends(parent, child, at)
    return loop_joint(tree, bodies, kind, axes, ends, turn, slide)


@dataclass(frozen=True, eq=False)
class Ends:
    """The bodies of a loop joint by index, -1 for the world, and its place on the parent."""

    parent: int
    child: int
    at: np.ndarray


def loop_joint(
    tree: SpatialTree,
    bodies: list[BodyMotion],
    kind: str,
    axes: Vectors,
    ends: Ends,
    turn: Rotation,
    slide: np.ndarray,
) -> Loop:
    """The joint that is closed where the bodies are and where its own coordinates turn and move the
    child by `turn` and `slide`, in its axes.
    """
    base, child = ([*bodies, STILL][k] for k in (ends.parent, ends.child))
    frame = Rotation.from_matrix(base.axes.T @ child.axes) * turn.inv()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # where two of the angles are one, either does
        degrees = frame.as_euler("xyz", degrees=True)
    point = base.place + base.axes @ (ends.at + frame.apply(slide))
    r_child = child.axes.T @ (point - child.place)
    if tree.dimensions == PLANE:
        degrees[:2] = 0.0
    orientation, r_parent, r_child = (_vector(x) for x in (degrees, ends.at, r_child))
    name = f"loop{len(tree.loops)}"
    where = (r_parent, r_child, orientation, axes)
    return Loop(TreeJoint(name, kind, ends.parent, *where, 0.0, (), ()), ends.child)


def written(tree: SpatialTree, loop: Loop) -> str:
    """A loop joint as TOML."""
    joint, n = loop.joint, tree.dimensions
    parent, child = ("world" if k < 0 else tree.bodies[k].name for k in (joint.parent, loop.child))
    degrees = [*joint.orientation_deg] if n == SPACE else joint.orientation_deg[2]
    lines = [
        "[[joints]]",
        f'type = "{joint.kind}"',
        f'name = "{joint.name}"',
        "loop = true",
        f'parent = "{parent}"',
        f'child = "{child}"',
        f"r_parent = {[*joint.r_parent][:n]}",
        f"r_child = {[*joint.r_child][:n]}",
        f"orientation_deg = {degrees}",
    ]
    if joint.kind == "universal":
        lines.append(f"axes = {[[*axis] for axis in joint.axes]}")
    elif joint.kind == "prismatic" or (n == SPACE and joint.kind in ("revolute", "cylindrical")):
        lines.append(f"axis = {[*joint.axes[0]][:n]}")
    return "\n".join(lines) + "\n"


def direction(rng: np.random.Generator, dimensions: int) -> Vector:
    """A unit vector, half the time along a coordinate axis."""
    vector = rng.normal(size=3)
    if rng.random() < 0.5:
        vector = np.eye(3)[rng.integers(dimensions)]
    vector[dimensions:] = 0.0
    return _vector(vector / np.linalg.norm(vector))


def _vector(parts: np.ndarray) -> Vector:
    x, y, z = map(float, parts)
    return x, y, z
