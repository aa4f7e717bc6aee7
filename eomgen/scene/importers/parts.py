"""The parts of a scene that a robot file becomes, and the tables that they make."""

from dataclasses import dataclass, field
from typing import Any

from eomgen.base.text import brief

Tables = list[dict[str, Any]]
SLIDING_SPEED = "friction_speed"
"""The parameter of the speed at which Coulomb friction is smoothed, rad/s or m/s."""
SPEED = 0.01
"""Its value."""


@dataclass
class Parts:
    """The parts of a scene, collected one after another. `start` holds the initial coordinates."""

    inputs: Tables = field(default_factory=list)
    parameters: dict[str, Any] = field(default_factory=dict)
    definitions: dict[str, str] = field(default_factory=dict)
    bodies: Tables = field(default_factory=list)
    joints: Tables = field(default_factory=list)
    effects: Tables = field(default_factory=list)
    constraints: Tables = field(default_factory=list)
    locked: dict[str, float] = field(default_factory=dict)
    start: dict[str, float] = field(default_factory=dict)

    def tables(self, name: str, file: str) -> dict[str, Any]:
        """All tables of the scene of that name, in the order of a file."""
        found: dict[str, Any] = {
            "name": name,
            "title": brief(f"{name}, from {file}"),
            "dimensions": 3,
        }
        if self.inputs:
            found["inputs"] = self.inputs
        if any("coulomb" in effect for effect in self.effects):
            about = "speed at which Coulomb friction is smoothed, rad/s or m/s"
            self.parameters[SLIDING_SPEED] = {"value": SPEED, "about": about}
        if self.parameters:
            found["parameters"] = self.parameters
        if self.definitions:
            found["definitions"] = self.definitions
        found |= {"bodies": self.bodies, "joints": self.joints, "effects": self.effects}
        if self.constraints:
            found["constraints"] = self.constraints
        if self.locked:
            found["locked"] = self.locked
        if self.start:
            found["initial"] = {"q": self.start}
        return found
