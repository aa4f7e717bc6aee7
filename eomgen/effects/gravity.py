"""Uniform gravity, downwards."""

from collections.abc import Iterator
from typing import Literal

from eomgen.effects.base import Input, Load, Mechanism, Scalar
from eomgen.language.base import Identifier, Table
from eomgen.language.formula import ZERO
from eomgen.language.quantity import Quantity, quantity


class Gravity(Table):
    """Weight m g of every body, along -y in the plane (handout (5), (9)), along -z in space."""

    type: Literal["gravity"]
    name: Identifier = "gravity"
    g: Quantity = quantity("m/s^2", "gravitational acceleration, downwards")

    def inputs(self, dimensions: int) -> tuple[Input, ...]:
        """Gravity takes no input."""
        return ()

    def loads(self, mechanism: Mechanism) -> Iterator[Load]:
        """The weight of each body, at its centre of mass."""
        zeros = (mechanism.value(ZERO),) * mechanism.dimensions
        g = mechanism.value(self.g)
        for body in mechanism.bodies:
            yield Load(body, (*zeros[1:], -mechanism.mass(body) * g), zeros, "gravity")

    def potential_energy(self, mechanism: Mechanism) -> Scalar:
        """Σ m g times height, J, zero at the world's origin."""
        g, total = mechanism.value(self.g), mechanism.value(ZERO)
        for body in mechanism.bodies:
            total = total + mechanism.mass(body) * g * mechanism.height(body)
        return total
