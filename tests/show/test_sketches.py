"""Sketches of mechanisms whose joints coincide: no label covers another, or what is drawn."""

from itertools import pairwise
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextPath

from eomgen.model.elaborate import elaborate
from eomgen.scene.reader import parse_scene
from eomgen.show.drawing import Dot, Drawing, Line, svg
from eomgen.show.sketches import mechanism_sketch

Box = tuple[float, float, float, float]


def body(name: str) -> str:
    """A table of a body."""
    return f'[[bodies]]\nname = "{name}"\nmass = 1.0\ninertia_com = 0.1\n'


def solid(name: str) -> str:
    """A table of a body in space."""
    return body(name).replace("0.1", "[0.1, 0.2, 0.1]")


def joint(name: str, parent: str, child: str, more: str, kind: str = "revolute") -> str:
    """A table of a joint."""
    ends = f'parent = "{parent}"\nchild = "{child}"\n'
    return f'[[joints]]\nname = "{name}"\ntype = "{kind}"\n{ends}{more}\n'


def strut(name: str, x: float) -> str:
    """A strut, and a wheel about its lower end, of a car."""
    slides = f'r_parent = [{x}, -0.3]\naxis = [0, 1]\ncoordinate = "{name}_travel"'
    return (
        joint(f"{name}_strut", "chassis", f"{name}_strut", slides, "prismatic")
        + joint(f"{name}_axle", f"{name}_strut", f"{name}_wheel", f'coordinate = "{name}_turn"')
    )  # fmt: skip


def planet(name: str, x: float, y: float) -> str:
    """A planet that meshes with the sun."""
    at = f'r_parent = [{x}, {y}]\ncoordinate = "turn_{name}"'
    mesh = (
        f'[[constraints]]\ntype = "gear"\nname = "mesh_{name}"\nteeth_1 = 20\nteeth_2 = 10\n'
        f'body_1 = "sun"\nbody_2 = "planet_{name}"\ncarrier = "carrier"\n'
    )
    return joint(f"pin_{name}", "carrier", f"planet_{name}", at) + mesh


def axle(name: str, x: float, y: float) -> str:
    """A wheel of a car in space."""
    at = f'r_parent = [{x}, {y}, -0.3]\naxis = [0, 1, 0]\ncoordinate = "turn_{name}"'
    return joint(f"axle_{name}", "body", f"wheel_{name}", at)


ALONG, RIM = "axis = [1, 0]\n", {"a": (2, 0), "b": (0, 2), "c": (-2, 0), "d": (0, -2)}
CORNERS = {"fl": (1.2, 0.7), "fr": (1.2, -0.7), "rl": (-1.2, 0.7), "rr": (-1.2, -0.7)}
CAR = "chassis", "front_strut", "rear_strut", "front_wheel", "rear_wheel"
SCENES = {
    "car": [
        *map(body, CAR),
        joint("travel", "world", "chassis", "", "planar"),
        strut("front", 1.2),
        strut("rear", -1.2),
        "[initial]\nq = { front_turn = 0.4, rear_turn = 0.4 }\n",
    ],
    "washing_machine": [
        *map(body, ("housing", "tub", "drum", "laundry")),
        joint("feet", "world", "housing", f'{ALONG}coordinate = "creep"', "prismatic"),
        joint("swing", "housing", "tub", 'coordinate = "sway"'),
        joint("bearing", "tub", "drum", 'coordinate = "spin"'),
        joint("load", "drum", "laundry", "r_parent = [0.2, 0]", "weld"),
        "[initial]\nq = { spin = 0.5, sway = 0.1 }\n",
    ],
    "ferris_wheel": [
        *map(body, ("wheel", *(f"cabin_{k}" for k in RIM))),
        joint("hub", "world", "wheel", 'coordinate = "turn"'),
        *(
            joint(f"hang_{k}", "wheel", f"cabin_{k}",
                  f'r_parent = [{x}, {y}]\nr_child = [0, 0.5]\ncoordinate = "swing_{k}"')
            for k, (x, y) in RIM.items()
        ),
        "[initial]\nq = { turn = 0.3 }\n",
    ],
    "crane": [
        *map(body, ("trolley", "jib", "hoist", "hook", "container")),
        joint("rail", "world", "trolley", f'{ALONG}coordinate = "s"', "prismatic"),
        joint("luff", "trolley", "jib", 'r_child = [-1.5, 0]\ncoordinate = "luffing"'),
        joint("rope_top", "jib", "hoist",
              'r_parent = [1.5, 0]\nr_child = [0, 0.6]\ncoordinate = "swing"'),
        joint("rope_end", "hoist", "hook",
              'axis = [0, -1]\nr_parent = [0, -0.6]\ncoordinate = "length"', "prismatic"),
        joint("shackle", "hook", "container", 'r_child = [0, 0.4]\ncoordinate = "sway"'),
        "[initial]\nq = { luffing = 0.8, swing = -0.7 }\n",
    ],
    "planetary_gear": [
        *map(body, ("sun", "carrier", "planet_a", "planet_b", "planet_c", "ring")),
        *(joint(f"{k}_shaft", "world", k, f'coordinate = "{k}_angle"')
          for k in ("sun", "carrier", "ring")),
        planet("a", 0.15, 0.0),
        planet("b", -0.075, 0.13),
        planet("c", -0.075, -0.13),
        "[initial]\nq = { carrier_angle = 0.3 }\n",
    ],
    "four_wheels": [
        "dimensions = 3\n",
        *map(solid, ("body", *(f"wheel_{k}" for k in CORNERS))),
        joint("ride", "world", "body", 'axis = [1, 0, 0]\ncoordinate = "x"', "prismatic"),
        *(axle(k, x, y) for k, (x, y) in CORNERS.items()),
    ],
}  # fmt: skip


def texts(drawing: Drawing) -> list[tuple[str, Box]]:
    """The labels of a drawing with what their letters cover, by a font's own sizes."""
    font, found = FontProperties(family="DejaVu Serif"), []
    picture = ElementTree.fromstring(svg(drawing))
    full = float(picture.get("font-size", 16.0))
    for label in picture.iter("text"):
        parts = [(label.text or "", 0.0, full)]
        for span in label:
            below = span.get("font-size") == "75%"
            parts.append((span.text or "", 4.0 * below, 0.75 * full if below else full))
        wide, low, high = 0.0, 0.0, 0.0
        for text, down, size in parts:
            if text := text.strip("\u200b"):
                extents = TextPath((0, 0), text, size=size, prop=font).get_extents()
                wide += extents.x1
                low, high = min(low, extents.y0 - down), max(high, extents.y1 - down)
        x, y = float(label.get("x", "")), drawing.height - float(label.get("y", ""))
        left = x if label.get("text-anchor") == "start" else x - wide / 2
        found.append(
            ("".join(text for text, _, _ in parts), (left, y + low, left + wide, y + high))
        )
    return found


@pytest.mark.parametrize("name", SCENES)
def test_labels_are_clear_where_joints_coincide(name: str) -> None:
    """No label covers another, a body, an arm or a joint; an axis's letter is not there twice."""
    scene = elaborate(parse_scene(f'name = "{name}"\n' + "".join(SCENES[name])))
    drawing = mechanism_sketch(scene, ())
    found = texts(drawing)
    drawn = [
        np.linspace(a, b, 60)
        for item in drawing.items
        if isinstance(item, Line) and item.style in ("body", "arm")
        for a, b in pairwise(item.points)
    ]
    drawn += [np.array([item.centre]) for item in drawing.items if isinstance(item, Dot)]
    x, y = np.vstack(drawn).T
    for i, (text, (left, low, right, high)) in enumerate(found):
        assert left >= 0 and low >= 0 and right <= drawing.width and high <= drawing.height, text
        assert not ((x > left) & (x < right) & (y > low) & (y < high)).any(), (text, "is crossed")
        for other, (a, b, c, d) in found[:i]:
            assert a >= right or c <= left or b >= high or d <= low, (text, other)
            middle = np.subtract((left + right, low + high), (a + c, b + d)) / 2
            assert text != other or np.hypot(*middle) > 12, (text, "is there twice")
