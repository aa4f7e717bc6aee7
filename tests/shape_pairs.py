"""Distances and normals of contacts between shapes, beside MuJoCo's, at random poses."""

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from eomgen.dynamics.dynamics import Dynamics
from eomgen.dynamics.start.diagnostics import values_at
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.scalars.floats import FloatScalars
from eomgen.scene.effects.touching import Touch
from eomgen.scene.reader import read_tables

REACH, APART, FAR = 1.0, 1e-3, 10.0
"""Half the edge of the cube in which bodies are, and the distances that are compared, m."""
Shape = Mapping[str, Any]
SHAPES: Mapping[str, Shape] = {
    "sphere": {"radius": 0.3},
    "capsule": {"at": [0.0, 0.0, -0.4], "end": [0.0, 0.0, 0.4], "radius": 0.2},
    "box": {"half_sizes": [0.3, 0.5, 0.7]},
    "rounded box": {"half_sizes": [0.3, 0.5, 0.7], "radius": 0.1},
}
PAIRS = [
    *(("sphere", "sphere"), ("sphere", "capsule"), ("capsule", "capsule")),
    *(("sphere", "box"), ("capsule", "box"), ("rounded box", "box")),
]


def model_of(first: str, second: str) -> Model:
    """Two free bodies, each with a shape, that touch each other softly."""
    shapes = {name: {"body": name, **SHAPES[s]} for name, s in (("a", first), ("b", second))}
    bodies = [{"name": name, "mass": 1.0, "inertia_com": [1.0, 1.0, 1.0]} for name in "ab"]
    joints = [{"name": f"{name}_free", "type": "free", "child": name} for name in "ab"]
    law = {"name": "e", "law": "spring_damper", "stiffness": 1.0, "against": "each_other"}
    effects = [{"type": "contact", **law, "shapes": shapes}]
    tables = {"name": "pair", "dimensions": 3, "bodies": bodies, "joints": joints}
    return elaborate(read_tables(tables | {"effects": effects}))


def random_pose(rng: np.random.Generator) -> np.ndarray:
    """A place within a cube and a unit quaternion, (7,)."""
    turn = rng.normal(size=4)
    return np.concatenate([rng.uniform(-REACH, REACH, 3), turn / np.linalg.norm(turn)])


def touches_at(model: Model, poses: np.ndarray) -> list[Touch]:
    """The possible contacts at two poses (14,)."""
    state = [*poses, *([0.0] * 12)]
    dynamics = Dynamics(model, values_at(model, 0.0, state, {}, {}), FloatScalars())
    return [touch for effect in model.effects for touch in effect.touches(dynamics)]


def nearest(model: Model, poses: np.ndarray) -> tuple[float, np.ndarray]:
    """The least gap at two poses (14,), m, and its normal from the second body to the first."""
    touches = touches_at(model, poses)
    least = min(touches, key=lambda touch: float(touch.gap))
    normal = np.array(least.normal, dtype=float)
    return float(least.gap), normal if least.sides[0].body == "a" else -normal


class InMujoco:
    """MuJoCo with two free bodies, each with a geom."""

    def __init__(self, first: str, second: str) -> None:
        bodies = "".join(
            f"<body><freejoint/><geom {_geom(SHAPES[name])}/></body>" for name in (first, second)
        )
        option = '<option ccd_tolerance="1e-15" ccd_iterations="500"/>'
        text = f"<mujoco>{option}<worldbody>{bodies}</worldbody></mujoco>"
        self._model = mujoco.MjModel.from_xml_string(text)
        self._data = mujoco.MjData(self._model)

    def nearest(self, poses: np.ndarray) -> tuple[float, np.ndarray]:
        """The distance at two poses (14,), m, 0 or less if they touch, and its normal."""
        self._data.qpos[:] = poses
        mujoco.mj_kinematics(self._model, self._data)
        ends = np.zeros(6)
        distance = mujoco.mj_geomDistance(self._model, self._data, 0, 1, FAR, ends)
        arm = ends[:3] - ends[3:]
        return distance, arm / np.linalg.norm(arm)


def _geom(shape: Shape) -> str:
    """A geom's attributes."""
    if "half_sizes" in shape:
        return f'type="box" size="{" ".join(map(str, shape["half_sizes"]))}"'
    if "end" in shape:
        return f'type="capsule" size="{shape["radius"]} {shape["end"][2]}"'
    return f'type="sphere" size="{shape["radius"]}"'


def differences(first: str, second: str, seed: int, count: int) -> np.ndarray:
    """Our distance less MuJoCo's, and the greatest difference of their normals, at random poses at
    which shapes do not touch, (k, 2).
    """
    model, theirs = model_of(first, second), InMujoco(first, second)
    rng, found = np.random.default_rng(seed), list[tuple[float, float]]()
    rounding = sum(SHAPES[s].get("radius", 0.0) for s in (first, second) if "box" in s)
    while len(found) < count:
        poses = np.concatenate([random_pose(rng), random_pose(rng)])
        distance, normal = theirs.nearest(poses)
        if distance - rounding > APART:
            gap, ours = nearest(model, poses)
            found.append((gap + rounding - distance, float(np.abs(ours - normal).max())))
    return np.array(found)
