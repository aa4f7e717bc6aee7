"""Effects, one file each: schema, loads, energy. To add one, write its file and name it here."""

from typing import Annotated

from pydantic import Field

from eomgen.effects.attraction import PointGravity
from eomgen.effects.contact import BodyContact
from eomgen.effects.controller import Controller
from eomgen.effects.drag import Drag
from eomgen.effects.driven import Driven
from eomgen.effects.external_force import ExternalForce
from eomgen.effects.external_torque import ExternalTorque
from eomgen.effects.field import ForceField
from eomgen.effects.gravity import Gravity
from eomgen.effects.joint_friction import JointFriction
from eomgen.effects.joint_spring import JointSpring
from eomgen.effects.joint_stop import JointStop
from eomgen.effects.motor import Motor
from eomgen.effects.pd import Pd
from eomgen.effects.pid import Pid
from eomgen.effects.spring import Spring

Effect = Annotated[
    Gravity
    | BodyContact
    | Controller
    | Drag
    | Driven
    | ExternalForce
    | ExternalTorque
    | ForceField
    | JointFriction
    | JointSpring
    | JointStop
    | Motor
    | Pd
    | Pid
    | PointGravity
    | Spring,
    Field(discriminator="type"),
]
"""Any effect of a scene, told apart by its `type`."""

__all__ = [
    "BodyContact",
    "Controller",
    "Drag",
    "Driven",
    "Effect",
    "ExternalForce",
    "ExternalTorque",
    "ForceField",
    "Gravity",
    "JointFriction",
    "JointSpring",
    "JointStop",
    "Motor",
    "Pd",
    "Pid",
    "PointGravity",
    "Spring",
]
