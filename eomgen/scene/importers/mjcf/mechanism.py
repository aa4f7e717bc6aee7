"""Tables of a scene that an MJCF file becomes, and the names of its objects in the scene."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

Tables = list[dict[str, Any]]
WORLD_BODY = 0
FREE, BALL, SLIDE, HINGE = range(4)
"""MuJoCo's joint types (mjtJoint)."""
SINGLE = (SLIDE, HINGE)
"""Joints with one coordinate."""


@dataclass(frozen=True)
class Names:
    """Names in the scene of bodies, joints, actuators, tendons and equalities, by number.

    A hinge or slide has its joint's name for coordinate, and `<name>_dot` for velocity. `split` are
    the free joints that became a particle joint and a ball joint.
    """

    bodies: tuple[str, ...]
    joints: tuple[str, ...]
    inputs: tuple[str, ...]
    tendons: tuple[str, ...]
    equalities: tuple[str, ...]
    between: Mapping[tuple[int, int], str]
    """Massless bodies between the joints of a body, by body and number of the joint before."""
    split: frozenset[int] = frozenset()


@dataclass
class Mechanism:
    """The tables of a scene. `lost` counts what has no counterpart, `remarks` are other remarks."""

    inputs: Tables = field(default_factory=list)
    definitions: dict[str, str] = field(default_factory=dict)
    bodies: Tables = field(default_factory=list)
    joints: Tables = field(default_factory=list)
    effects: Tables = field(default_factory=list)
    constraints: Tables = field(default_factory=list)
    locked: dict[str, float] = field(default_factory=dict)
    start: dict[str, float] = field(default_factory=dict)
    lost: Counter[str] = field(default_factory=Counter)
    remarks: dict[str, None] = field(default_factory=dict)

    def remark(self, text: str) -> None:
        """Add a remark, once."""
        self.remarks[text] = None
