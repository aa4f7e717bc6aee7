"""Joint types, one file each. To add one, write its file and name it here."""

from typing import Annotated

from pydantic import Field

from eomgen.joints.free import Free
from eomgen.joints.revolute import Revolute

Joint = Annotated[Free | Revolute, Field(discriminator="type")]
"""Any joint of a scene, told apart by its `type`."""

__all__ = ["Free", "Joint", "Revolute"]
