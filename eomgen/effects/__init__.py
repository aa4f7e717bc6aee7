"""Effects, one file each: schema, loads, energy. To add one, write its file and name it here."""

from typing import Annotated

from pydantic import Field

from eomgen.effects.external_force import ExternalForce
from eomgen.effects.gravity import Gravity
from eomgen.effects.motor import Motor

Effect = Annotated[Gravity | ExternalForce | Motor, Field(discriminator="type")]
"""Any effect of a scene, told apart by its `type`."""

__all__ = ["Effect", "ExternalForce", "Gravity", "Motor"]
