"""Constraints: what closes loops, and what restricts motions otherwise; one file each.

To add one, write its file and list it here.
"""

from typing import Annotated

from pydantic import Field

from eomgen.scene.constraints.base import Constraint, ConstraintTable, Row
from eomgen.scene.constraints.belt import Belt
from eomgen.scene.constraints.distance import Distance
from eomgen.scene.constraints.formula import Coupling, Equation
from eomgen.scene.constraints.gear import Gear
from eomgen.scene.constraints.knife_edge import KnifeEdge
from eomgen.scene.constraints.loop import LoopJoint, loop_joint
from eomgen.scene.constraints.point_on import PointOn
from eomgen.scene.constraints.pulley import Pulley
from eomgen.scene.constraints.rolling import Rolling
from eomgen.scene.constraints.rope import Rope

AnyConstraint = Annotated[
    Belt | Coupling | Distance | Equation | Gear | KnifeEdge | PointOn | Pulley | Rolling | Rope,
    Field(discriminator="type"),
]
"""Any constraint of a scene; its `type` selects the class."""

__all__ = [
    "AnyConstraint",
    "Belt",
    "Constraint",
    "ConstraintTable",
    "Coupling",
    "Distance",
    "Equation",
    "Gear",
    "KnifeEdge",
    "LoopJoint",
    "PointOn",
    "Pulley",
    "Rolling",
    "Rope",
    "Row",
    "loop_joint",
]
