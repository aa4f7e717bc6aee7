"""Bodies without shapes are drawn as a box each, with rods to their joints."""

import numpy as np
import pytest

from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.scene.appearance import Appearance, appearance_of
from eomgen.scene.look import Box, Camera, Rod, Sphere
from eomgen.scene.reader import parse_scene
from eomgen.scene.schema import Simulation
from eomgen.show.picture import shapes_of

ARM = """\
name = "arm"
dimensions = 3
[[bodies]]
name = "base"
mass = 3.0
inertia_com = [0.1, 0.1, 0.1]
[[bodies]]
name = "arm"
mass = 1.0
inertia_com = [0.02, 0.02, 0.01]
[[bodies]]
name = "hand"
mass = 1.0
inertia_com = [0.02, 0.02, 0.01]
shapes = [{ type = "sphere", radius = 0.1 }]
[[joints]]
name = "turret"
type = "revolute"
parent = "world"
child = "base"
axis = [0, 0, 1]
r_parent = [5, 5, 5]
[[joints]]
name = "shoulder"
type = "ball"
parent = "base"
child = "arm"
r_parent = [0.3, 0, 0.4]
r_child = [0, 0, 1]
[[joints]]
name = "wrist"
type = "weld"
parent = "arm"
child = "hand"
r_parent = [0, 0, -0.5]
"""
LONE = """\
name = "lone"
dimensions = 3
[[bodies]]
name = "b"
mass = 4.0
inertia_com = [1.0, 0.5, 0.8]
[[joints]]
name = "free"
type = "free"
parent = "world"
child = "b"
"""


def scene_of(text: str) -> tuple[Model, Appearance]:
    """The model of a scene, and its looks."""
    scene = parse_scene(text)
    return elaborate(scene), appearance_of(scene)


def test_rods_lead_from_the_centre_of_mass_to_the_joints() -> None:
    """A joint at the centre of mass needs none, nor does the world; own shapes are kept."""
    base, arm, hand = shapes_of(*scene_of(ARM))
    assert [shape.end for shape in base if isinstance(shape, Rod)] == [(0.3, 0.0, 0.4)]
    assert [s.end for s in arm if isinstance(s, Rod)] == [(0.0, 0.0, 1.0), (0.0, 0.0, -0.5)]
    assert all(shape.start == (0.0, 0.0, 0.0) for shape in (*base, *arm) if isinstance(shape, Rod))
    assert len(hand) == 1 and isinstance(hand[0], Sphere)
    box = base[0]
    assert isinstance(box, Box) and np.allclose(box.size, 0.25 * 0.5)  # of arms 0.5, 1, 0.5


def test_the_plane_has_the_same() -> None:
    """With vectors of two components."""
    text = ARM.replace("dimensions = 3\n", "").replace('"ball"', '"revolute"')
    for space, plane in {
        "[0.1, 0.1, 0.1]": "1",
        "[0.02, 0.02, 0.01]": "1",
        "axis = [0, 0, 1]\n": "",
        "[5, 5, 5]": "[5, 5]",
        "[0, 0, ": "[0, ",
        "[0.3, 0, ": "[0.3, ",
        "sphere": "disc",
    }.items():
        text = text.replace(space, plane)
    arm = shapes_of(*scene_of(text))[1]
    assert [s.end for s in arm if isinstance(s, Rod)] == [(0.0, 1.0), (0.0, -0.5)]


def test_a_lone_body_is_as_large_as_its_inertia_says() -> None:
    """It has no arm to go by: twice its radius of gyration, or a part of the picture."""
    (box,) = shapes_of(*scene_of(LONE))[0]
    assert isinstance(box, Box) and np.allclose(box.size, 0.25)
    still = LONE.replace("[1.0, 0.5, 0.8]", "0")
    (box,) = shapes_of(*scene_of(still))[0]
    assert isinstance(box, Box) and np.allclose(box.size, 0.1)


@pytest.mark.parametrize("length", [1e-150, 1e100])
def test_lengths_that_no_picture_has_are_left_out(length: float) -> None:
    """They may come from parameters of a run; the others are drawn."""
    names = ("shoulder_r_child_z", "wrist_r_parent_z")
    model, appearance = scene_of(ARM)
    longer = model.with_parameters(dict.fromkeys(names, length))
    base, arm, _ = shapes_of(longer, appearance)
    assert len(base) == 2 and len(arm) == 1


def test_a_model_knows_nothing_of_pictures_nor_of_integrators() -> None:
    """Scenes that differ in no more than these make one model."""
    scene = parse_scene(ARM)
    bare = tuple(body.replaced(shapes=()) for body in scene.bodies)
    other = scene.replaced(
        bodies=bare, camera=Camera(height=7.0), simulation=Simulation(t_end=3.0, integrator="rk4")
    )
    assert appearance_of(other) != appearance_of(scene)
    assert elaborate(other) == elaborate(scene)
