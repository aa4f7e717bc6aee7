"""Draws the pictures of docs/pictures.md and of the tutorial: `python tools/pictures.py`.

Each of the former is a small scene at one time: a shape, an element of an effect, or a mode of the
camera. The latter are what the tutorial's own commands draw: `python tools/pictures.py tutorial`.
"""

import contextlib
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import eomgen
from eomgen.scene.reader import parse_scene
from eomgen.show.framing import ASPECT
from eomgen.show.motion import Motion
from eomgen.show.plane import draw_plane
from eomgen.show.space import draw_space
from eomgen.show.style import style, write_figure
from eomgen.show.view import eye_axes

FOLDER = Path(__file__).parent.parent / "docs" / "pictures"
ENTRIES = FOLDER.parent / "reference" / "scenes"

ARM = """\
name = "arm"
[[bodies]]
name = "arm"
mass = 1.0
inertia_com = 0.03
[[joints]]
name = "pin"
type = "revolute"
parent = "world"
child = "arm"
r_child = [-0.3, 0]
[[effects]]
type = "gravity"
g = 9.81
[initial]
q = { pin_angle_deg = -35 }
"""
SLIDER = """\
name = "slider"
[[bodies]]
name = "block"
mass = 1.0
inertia_com = 0
[[joints]]
name = "guide"
type = "prismatic"
parent = "world"
child = "block"
axis = [1, 0]
coordinate = "x"
[initial]
q = { x = 1.0 }
"""
BALL = """\
name = "ball"
[[bodies]]
name = "ball"
mass = 1.0
inertia_com = 0.001
[[joints]]
name = "free"
type = "free"
child = "ball"
[initial]
q = { ball_x = 0.2, ball_y = 0.25 }
v = { ball_x_dot = 1.0 }
"""
SPACE = """\
name = "body"
dimensions = 3
[[bodies]]
name = "b"
mass = 1.0
inertia_com = [0.01, 0.02, 0.025]
[[joints]]
name = "free"
type = "free"
child = "b"
"""


def shaped(base: str, shape: str) -> str:
    """A scene whose body has a shape."""
    body, inertia, rest = base.partition("inertia_com")
    value, _, rest = rest.partition("\n")
    return f"{body}{inertia}{value}\nshapes = [{shape}]\n{rest}"


def effect(base: str, kind: str, keys: str) -> str:
    """A scene with an effect."""
    body, start, rest = base.partition("[initial]")
    return f'{body}[[effects]]\ntype = "{kind}"\nname = "e"\n{keys}\n{start}{rest}'


PARTNER = (
    '[[bodies]]\nname = "moon"\nmass = 0.2\n[[joints]]\nname = "orbit"\ntype = "particle"\n'
    'parent = "world"\nchild = "moon"\n'
)
SPRING = 'body_1 = "world"\nbody_2 = "block"\nrest_length = 0.8\n'
CONTACT = 'body = "ball"\nlaw = "hunt_crossley"\nradius = 0.2\nstiffness = 1e4\n'
SCENES: Mapping[str, str] = {
    "box": shaped(SPACE, '{ type = "box", size = [0.5, 0.3, 0.2] }'),
    "sphere": shaped(SPACE, '{ type = "sphere", radius = 0.2 }'),
    "cylinder": shaped(SPACE, '{ type = "cylinder", start = [-0.3,0,0], end = [0.3,0,0], '
                       "radius = 0.12 }"),
    "ellipsoid": shaped(SPACE, '{ type = "ellipsoid", radii = [0.3, 0.2, 0.1] }'),
    "disc": shaped(BALL, '{ type = "disc", radius = 0.2 }'),
    "polygon": shaped(BALL, '{ type = "polygon", points = [[-0.2, -0.1], [0.3, -0.1], [0, 0.2]] }'),
    "rod": shaped(BALL, '{ type = "rod", start = [-0.3, -0.1], end = [0.3, 0.1], width = 0.1 }'),
    "base": ARM,
    "rail": SLIDER,
    "coil": effect(SLIDER, "spring", SPRING + "stiffness = 1.0"),
    "damper": effect(SLIDER, "spring", SPRING + "damping = 1.0"),
    "spring_damper": effect(SLIDER, "spring", SPRING + "damping = 1.0\nstiffness = 1.0"),
    "rope": effect(SLIDER, "spring", SPRING.replace("0.8", "1.1")
                   + "stiffness = 9.0\ntension_only = true"),
    "torsion": effect(ARM, "joint_spring", 'joint = "pin"\nstiffness = 1.0'),
    "motor": effect(ARM, "motor", 'joint = "pin"\ntorque = "input"'),
    "servo": effect(ARM, "pd", 'joint = "pin"\ntarget = 0.0\nstiffness = 1.0'),
    "drive": shaped(ARM, "").replace("[[effects]]", '[[bodies]]\nname = "tip"\nmass = 1.0\n'
             'inertia_com = 0.01\n[[joints]]\nname = "elbow"\ntype = "revolute"\nparent = "arm"\n'
             'child = "tip"\nr_parent = [0.3, 0]\nr_child = [-0.2, 0]\n[[effects]]\n'
             'type = "driven"\nname = "crank"\njoint = "pin"\ncoordinate = "-0.6 + 5*t"\n'
             "[[effects]]", 1).replace("q = { pin_angle_deg = -35 }", "q = { elbow_angle = 0.3 }"),
    "stop": effect(ARM, "joint_stop", 'joint = "pin"\nlow = -0.9\nhigh = 0.4\nstiffness = 9.0'),
    "brake": effect(ARM, "joint_friction", 'joint = "pin"\nviscous = 0.1'),
    "ball": effect(ARM, "contact", 'body = "arm"\nat = [0.3, 0]\nlaw = "hunt_crossley"\n'
                   "radius = 0.06\nstiffness = 1e4\noffset = -0.42"),
    "wheel": effect(ARM.replace("[-0.3, 0]", "[0, 0]"), "contact", 'body = "arm"\n'
                    'law = "hunt_crossley"\nradius = 0.245\nstiffness = 1e4\noffset = -0.245'),
    "obstacle": effect(BALL, "field", 'kind = "avoid"\nbody = "ball"\ncenter = [1.0, 0.3]\n'
                       "steering = 1.0\nradius = 0.25\nreach = 0.3"),
    "field": effect(BALL, "field", 'body = "ball"\nforce = ["-y", "x"]'),
    "attraction": effect(BALL, "point_gravity", "mu = 1.0\nat = [1.3, 0.3]"),
    "heights": effect(
        BALL, "contact", 'law = "spring_damper"\nstiffness = 1e3\nagainst = "heights"\n'
        'height = "0.1*sin(5*x)"\nbody = "ball"\nradius = 0.1'),
    "wind": effect(BALL, "drag", 'body = "ball"\nlinear = 0.1\nwind = [3.0, 0.5]'),
    "pull": effect(BALL.replace("[initial]", PARTNER + "[initial]"), "pairwise",
                   'bodies = ["ball", "moon"]\ngravitation = 1.0'),
    **{name: (ENTRIES / f"{entry}.toml").read_text("utf-8")
       for name, entry in (("cord", "rope"), ("belt", "belt"), ("gear", "gear"))},
    "force": effect(ARM, "external_force", 'body = "arm"\nat = [0.3, 0]\nforce = [0, 1.0]'),
}  # fmt: skip
LONGER = {"heights": 0.4, "obstacle": 0.3, "attraction": 0.6, "field": 0.8, "wind": 0.8}
"""Duration of a scene, s, if its motion is to be seen."""
CAMERAS = {
    "fit": 'mode = "fit"',
    "follow": 'mode = "follow"\nfollow = "A"',
    "fixed": 'mode = "fixed"\ncenter = [0.5, 4.0]\nheight = 12.0',
}


TUTORIAL = {"5": "crane.png", "7": "crane.png", "8": "crane.png", "10": "crane_sweep.png"}
"""Figures of the tutorial by the number of the step."""


def main(names: list[str]) -> None:
    """Write all pictures, or those of some names."""
    FOLDER.mkdir(exist_ok=True)
    if not names or "tutorial" in names:
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            tutorial()
    for name, text in SCENES.items():
        if not names or name in names:
            run = eomgen.simulate(parse_scene(text), t_end=LONGER.get(name, 1e-4))
            save(name, run.motion)
    for name, camera in CAMERAS.items():
        if not names or name in names:
            text = eomgen.read("two_body")
            scene = text.replaced(camera=parse_scene(f"{ARM}[camera]\n{camera}\n".replace(
                '"A"', '"arm"')).camera)  # fmt: skip
            if scene.camera.follow:
                scene = scene.replaced(camera=scene.camera.replaced(follow="A"))
            save(name, eomgen.simulate(scene).motion, whole=True)


def tutorial() -> None:
    """Run the files and commands of the tutorial, and keep the figures that `TUTORIAL` names."""
    page = (FOLDER.parent / "tutorial.md").read_text("utf-8")
    for heading, part in re.findall(r"^## (\d+)\..*?\n(.*?)(?=^## )", page, re.M | re.S):
        for language, text in re.findall(r"^```(\w+)\n(.*?)^```", part, re.M | re.S):
            if language == "toml":
                mode = "a" if text.startswith("# append") else "w"
                with Path("crane.toml").open(mode, encoding="utf-8") as file:
                    file.write("\n" + text)
            for line in text.splitlines() if language == "sh" else ():
                subprocess.run([sys.executable, "-m", *line.split()], check=True)
        if heading in TUTORIAL:
            figure = Path("out", TUTORIAL[heading])
            shutil.copy(figure, FOLDER / f"tutorial_{heading}.png")


def save(name: str, motion: Motion, whole: bool = False) -> None:
    """Draw a motion, or only its last pose, as its camera sees it then."""
    view, last = motion.camera, motion.poses[-1]
    rows = slice(None) if whole else slice(-1, None)
    keys = ("t", "y", "joint_drift", "poses", "kinetic_energy", "potential_energy")
    still = replace(motion, works=None, **{key: getattr(motion, key)[rows] for key in keys})
    center = motion.center
    if view.follow is not None:
        center = (
            center
            + (last[:, :2] if motion.dimensions == 2 else last[..., 3])[
                motion.bodies.index(view.follow)
            ]
        )
    if motion.dimensions == 3:
        center = (eye_axes(view.azimuth_deg, view.elevation_deg) @ center)[:2]
    margin = 1.0 if whole else 1.25
    height = margin * max(view.height, view.width / ASPECT, 0.55)
    with style():
        figure = Figure(figsize=(2.2, 1.65))
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        (draw_plane if motion.dimensions == 2 else draw_space)(axes, still)
        half = np.array([ASPECT * height, height]) / 2
        (left, low), (right, high) = center - half, center + half
        axes.set(xlim=(left, right), ylim=(low, high), aspect="equal", xlabel="", ylabel="")
        axes.tick_params(labelbottom=False, labelleft=False)
        for inset in axes.child_axes:
            inset.remove()
        write_figure(figure, FOLDER / f"{name}.png", force=True)


if __name__ == "__main__":
    main(sys.argv[1:])
