"""All kinds of joints, effects and constraints that a scene can list: ours, and those that other
packages add.

They are put together here and not where ours are listed, so that a package can import the bases.
"""

from typing import TYPE_CHECKING, Annotated, Any, Union, get_args

from pydantic import Field

from eomgen.base.plugins import added_tables
from eomgen.scene.constraints import AnyConstraint
from eomgen.scene.constraints.base import ConstraintTable
from eomgen.scene.effects import Effect
from eomgen.scene.effects.base import EffectTable
from eomgen.scene.joints import Joint
from eomgen.scene.joints.base import JointTable

__all__ = ["AnyConstraint", "Effect", "Joint"]


def _every(union: Any, group: str, base: type) -> Any:
    """A union of tables with those that packages add to its group."""
    own = get_args(get_args(union)[0])
    more = added_tables(group, own, base)
    return Annotated[Union[*own, *more], Field(discriminator="type")] if more else union


if not TYPE_CHECKING:
    Joint = _every(Joint, "joints", JointTable)
    Effect = _every(Effect, "effects", EffectTable)
    AnyConstraint = _every(AnyConstraint, "constraints", ConstraintTable)
