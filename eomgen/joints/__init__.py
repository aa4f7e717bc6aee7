"""Joint types, one file each. To add one, write its file and name it here."""

from typing import Annotated

from pydantic import Field

from eomgen.joints.ball import Ball
from eomgen.joints.cylindrical import Cylindrical
from eomgen.joints.free import Free
from eomgen.joints.planar import Planar
from eomgen.joints.prismatic import Prismatic
from eomgen.joints.revolute import Revolute
from eomgen.joints.universal import Universal
from eomgen.joints.weld import Weld

Joint = Annotated[
    Ball | Cylindrical | Free | Planar | Prismatic | Revolute | Universal | Weld,
    Field(discriminator="type"),
]
"""Any joint of a scene, told apart by its `type`."""

__all__ = [
    "Ball",
    "Cylindrical",
    "Free",
    "Joint",
    "Planar",
    "Prismatic",
    "Revolute",
    "Universal",
    "Weld",
]
