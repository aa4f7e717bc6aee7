"""Tables of a scene that an MJCF file becomes, and the names of its objects in the scene."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

from eomgen.scene.importers.parts import Parts

LONGEST = 300
"""Longest sum that is written as one formula; the reader takes formulas of 500 characters."""
FREE, BALL, SLIDE, HINGE = range(4)
"""MuJoCo's joint types (mjtJoint)."""
SINGLE = (SLIDE, HINGE)
"""Joints with one coordinate."""


@dataclass(frozen=True)
class Names:
    """Names in the scene of bodies, joints, actuators, tendons and equalities, by number.

    A hinge or slide has its joint's name for coordinate, and `<name>_dot` for velocity.

    between  massless bodies between the joints of a body, by body and number of the joint before
    split    free joints that became a particle joint and a ball joint
    """

    bodies: tuple[str, ...]
    joints: tuple[str, ...]
    inputs: tuple[str, ...]
    tendons: tuple[str, ...]
    equalities: tuple[str, ...]
    between: Mapping[tuple[int, int], str]
    split: frozenset[int] = frozenset()


@dataclass
class Mechanism(Parts):
    """The parts of a scene. `lost` counts what has no counterpart, `remarks` are other remarks."""

    lost: Counter[str] = field(default_factory=Counter)
    remarks: dict[str, None] = field(default_factory=dict)

    def sum(self, name: str, factors: Mapping[str, float]) -> str:
        """A sum of names with factors as a formula; a long one is of definitions `name_1`, …"""
        terms = [f"{x!r}*{of}" if x != 1.0 else of for of, x in factors.items()]
        while len(" + ".join(terms)) > LONGEST:
            parts, terms = [terms[i : i + 3] for i in range(0, len(terms), 3)], []
            for part in parts:
                own = f"{name}_{sum(key.startswith(f'{name}_') for key in self.definitions) + 1}"
                self.definitions[own] = " + ".join(part)
                terms.append(own)
        return " + ".join(terms) or "0"

    def remark(self, text: str) -> None:
        """Add a remark, once."""
        self.remarks[text] = None
