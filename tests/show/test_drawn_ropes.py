"""Ropes, belts, gears and arrows in pictures: along tangents, around discs, tooth in gap."""

from typing import Any

import numpy as np
from matplotlib.path import Path as Outline

from eomgen.dynamics.start.assembly import assembled
from eomgen.model.elaborate import elaborate
from eomgen.scene.appearance import appearance_of
from eomgen.scene.look import Polygon, numbers
from eomgen.scene.reader import parse_scene
from eomgen.show.marks import Along, Between, Facing, marks_of
from eomgen.show.picture import picture_of
from eomgen.show.strokes import Sight, strokes
from eomgen.show.symbols import CORD

WHEELS = """
name = "wheels"
bodies = [
    { name = "a", mass = 1.0, inertia_com = 0.1 },
    { name = "b", mass = 1.0, inertia_com = 0.1 },
]
joints = [
    { name = "left", type = "revolute", parent = "world", child = "a", coordinate = "q_a" },
    { name = "right", type = "revolute", parent = "world", child = "b", r_parent = [0.5, 0.2] },
]
[[constraints]]
name = "held"
body_1 = "a"
body_2 = "b"
"""
BELT = 'type = "belt"\nradius_1 = 0.1\nradius_2 = 0.3\n'
GEAR = 'type = "gear"\nteeth_1 = 11\nteeth_2 = 23\n'


def drawn(text: str, *angles: float) -> tuple[Any, list[np.ndarray]]:
    """The picture of the wheels at angles, and the ways of ropes and belts in it."""
    scene = parse_scene(text)
    model = assembled(elaborate(scene))
    picture = picture_of(model, appearance_of(scene)).valued(model.defaults)
    pose = np.array([[0.0, 0.0, angles[0]], [0.5, 0.2, angles[1]]])
    found = strokes(Sight(picture, pose, np.eye(3)))
    return picture, [stroke.points for stroke in found if stroke.line in CORD]


def test_a_belt_runs_along_tangents() -> None:
    """All of it is on a disc or outside, its length is that of the books, and it is closed."""
    apart = np.hypot(0.5, 0.2)
    for more, other in ((BELT, 0.3), (BELT + "crossed = true\n", -0.3)):
        _, (way,) = drawn(WHEELS + more, 0.3, 0.1)
        for centre, radius in (((0, 0), 0.1), ((0.5, 0.2), 0.3)):
            assert np.linalg.norm(way - centre, axis=1).min() > radius - 1e-12
        length = np.linalg.norm(np.diff(way, axis=0), axis=1).sum()
        # Open: 2 L + π (r + R) + 2 (R - r) asin((R - r)/d); crossed: with the sum of the radii.
        h = other - 0.1
        lean = np.arcsin(abs(h) / apart)
        exact = 2 * np.sqrt(apart**2 - h**2) + np.pi * 0.4 + 2 * abs(h) * lean
        assert exact * 0.998 < length < exact
        assert np.allclose(way[0], way[-1])


def test_gears_mesh() -> None:
    """While they turn no tooth is in one of the other gear, and they reach into its gaps."""
    for turn in np.linspace(0.0, 0.6, 7):
        picture, _ = drawn(WHEELS + GEAR, turn, -turn * 11 / 23)
        outlines = []
        for body, at, angle in zip(
            picture.bodies, ((0, 0), (0.5, 0.2)), (turn, -turn * 11 / 23), strict=True
        ):
            (gear,) = (shape for shape in body.shapes if isinstance(shape, Polygon))
            points = np.array([numbers(point) for point in gear.points])
            cosine, sine = np.cos(angle), np.sin(angle)
            outlines.append(points @ np.array([[cosine, sine], [-sine, cosine]]) + at)
        one, other = outlines
        reach = [
            np.linalg.norm(x - at, axis=1).max() for x, at in ((one, (0, 0)), (other, (0.5, 0.2)))
        ]
        assert sum(reach) > np.hypot(0.5, 0.2) * 1.02
        assert not Outline(one).contains_points(other).any()
        assert not Outline(other).contains_points(one).any()


PUCKS = """
name = "pucks"
bodies = [
    { name = "a", mass = 1.0, inertia_com = 0.1, shapes = [
        { type = "disc", radius = 0.1, color = "#ff0000" },
        { type = "disc", radius = 0.05, center = [0.2, 0.0] },
    ] },
    { name = "b", mass = 1.0 },
]
joints = [
    { name = "air", type = "planar", parent = "world", child = "a" },
    { name = "path", type = "particle", parent = "world", child = "b" },
]
effects = [
    { type = "pd", name = "along", joint = "air", coordinate = "air_x", stiffness = 3, target = 1 },
    { type = "motor", name = "about", joint = "air", coordinate = "air_angle", torque = 1.0 },
    { type = "joint_friction", name = "up", joint = "path", coordinate = "b_y", viscous = 1 },
    { type = "pairwise", name = "pull", bodies = "all", gravitation = 1.0 },
]
"""


def test_what_acts_along_a_line_has_a_straight_arrow() -> None:
    """Also at a particle and a planar joint; gravitation is a dashed line; and the colour of one
    shape is that of no other.
    """
    scene = parse_scene(PUCKS)
    picture = picture_of(elaborate(scene), appearance_of(scene))
    marks = list(marks_of(picture))
    axes = [tuple(map(float, numbers(m.frame.axis))) for m in marks if isinstance(m.frame, Along)]
    assert axes == [(1.0, 0.0), (0.0, 1.0)]
    assert sum(isinstance(mark.frame, Facing) for mark in marks) == 1
    (pull,) = (mark for mark in marks if isinstance(mark.frame, Between))
    assert all(line.dashed for line in pull.symbol)
    first, second = (shape.color for shape in picture.bodies[0].shapes)
    assert (first, second != first) == ("#ff0000", True)
