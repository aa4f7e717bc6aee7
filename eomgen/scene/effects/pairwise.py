"""Forces between every two bodies of a group."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from eomgen.language.base import Identifier
from eomgen.language.conditions import are_zero
from eomgen.language.formula import ZERO
from eomgen.language.quantity import Quantity, quantity
from eomgen.scene.effects.base import EffectTable, Load, Mechanism, Scalar, Vector
from eomgen.scene.effects.bodies import wrong
from eomgen.scene.effects.elements import Layout, Link
from eomgen.scene.effects.spring import Spring, line_of
from eomgen.scene.effects.vectors import dot, negative, scale, sub

KINDS = ("gravitation", "stiffness", "law")


class Pairwise(EffectTable):
    """A force along the line between the centres of mass of every two of `bodies`:

    - `gravitation` G: the attraction G m_1 m_2 r/(r² + ε²)^1.5 at the distance r, with the
      `softening` ε. It has the potential energy -G m_1 m_2/sqrt(r² + ε²). Without softening it is
      infinite where two bodies meet;
    - `stiffness` k: springs of this `rest_length`, with `damping`; see `spring`. The potential
      energy is that of the springs;
    - `law`: an attraction that is a formula of the `distance` r (m) and its `rate` (m/s). It has no
      potential energy, so its work counts as that of an applied force.
    """

    told = "A force along the line between the centres of mass of every two bodies."
    example: ClassVar[str] = """
[[effects]]
type = "pairwise"
name = "attraction"
bodies = ["arm", "hand"]
gravitation = 6.7e-11
"""
    body_fields = ("bodies",)

    type: Literal["pairwise"]
    bodies: Literal["all"] | Annotated[tuple[Identifier, ...], Field(min_length=2)] = Field(
        default="all", description="the group; 'all' are all bodies of the scene"
    )
    gravitation: Quantity | None = quantity(
        "N m^2/kg^2", "gravitational constant", "nonnegative", default=None
    )
    softening: Quantity = quantity(
        "m", "softening of gravitation", "nonnegative", default=ZERO, validate_default=False
    )
    stiffness: Quantity | None = quantity("N/m", "stiffness", "nonnegative", default=None)
    damping: Quantity = quantity(
        "N s/m", "damping of the springs", "nonnegative", default=ZERO, validate_default=False
    )
    rest_length: Quantity = quantity(
        "m", "rest length of the springs", "nonnegative", default=ZERO, validate_default=False
    )
    law: Quantity | None = quantity(
        "N", "attraction", sees=("motion", "distance", "rate"), default=None
    )

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        given = [kind for kind in KINDS if getattr(self, kind) is not None]
        if len(given) != 1:
            what = f"is given in addition to '{given[0]}'" if given else "is missing"
            raise wrong(given[1] if given else KINDS[0], f"{what}; give one of {', '.join(KINDS)}")
        own = {"gravitation": ("softening",), "stiffness": ("damping", "rest_length")}
        for kind, keys in own.items():
            for key in keys:
                if key in self.model_fields_set and kind != given[0]:
                    raise wrong(key, f"belongs to {kind}, not to {given[0]}; leave it out")
        for i, name in enumerate(self.bodies if isinstance(self.bodies, tuple) else ()):
            if name in self.bodies[:i]:
                raise wrong(f"bodies[{i}]", f"'{name}' is listed twice; leave one out")
        return self

    def loads(self, mechanism: Mechanism) -> Iterator[Load]:
        """Equal and opposite forces on every two bodies: one load on each."""
        zeros = (mechanism.zero,) * mechanism.dimensions
        totals: dict[str, Vector] = {}
        for first, second in self.pairs(mechanism.bodies):
            pull = self._pull(mechanism, first, second)
            for body, force in ((first, pull), (second, negative(pull))):
                before = totals.get(body)
                totals[body] = (
                    force
                    if before is None
                    else tuple(a + b for a, b in zip(before, force, strict=True))
                )
        for body, force in totals.items():
            yield Load(body, force, zeros, "applied")

    def potential_energy(self, mechanism: Mechanism) -> Scalar:
        """The sum over all pairs, J; 0 for a law."""
        total = mechanism.zero
        for first, second in self.pairs(mechanism.bodies):
            if self.gravitation is not None:
                _, softened = self._apart(mechanism, first, second)
                strength = self._strength(mechanism, first, second)
                total = total - strength / mechanism.call("sqrt", softened)
            elif self.stiffness is not None:
                total = total + self.spring(mechanism.dimensions, first, second).potential_energy(
                    mechanism
                )
        return total

    def elements(self, layout: Layout) -> Iterator[Link]:
        """A spring between every two bodies; a dashed line for other attractions."""
        for one, two in self.pairs(tuple(layout.bodies)[1:]):
            for link in self.spring(layout.dimensions, one, two).elements(layout):
                plain = self.stiffness is None
                yield replace(link, kind="pull", rest=None) if plain else link

    def keeps_energy(
        self, values: Mapping[str, float], inputs: Mapping[str, float], dimensions: int
    ) -> bool:
        """True without damping and without a law."""
        return self.law is None and are_zero(values, self.damping)

    def pairs(self, bodies: Sequence[str]) -> Iterator[tuple[str, str]]:
        """Every two of the group, in a mechanism with these bodies."""
        yield from combinations(self.bodies if isinstance(self.bodies, tuple) else bodies, 2)

    def _pull(self, mechanism: Mechanism, first: str, second: str) -> Vector:
        """The force on the first body, world axes, N."""
        if self.gravitation is not None:
            d, softened = self._apart(mechanism, first, second)
            cubed = softened * mechanism.call("sqrt", softened)
            return scale(self._strength(mechanism, first, second) / cubed, d)
        spring = self.spring(mechanism.dimensions, first, second)
        if self.law is None:
            return next(iter(spring.loads(mechanism))).force
        line = line_of(spring, mechanism)
        law = mechanism.value(self.law, distance=line.length, rate=line.rate)
        return scale(law / line.length, line.d)

    def _strength(self, mechanism: Mechanism, first: str, second: str) -> Scalar:
        """G m_1 m_2."""
        assert self.gravitation is not None
        one, other = (mechanism.value(mechanism.masses[body]) for body in (first, second))
        return mechanism.value(self.gravitation) * (one * other)

    def _apart(self, mechanism: Mechanism, first: str, second: str) -> tuple[Vector, Scalar]:
        """The vector from the first centre of mass to the second, and r² + ε²."""
        zeros = (mechanism.zero,) * mechanism.dimensions
        d = sub(mechanism.position(second, zeros), mechanism.position(first, zeros))
        softening = mechanism.value(self.softening)
        return d, dot(d, d) + softening * softening

    def spring(self, dimensions: int, first: str, second: str) -> Spring:
        """The spring between two bodies; of a law its line alone is used."""
        centre = (ZERO,) * dimensions
        return Spring.model_construct(
            type="spring",
            name=self.name,
            body_1=first,
            at_1=centre,
            body_2=second,
            at_2=centre,
            stiffness=self.stiffness or ZERO,
            damping=self.damping,
            rest_length=self.rest_length,
        )
