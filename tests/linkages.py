"""Linkages whose loops block directions twice, in plain numbers; nothing here imports eomgen."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from spatial_loops import Closed, Ends, closed, loop_joint
from spatial_newton_euler import at_rest
from spatial_trees import ORIGIN, SPACE, SpatialTree, TreeBody, TreeJoint, Vector, Z

GRAVITY = 9.81


def hinged(lengths: list[float], twists: list[float], angles: list[float], tilt: Vector) -> Closed:
    """A closed chain of bars on hinges; each axis is a length and a twist, degrees, beyond the one
    before it, and the bar between two axes along x. The first axis is tilted, degrees about x, y
    and z; the last bar is the world.

    `angles` are those of the hinges but the last, at which the chain closes.
    """
    rng = np.random.default_rng(len(lengths))
    bodies = []
    for k, length in enumerate(lengths[:-1]):
        at = (lengths[k - 1] / 2, 0.0, 0.0) if k else ORIGIN
        turned = (twists[k - 1], 0.0, 0.0) if k else tilt
        own = (f"a{k}",), (f"a{k}_dot",)
        bar = (-length / 2, 0.0, 0.0)
        joint = TreeJoint(f"j{k}", "revolute", k - 1, at, bar, turned, (Z,), 0.0, *own)
        moments = (*np.round(rng.uniform(0.01, 0.015, 3), 4).tolist(), 0.0, 0.0, 0.0)
        bodies.append(TreeBody(f"b{k}", float(np.round(rng.uniform(0.5, 2), 2)), moments, joint))
    tree = SpatialTree("linkage", SPACE, tuple(bodies), GRAVITY, -1, (), (), {})
    q, last = np.array(angles), len(bodies) - 1
    there = at_rest(tree, q)
    twist = Rotation.from_euler("x", twists[-2], degrees=True)
    x, y, z = (there[last].axes @ twist.apply(Z)).tolist()
    ends = Ends(last, -1, np.array([lengths[-2] / 2, 0.0, 0.0]))
    closing = loop_joint(
        tree, there, "revolute", ((x, y, z),), ends, Rotation.identity(), np.zeros(3)
    )
    tree = replace(tree, loops=(closing,))
    return closed(tree, written(tree), q, rng.uniform(-2.0, 2.0, len(q)))


def written(tree: SpatialTree) -> str:
    """The scene of a tree on hinges, without its loops."""
    tables = ['name = "linkage"\ndimensions = 3\noutputs = "all"\n']
    for body in tree.bodies:
        joint, inertia = body.joint, [*body.inertia][:3]
        parent = "world" if joint.parent < 0 else tree.bodies[joint.parent].name
        tables.append(
            f'[[bodies]]\nname = "{body.name}"\nmass = {body.mass}\ninertia_com = {inertia}\n'
            f'[[joints]]\nname = "{joint.name}"\ntype = "revolute"\nparent = "{parent}"\n'
            f'child = "{body.name}"\nr_parent = {[*joint.r_parent]}\nr_child = {[*joint.r_child]}\n'
            f'orientation_deg = {[*joint.orientation_deg]}\ncoordinate = "{joint.coordinates[0]}"\n'
        )
    tables.append(f'[[effects]]\ntype = "gravity"\ng = {tree.gravity}\n')
    return "\n".join(tables)


def four_bar_in_space(angle: float = 0.9) -> Closed:
    """Four bars in a plane of space: three of the five rows of a hinge are blocked already."""
    a, b, c, d = 0.3, 0.8, 0.6, 0.9
    # From the first axis along the bars a, b, c to (d, 0): the angle of b by the law of cosines.
    x, y = d - a * np.cos(angle), -a * np.sin(angle)
    far = np.hypot(x, y)
    of_b = np.arctan2(y, x) + np.arccos((b * b + far * far - c * c) / (2 * b * far))
    end = np.array([x - b * np.cos(of_b), y - b * np.sin(of_b)])
    of_c = np.arctan2(end[1], end[0])
    angles = [angle, of_b - angle, of_c - of_b]
    return hinged([a, b, c, d], [0.0] * 4, angles, (20.0, -35.0, 10.0))


def bennett(angle: float = 1.1) -> Closed:
    """Bennett's four bars (1903): opposite ones are equal, sin α / a = sin β / b. It moves although
    a general chain of four hinges does not: three of five rows are blocked already.
    """
    alpha, a, beta = 35.0, 0.5, 80.0
    b = float(a * np.sin(np.radians(beta)) / np.sin(np.radians(alpha)))
    half = np.radians([(beta + alpha) / 2, (beta - alpha) / 2])
    other = 2 * np.arctan(np.sin(half[0]) / np.sin(half[1]) / np.tan(angle / 2))
    angles = [angle, float(other), -angle]
    return hinged([a, b, a, b], [alpha, beta, alpha, beta], angles, (15.0, 25.0, -40.0))


def bricard(angle: float = 2.0) -> Closed:
    """Bricard's linkage of six equal bars, twisted by 90 and -90 degrees in turn (1897): one of its
    five rows is blocked already.
    """
    lengths, twists = [0.4] * 6, [90.0, -90.0] * 3

    def gap(other: float) -> float:
        whole, place = Rotation.identity(), np.zeros(3)
        for k in range(6):
            whole = whole * Rotation.from_euler("z", (angle, other)[k % 2])
            place = place + whole.apply([lengths[k], 0.0, 0.0])
            whole = whole * Rotation.from_euler("x", twists[k], degrees=True)
        return float(place @ [1.0, 1.0, 1.0])

    grid = np.linspace(-np.pi, np.pi, 200)
    found = []
    for low, high in pairwise(grid):
        if gap(low) * gap(high) < 0:
            found.append(brentq(gap, low, high, xtol=1e-15))
    for other in found:
        angles = [angle, other, angle, other, angle]
        case = hinged(lengths, twists, angles, (5.0, 10.0, 15.0))
        if _closes(case, lengths, twists, [*angles, other]):
            return case
    raise AssertionError(f"the linkage does not close at {angle}")


def _closes(case: Closed, lengths: list[float], twists: list[float], angles: list[float]) -> bool:
    whole, place = Rotation.identity(), np.zeros(3)
    for length, twist, angle in zip(lengths, twists, angles, strict=True):
        whole = whole * Rotation.from_euler("z", angle)
        place = place + whole.apply([length, 0.0, 0.0])
        whole = whole * Rotation.from_euler("x", twist, degrees=True)
    return bool(np.abs(place).max() < 1e-12 and whole.magnitude() < 1e-12)
