"""Bodies whose points are given in a frame of their own."""

from typing import Any

import numpy as np
import pytest

import eomgen
from eomgen.scene.appearance import appearance_of
from eomgen.scene.look import numbers
from eomgen.show.picture import shapes_of

COM = {"arm": [0.3, -0.2, 0.1], "tip": [-0.1, 0.25, 0.4]}


def scene(dimensions: int, framed: bool) -> dict[str, Any]:
    """Two bodies with points of all kinds: from centres of mass, or shifted into frames."""
    n = dimensions

    def at(body: str, *point: float) -> list[float]:
        return [x + framed * c for x, c in zip(point[:n], COM[body], strict=False)]

    def body(name: str, mass: float) -> dict[str, Any]:
        inertia = 0.2 if n == 2 else [0.2, 0.25, 0.3]
        rod = {"type": "rod", "start": at(name, 0, 0, 0), "end": at(name, 1, 0, 0), "width": 0.1}
        made = {"name": name, "mass": mass, "inertia_com": inertia, "shapes": [rod]}
        return {**made, "com": COM[name][:n]} if framed else made

    axis = {} if n == 2 else {"axis": [1, 2, 3]}
    turned = {} if n == 2 else {"orientation_deg": [20, 30, 40]}
    slide = [1.0, 2.0, 0.5][:n]
    soft = {"type": "contact", "law": "spring_damper", "stiffness": 50.0, "damping": 1.0}
    return {
        "name": "framed",
        "dimensions": n,
        "route": "aba",
        "outputs": ["joint_forces", "point_positions"],
        "bodies": [body("arm", 1.5), body("tip", 0.7)],
        "joints": [
            {"name": "pin", "type": "revolute", "parent": "world", "child": "arm", **axis,
             "r_parent": [0.1, 0.2, 0.3][:n], "r_child": at("arm", -0.4, 0.1, 0.2), **turned},
            {"name": "rail", "type": "prismatic", "parent": "arm", "child": "tip", "axis": slide,
             "r_parent": at("arm", 0.5, 0.3, 0.1), "r_child": at("tip", 0.2, -0.3, 0.3)},
        ],
        "points": [
            {"name": "nose", "body": "tip", "at": at("tip", 0.3, 0.1, -0.2)},
            {"name": "heart", "body": "tip"},
        ],
        "effects": [
            {"type": "gravity", "g": 9.81},
            {"type": "spring", "name": "rope", "body_1": "world", "at_1": [1.0, 1.0, 0.0][:n],
             "body_2": "tip", "at_2": at("tip", 0.4, 0.0, 0.1), "stiffness": 20.0},
            {"type": "spring", "name": "to_heart", "body_1": "arm", "body_2": "world",
             "stiffness": 7.0},
            {"type": "external_force", "name": "push", "body": "arm",
             "at": at("arm", 0.2, 0.3, 0.1), "force": [1.0, 2.0, 3.0][:n]},
            {"type": "drag", "name": "air", "body": "tip", "at": at("tip", 0.1, 0.1, 0.1),
             "quadratic": 0.3},
            {"type": "field", "name": "wind", "points": ["nose"], "force": ["y", "x*vx", 0][:n]},
            {**soft, "name": "floor", "body": "tip", "at": at("tip", 0.1, 0.2, 0.3),
             "radius": 5.0},
            {**soft, "name": "wall", "body": "tip", "radius": 0.5, "other": "arm",
             "normal": [1.0, 2.0, 2.0][:n],
             "offset": 3 + framed * np.dot(COM["arm"][:n], [1, 2, 2][:n])
             / np.linalg.norm([1, 2, 2][:n])},
            {**soft, "name": "balls", "body": "tip", "radius": 1.0, "against": "ball",
             "other": "arm", "other_at": at("arm", 0.2, 0.2, 0.2), "other_radius": 2.0},
        ],
    }  # fmt: skip


@pytest.mark.every(2)
@pytest.mark.parametrize("dimensions", [2, 3])
def test_a_frame_changes_what_is_written_and_not_the_motion(dimensions: int) -> None:
    """Every kind of point, shifted into frames of their own: the same derivative and outputs."""
    plain, framed = (eomgen.generate(scene(dimensions, way)) for way in (False, True))
    a, b = map(eomgen.load, (plain, framed))
    random = np.random.default_rng(3)
    for _ in range(5):
        y = random.uniform(-1, 1, len(a.STATES))
        for name in ("derivative", "joint_forces", "point_positions"):
            one, other = (getattr(module, name)(0.3, y) for module in (a, b))
            assert np.abs(one - other).max() < 1e-10 * np.abs(one).max()
    values = dict(zip(("arm_com_x", "arm_com_y"), COM["arm"], strict=False))
    assert values.items() <= b.PARAMETERS.items()
    scenes = [eomgen.read(scene(dimensions, way)) for way in (False, True)]
    shapes = [shapes_of(eomgen.check(each), appearance_of(each))[1] for each in scenes]
    for one, other in zip(*shapes, strict=True):
        for end in ("start", "end"):
            assert np.allclose(*(numbers(getattr(rod, end)) for rod in (one, other)))


def test_a_frame_at_the_joint_needs_no_points() -> None:
    """Joints that say nothing are at the origins; a compound pendulum about its own end."""
    given = {
        "name": "pendulum",
        "parameters": {"l": 0.4},
        "bodies": [{"name": "rod", "mass": 2.0, "inertia_com": 0.1, "com": [0, "-l"]}],
        "joints": [{"name": "pin", "type": "revolute", "parent": "world", "child": "rod"}],
        "effects": [{"type": "gravity", "g": 9.81}],
    }
    module = eomgen.load(eomgen.generate(given))
    for length in (0.4, 0.9):
        rate = module.derivative(0.0, [0.7, 0.0], {"l": length})[1]
        true = -2 * 9.81 * length * np.sin(0.7) / (0.1 + 2 * length**2)
        assert rate == pytest.approx(true, rel=1e-14)


def test_a_point_of_several_frames_is_refused() -> None:
    """It would be another point of each; so is a centre with too few components."""
    several = scene(2, True)
    several["effects"].append(
        {"type": "drag", "name": "all", "bodies": "all", "at": [0.1, 0.0], "linear": 1.0}
    )
    with pytest.raises(eomgen.SceneError, match=r"effects\[9\].at: is a point of several bodies"):
        eomgen.check(several)
    del several["effects"][-1]["at"]
    eomgen.check(several)
    several["bodies"][0]["com"] = [1, 2, 3]
    with pytest.raises(eomgen.SceneError, match=r"bodies\[0\].com: has 3 components"):
        eomgen.check(several)
