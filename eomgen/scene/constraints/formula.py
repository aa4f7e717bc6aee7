"""Constraints that a scene gives as formulas."""

from collections.abc import Iterator
from typing import ClassVar, Literal, Self

from pydantic import Field

from eomgen.base.errors import SceneError
from eomgen.language.base import Identifier
from eomgen.language.formula import Apply, Formula, Name
from eomgen.language.quantity import Quantity, quantity
from eomgen.scene.constraints.base import ConstraintTable, Given, Linkage, Row
from eomgen.scene.effects.base import JointLoad


class Coupling(ConstraintTable):
    """A coordinate follows others: `coordinate` = `equals`, a formula of coordinates, `t` and
    parameters. Racks, screws, differentials and mimic joints are couplings; see also `gear` and
    `belt`.

    The multiplier is the generalised force on `coordinate`, N m or N.
    """

    told = "A coordinate follows others."
    example: ClassVar[str] = """
[[constraints]]
type = "coupling"
name = "gears"
coordinate = "elbow_angle"
equals = "-2*shoulder_angle + 0.1"
"""
    coordinate_fields = ("coordinate",)

    type: Literal["coupling"]
    coordinate: Identifier = Field(description="coordinate that follows")
    equals: Quantity = quantity("", "its value", sees=("motion",))

    def loop_part(self) -> Given:
        """Its formula."""
        return Given(self.coordinate, self.equals)

    def row_names(self, dimensions: int) -> list[tuple[str, str]]:
        """One row, of the constraint's name."""
        return [(self.name, "N m")]

    def rows(self, mechanism: Linkage) -> Iterator[Row]:
        """`coordinate` - `equals`."""
        yield position_row(mechanism, Apply("-", (Name(self.coordinate), self.equals)))


class Equation(ConstraintTable):
    """An equation of the scene: `position` = 0, a formula of coordinates, `t` and parameters; or
    `velocity` = 0, a formula that is linear in the velocities, which need not be the rate of one of
    positions.
    """

    told = "An equation of coordinates, or one that is linear in the velocities."
    example: ClassVar[str] = """
[[constraints]]
type = "equation"
name = "level"
position = "shoulder_angle + elbow_angle"
"""
    type: Literal["equation"]
    position: Quantity | None = quantity("", "is kept at 0", sees=("motion",), default=None)
    velocity: Quantity | None = quantity("", "is kept at 0", sees=("motion",), default=None)

    def checked(self, dimensions: int, location: str) -> Self:
        """Check that one of the two is given."""
        if (self.position is None) == (self.velocity is None):
            raise SceneError(f"{location}: give position or velocity, one of them")
        return self

    def row_names(self, dimensions: int) -> list[tuple[str, str]]:
        """One row, of the constraint's name."""
        return [(self.name, "N m")]

    def velocity_rows(self, dimensions: int) -> list[str]:
        """The row, if the formula is one of velocities."""
        return [] if self.velocity is None else [self.name]

    def rows(self, mechanism: Linkage) -> Iterator[Row]:
        """The formula itself."""
        if self.position is not None:
            yield position_row(mechanism, self.position)
        else:
            assert self.velocity is not None
            partials = mechanism.partials(self.velocity, "velocities")
            loads = tuple(JointLoad(joint, slope, i) for joint, i, slope in partials.slopes)
            yield Row(None, loads, partials.at_rest)


def position_row(mechanism: Linkage, formula: Formula) -> Row:
    """The row of a formula of positions and time."""
    partials = mechanism.partials(formula, "positions")
    loads = tuple(JointLoad(joint, slope, i) for joint, i, slope in partials.slopes)
    return Row(partials.value, loads, partials.by_time)
