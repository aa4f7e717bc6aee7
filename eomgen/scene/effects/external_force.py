"""An external force at a point of a body."""

from collections.abc import Iterator, Mapping
from typing import ClassVar, Literal

from pydantic import Field

from eomgen.language.base import Identifier
from eomgen.language.quantity import Vector, quantity
from eomgen.scene.effects.base import EffectTable, Input, Load, Mechanism


class ExternalForce(EffectTable):
    """A force f_e at the point r_e of a body (handout (29)-(34)), in world or body axes.

    With `force = "input"` its components are the inputs `<name>_x`, `<name>_y` and, in space,
    `<name>_z`.
    """

    told = "A force at a point of a body."
    example: ClassVar[str] = """
[[effects]]
type = "external_force"
name = "pull"
body = "hand"
at = [0.1, 0]
force = ["2*sin(t)", 0]
"""
    body_fields = ("body",)
    vector_fields = ("at", "force")
    points_of: ClassVar[Mapping[str, tuple[str, ...]]] = {"at": ("body",)}
    input_field = "force"

    type: Literal["external_force"]
    body: Identifier = Field(description="body it acts on")
    axes: Literal["world", "body"] = Field(default="world", description="axes of its components")
    at: Vector = quantity("m", "point from the centre of mass", default=(), validate_default=False)
    force: Literal["input"] | Vector = quantity(
        "N", "force", sees=("motion",), union_mode="left_to_right"
    )

    def inputs(self, dimensions: int) -> tuple[Input, ...]:
        """An input for each component with `force = "input"`."""
        if self.force != "input":
            return ()
        about = f"force {self.name} on {self.body}" + ", body axes" * (self.axes == "body")
        return tuple(
            Input(f"{self.name}_{axis}", "N", f"{about}, {axis}") for axis in "xyz"[:dimensions]
        )

    def loads(self, mechanism: Mechanism) -> Iterator[Load]:
        """The force itself."""
        at = tuple(mechanism.value(part) for part in self.at)
        if isinstance(self.force, tuple):
            force = tuple(mechanism.value(part) for part in self.force)
        else:
            force = tuple(mechanism.input(i.name) for i in self.inputs(mechanism.dimensions))
        if self.axes == "body":
            outside = mechanism.outward(self.body, force)
            yield Load(self.body, outside, at, "applied", in_body=(force, ()))
        else:
            yield Load(self.body, force, at, "applied")

    def keeps_energy(
        self, values: Mapping[str, float], inputs: Mapping[str, float], dimensions: int
    ) -> bool:
        """True if its inputs are 0."""
        return self.idle(inputs, dimensions)
