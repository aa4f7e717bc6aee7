"""Uniform gravity along -y."""

from collections.abc import Iterator
from typing import Literal

from eomgen.effects.base import Input, Load, Mechanism, Scalar
from eomgen.language.base import Identifier, Table
from eomgen.language.formula import ZERO
from eomgen.language.quantity import Quantity, quantity


class Gravity(Table):
    """Weight m g of every body, along -y (handout (5), (9))."""

    type: Literal["gravity"]
    name: Identifier = "gravity"
    g: Quantity = quantity("m/s^2", "gravitational acceleration, along -y")

    def inputs(self) -> tuple[Input, ...]:
        """Gravity takes no input."""
        return ()

    def loads(self, mechanism: Mechanism) -> Iterator[Load]:
        """The weight of each body, at its centre of mass."""
        zero = mechanism.value(ZERO)
        g = mechanism.value(self.g)
        for body in mechanism.bodies:
            weight = -mechanism.mass(body) * g
            yield Load(body, (zero, weight), (zero, zero), zero, "gravity")

    def potential_energy(self, mechanism: Mechanism) -> Scalar:
        """Σ m g y, J, zero at the world's origin."""
        g = mechanism.value(self.g)
        return sum(mechanism.mass(body) * g * mechanism.height(body) for body in mechanism.bodies)
