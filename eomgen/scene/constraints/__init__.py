"""Constraints: what closes loops, and what restricts motions otherwise; one file each.

To add one, write its file and list it here.
"""

from typing import Annotated

from pydantic import Field

from eomgen.scene.constraints.base import Constraint, ConstraintTable, Row
from eomgen.scene.constraints.distance import Distance
from eomgen.scene.constraints.formula import Coupling, Equation
from eomgen.scene.constraints.loop import LoopJoint, closing

AnyConstraint = Annotated[Coupling | Distance | Equation, Field(discriminator="type")]
"""Any constraint of a scene; its `type` selects the class."""

__all__ = [
    "AnyConstraint",
    "Constraint",
    "ConstraintTable",
    "Coupling",
    "Distance",
    "Equation",
    "LoopJoint",
    "Row",
    "closing",
]
