"""Joint types, one file each. To add one, write its file and list it here."""

from typing import Annotated

from pydantic import Field

from eomgen.scene.joints.ball import Ball
from eomgen.scene.joints.cylindrical import Cylindrical
from eomgen.scene.joints.free import Free
from eomgen.scene.joints.particle import Particle
from eomgen.scene.joints.planar import Planar
from eomgen.scene.joints.prismatic import Prismatic
from eomgen.scene.joints.revolute import Revolute
from eomgen.scene.joints.universal import Universal
from eomgen.scene.joints.weld import Weld

Joint = Annotated[
    Ball | Cylindrical | Free | Particle | Planar | Prismatic | Revolute | Universal | Weld,
    Field(discriminator="type"),
]
"""Any joint of a scene; its `type` selects the class."""

__all__ = [
    "Ball",
    "Cylindrical",
    "Free",
    "Joint",
    "Particle",
    "Planar",
    "Prismatic",
    "Revolute",
    "Universal",
    "Weld",
]
