"""Effects, one file each: table, loads, energy. To add one, write its file and list it here."""

from typing import Annotated

from pydantic import Field

from eomgen.scene.effects.attraction import PointGravity
from eomgen.scene.effects.contact import BodyContact
from eomgen.scene.effects.controller import Controller
from eomgen.scene.effects.drag import Drag
from eomgen.scene.effects.driven import Driven
from eomgen.scene.effects.external_force import ExternalForce
from eomgen.scene.effects.external_torque import ExternalTorque
from eomgen.scene.effects.field import ForceField
from eomgen.scene.effects.gravity import Gravity
from eomgen.scene.effects.joint_friction import JointFriction
from eomgen.scene.effects.joint_spring import JointSpring
from eomgen.scene.effects.joint_stop import JointStop
from eomgen.scene.effects.motor import Motor
from eomgen.scene.effects.pairwise import Pairwise
from eomgen.scene.effects.pd import Pd
from eomgen.scene.effects.pid import Pid
from eomgen.scene.effects.sampled_controller import SampledController
from eomgen.scene.effects.spring import Spring
from eomgen.scene.effects.tether import Tether

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
    | Pairwise
    | Pd
    | Pid
    | PointGravity
    | SampledController
    | Spring
    | Tether,
    Field(discriminator="type"),
]
"""Any effect of a scene; its `type` selects the class."""

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
    "Pairwise",
    "Pd",
    "Pid",
    "PointGravity",
    "SampledController",
    "Spring",
    "Tether",
]
