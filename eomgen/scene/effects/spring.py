"""A spring and damper, or a rope, between two points."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Self

from pydantic import Field, ValidationInfo, field_validator

from eomgen.base.errors import SceneError
from eomgen.language.base import Identifier
from eomgen.language.conditions import Condition, are_zero, not_negative
from eomgen.language.derivatives import derivative
from eomgen.language.formula import ZERO, Formula
from eomgen.language.quantity import Quantity, Vector, quantity
from eomgen.scene.effects.base import EffectTable, Load, Mechanism, Resistance, Scalar
from eomgen.scene.effects.base import Vector as Components
from eomgen.scene.effects.elements import Attachment, Layout, Link
from eomgen.scene.effects.vectors import at_least_zero, dot, nearest_square, negative, sub


class Spring(EffectTable):
    """A tension k s + c ds/dt (N) along the line between two points.

    d is the vector from point 1 to point 2, s = |d| - rest length. A `law` of `stretch` s (m) and
    `rate` ds/dt (m/s) replaces k s; it is positive in tension. With `tension_only` it is a rope:
    the force is 0 if s <= 0, and never compressive. The potential energy is ½ k s²; a law has none,
    so its work counts as that of an applied force.

    The direction of d is undefined at d = 0, so it is smoothed below ε = 1e-9 m: there |d| is
    replaced by ε and the force is T(ε) d/ε, which falls to 0; damping acts on the whole relative
    velocity, c ((u·ḋ) u + (1 - u·u) ḋ) with u = d/ε. Force and energy are continuous and
    consistent; with rest length 0 the force is k d everywhere.
    """

    example: ClassVar[str] = """
[[effects]]
type = "spring"
name = "elastic"
body_1 = "world"
at_1 = [1, 0]
body_2 = "hand"
stiffness = 40.0
rest_length = 0.5
"""
    anchor_fields = ("body_1", "body_2")
    vector_fields = ("at_1", "at_2")
    points_of: ClassVar[Mapping[str, tuple[str, ...]]] = {"at_1": ("body_1",), "at_2": ("body_2",)}

    type: Literal["spring"]
    body_1: Identifier = Field(description="body of its first end, or 'world'")
    at_1: Vector = quantity(
        "m", "first end from the centre of mass", default=(), validate_default=False
    )
    body_2: Identifier = Field(description="body of its second end, or 'world'")
    at_2: Vector = quantity(
        "m", "second end from the centre of mass", default=(), validate_default=False
    )
    stiffness: Quantity = quantity(
        "N/m", "stiffness", "nonnegative", default=ZERO, validate_default=False
    )
    damping: Quantity = quantity(
        "N s/m", "damping", "nonnegative", default=ZERO, validate_default=False
    )
    rest_length: Quantity = quantity("m", "rest length", default=ZERO, validate_default=False)
    tension_only: bool = Field(default=False, strict=True, description="whether it is a rope")
    law: Quantity | None = quantity(
        "N", "tension in place of stiffness", sees=("motion", "stretch", "rate"), default=None
    )
    allow_active: bool = Field(
        default=False, strict=True, description="whether stiffness and damping may be negative"
    )

    @field_validator("body_2")
    @classmethod
    def _another_body(cls, name: str, info: ValidationInfo) -> str:
        if name == info.data.get("body_1"):
            raise ValueError("is also body_1, whose points keep their distance; name another body")
        return name

    def checked(self, dimensions: int, location: str) -> Self:
        """Check that there is stiffness, damping or a law, but not stiffness and a law."""
        check_law(self, self.law, location)
        return self

    def conditions(self, location: str) -> Iterator[Condition]:
        """The rest length is not negative, even with `allow_active`."""
        yield not_negative(f"{location}.rest_length", self.rest_length, "m")

    def loads(self, mechanism: Mechanism) -> Iterator[Load]:
        """Equal and opposite forces on the two bodies."""
        line = line_of(self, mechanism)
        pull = self._pull(mechanism, line)
        yield from self._between(line, pull)

    def _pull(self, mechanism: Mechanism, line: "Line") -> tuple[Scalar, ...]:
        """The force on point 1, world axes."""
        damping, stretch, rate = mechanism.value(self.damping), line.stretch, line.rate
        if self.law is not None:
            tension = mechanism.value(self.law, stretch=stretch, rate=rate)
            per_length = tension / line.length
        else:
            per_length = mechanism.value(self.stiffness)
            tension = per_length * stretch
            if self.rest_length != ZERO:
                per_length = tension / line.length
        (per_length,) = mechanism.called("k", per_length)
        opposed = line.damped_velocity(mechanism.number(1.0))
        pull = tuple(per_length * d + damping * w for d, w in zip(line.d, opposed, strict=True))
        if not self.tension_only:
            return pull
        taut = mechanism.call("min", stretch, tension + damping * rate)
        nothing = mechanism.zero
        return tuple(mechanism.call("select", taut, part, nothing) for part in pull)

    def resistances(self, mechanism: Mechanism, h: Scalar) -> Iterator[Resistance]:
        """Along the line that of the law; across it that of the pull as the line turns, unless it
        is a push, which does not resist.
        """
        line, one = line_of(self, mechanism), mechanism.number(1.0)
        along, damping = law_slopes(self, mechanism, line.stretch if self.law else None, line.rate)
        if self.law is not None:
            pull = mechanism.value(self.law, stretch=line.stretch, rate=line.rate)
        else:
            pull = mechanism.value(self.stiffness) * line.stretch
        across = at_least_zero(mechanism, pull / line.length)
        if self.tension_only:
            taut = mechanism.call("min", line.stretch, pull + damping * line.rate)
            along, across, damping = (
                mechanism.call("select", taut, x, mechanism.zero) for x in (along, across, damping)
            )
        nothing = (mechanism.zero,) * (mechanism.dimensions - 1)
        for i in range(mechanism.dimensions):
            axis = (*nothing[:i], one, *nothing[i:])
            yield Resistance(self._between(line, axis), across, mechanism.zero)
        unit = tuple(x / line.length for x in line.d)
        yield Resistance(self._between(line, unit), along - across, damping)

    def _between(self, line: "Line", force: tuple[Scalar, ...]) -> tuple[Load, Load]:
        """The loads of a force on point 1 and its reaction on point 2."""
        return (
            Load(self.body_1, force, line.at_1, "applied"),
            Load(self.body_2, negative(force), line.at_2, "applied"),
        )

    def elements(self, layout: Layout) -> Iterator[Link]:
        """A coil, a damper, both, or a rope."""
        damped = self.damping != ZERO
        kind: Literal["coil", "damper", "spring_damper", "rope"]
        kind = "spring_damper" if damped else "coil"
        if self.tension_only:
            kind = "rope"
        elif self.law is None and self.stiffness == ZERO:
            kind = "damper"
        ends = ((self.body_1, self.at_1), (self.body_2, self.at_2))
        start, end = (Attachment(layout.bodies[body], at) for body, at in ends)
        rest = None if kind == "damper" else self.rest_length
        yield Link(kind, self.name, start, end, rest, layout.coil)

    def lengths(self) -> tuple[Formula, ...]:
        """Its rest length."""
        return (self.rest_length,)

    def keeps_energy(
        self, values: Mapping[str, float], inputs: Mapping[str, float], dimensions: int
    ) -> bool:
        """True without damping and without a law."""
        return self.law is None and are_zero(values, self.damping)

    def potential_energy(self, mechanism: Mechanism) -> Scalar:
        """½ k s², J; 0 while a rope is slack."""
        half, nothing = mechanism.number(0.5), mechanism.zero
        if self.law is not None:
            return nothing
        line = line_of(self, mechanism)
        if self.rest_length == ZERO:  # a rope is then never slack
            return half * mechanism.value(self.stiffness) * line.square
        # The second term is 0 unless |d| < ε; there its derivative is that of the smoothed force.
        one, stretch = mechanism.number(1.0), line.stretch
        rest = mechanism.value(self.rest_length)
        smoothing = (line.square - line.larger) * (one - rest / line.length)
        energy = half * mechanism.value(self.stiffness) * (stretch * stretch + smoothing)
        if self.tension_only:
            return mechanism.call("select", stretch, energy, nothing)
        return energy


@dataclass(frozen=True)
class Line:
    """The line between the ends of a spring; vectors in world axes, m and m/s."""

    at_1: Components
    at_2: Components
    d: Components
    d_dot: Components
    square: Scalar
    """|d|²"""
    larger: Scalar
    """max(|d|², ε²)"""
    length: Scalar
    """Square root of `larger`."""
    stretch: Scalar

    @property
    def rate(self) -> Scalar:
        """ds/dt, m/s; below ε it falls to 0 with d."""
        return dot(self.d, self.d_dot) / self.length

    def damped_velocity(self, one: Scalar) -> Components:
        """The velocity that damping opposes, m/s: (u·ḋ) u + (1 - u·u) ḋ. The last term is 0 unless
        |d| < ε.
        """
        along, across = dot(self.d, self.d_dot) / self.larger, one - self.square / self.larger
        return tuple(along * x + across * y for x, y in zip(self.d, self.d_dot, strict=True))


def line_of(spring: Spring, mechanism: Mechanism) -> Line:
    """The line of a spring at a state."""
    at_1 = tuple(mechanism.value(part) for part in spring.at_1)
    at_2 = tuple(mechanism.value(part) for part in spring.at_2)
    d = sub(mechanism.position(spring.body_2, at_2), mechanism.position(spring.body_1, at_1))
    d_dot = sub(mechanism.velocity(spring.body_2, at_2), mechanism.velocity(spring.body_1, at_1))
    d, d_dot = mechanism.called("d", *d), mechanism.called("ddot", *d_dot)
    square = dot(d, d)
    larger = mechanism.call("max", square, nearest_square(mechanism))
    (length,) = mechanism.called("l", mechanism.call("sqrt", larger))
    (stretch,) = mechanism.called("s", length - mechanism.value(spring.rest_length))
    return Line(at_1, at_2, d, d_dot, square, larger, length, stretch)


def law_slopes(
    effect: Any, mechanism: Mechanism, stretch: Scalar | None, rate: Scalar
) -> tuple[Scalar, Scalar]:
    """How fast the force of a spring grows with its stretch and its rate, at least 0, of its law if
    the `stretch` is given.
    """
    stiffness, damping = mechanism.value(effect.stiffness), mechanism.value(effect.damping)
    if stretch is not None:
        stiffness, more = (
            mechanism.value(derivative(effect.law, name), stretch=stretch, rate=rate)
            for name in ("stretch", "rate")
        )
        damping = damping + more
    return at_least_zero(mechanism, stiffness), at_least_zero(mechanism, damping)


def check_law(table: EffectTable, law: Formula | None, location: str) -> None:
    """Raise `SceneError` without stiffness, damping and law, or with both stiffness and law."""
    given = table.model_fields_set
    if law is None and not given & {"stiffness", "damping"}:
        raise SceneError(f"{location}.stiffness: missing; give it, or damping or a law")
    if law is not None and "stiffness" in given:
        raise SceneError(f"{location}.stiffness: a law replaces it; give only one of them")
