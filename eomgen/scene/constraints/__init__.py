"""Constraints: what closes loops, and what restricts motions otherwise; one file each."""

from eomgen.scene.constraints.base import Constraint, ConstraintTable, Row
from eomgen.scene.constraints.loop import LoopJoint, closing

__all__ = ["Constraint", "ConstraintTable", "LoopJoint", "Row", "closing"]
