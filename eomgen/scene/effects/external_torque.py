"""An external torque on a body."""

from collections.abc import Iterator, Mapping
from typing import ClassVar, Literal, Self

from pydantic import Field

from eomgen.base.errors import SceneError
from eomgen.language.base import Identifier
from eomgen.language.quantity import Quantity, Vector, quantity
from eomgen.language.rewriting import constant
from eomgen.scene.effects.base import EffectTable, Input, Load, Mechanism
from eomgen.scene.effects.elements import Layout, Pull


class ExternalTorque(EffectTable):
    """A torque on a body: one component about z in the plane, three in world or body axes in space.

    With `torque = "input"` it is the input `<name>`, in space `<name>_x`, `<name>_y`, `<name>_z`.
    """

    told = "A torque on a body."
    example: ClassVar[str] = """
[[effects]]
type = "external_torque"
name = "twist"
body = "hand"
torque = "input"
"""
    body_fields = ("body",)
    input_field = "torque"

    type: Literal["external_torque"]
    name: Identifier
    body: Identifier = Field(description="body it acts on")
    axes: Literal["world", "body"] = Field(default="world", description="axes of its components")
    torque: Literal["input"] | Quantity | Vector = quantity(
        "N m", "torque", sees=("motion",), union_mode="left_to_right"
    )

    def checked(self, dimensions: int, location: str) -> Self:
        """Check that the torque is a number in the plane, and has three components in space."""
        if dimensions == 2 and isinstance(self.torque, tuple):
            raise SceneError(f"{location}.torque: is a list; in the plane give one number, about z")
        if dimensions == 3 and self.torque != "input":
            parts = len(self.torque) if isinstance(self.torque, tuple) else 1
            if parts != 3:
                count = f"{parts} component" + "s" * (parts > 1)
                raise SceneError(f"{location}.torque: has {count}; space takes 3")
        return self

    def inputs(self, dimensions: int) -> tuple[Input, ...]:
        """An input for each component with `torque = "input"`."""
        if self.torque != "input":
            return ()
        about = f"torque {self.name} on {self.body}"
        if dimensions == 2:
            return (Input(self.name, "N m", about),)
        about += f", {self.axes} axes"
        return tuple(Input(f"{self.name}_{axis}", "N m", f"{about}, {axis}") for axis in "xyz")

    def loads(self, mechanism: Mechanism) -> Iterator[Load]:
        """The torque itself."""
        if self.torque == "input":
            torque = tuple(mechanism.input(i.name) for i in self.inputs(mechanism.dimensions))
        elif isinstance(self.torque, tuple):
            torque = tuple(mechanism.value(part) for part in self.torque)
        else:
            torque = (mechanism.value(self.torque),)
        zeros = (mechanism.zero,) * mechanism.dimensions
        if self.axes == "body" and mechanism.dimensions == 3:
            outside = mechanism.outward(self.body, torque)
            yield Load(self.body, zeros, zeros, "applied", outside, in_body=(zeros, torque))
        else:
            yield Load(self.body, zeros, zeros, "applied", torque)

    def elements(self, layout: Layout) -> Iterator[Pull]:
        """A mark at the centre of mass."""
        at = constant(*[0.0] * layout.dimensions)
        yield Pull("torque", self.name, layout.bodies[self.body], at)

    def keeps_energy(
        self, values: Mapping[str, float], inputs: Mapping[str, float], dimensions: int
    ) -> bool:
        """True if its inputs are 0."""
        return self.idle(inputs, dimensions)
