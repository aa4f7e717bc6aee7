"""A rope of fixed length: through points and rings, over discs, and wound on drums."""

from collections.abc import Iterator, Mapping
from typing import ClassVar, Literal, Self

from pydantic import PrivateAttr

from eomgen.base.errors import SceneError
from eomgen.language.formula import ZERO, Apply, Constant, Formula
from eomgen.language.quantity import Quantity, quantity
from eomgen.language.rewriting import difference, times
from eomgen.scene.constraints.base import ConstraintTable, Linkage, Row, Ways
from eomgen.scene.effects.elements import Disc, Element, Layout
from eomgen.scene.effects.spans import Stop, drawn, margin_of, section_of, spans_of, way_of
from eomgen.scene.effects.through import Through
from eomgen.scene.joints.base import WORLD


class Taut(ConstraintTable):
    """What is taut along its way: its rows. The lengths that a scene does not give are those of the
    start, and the angles at drums count from there.
    """

    length: Quantity | None = quantity(
        "m", "length; if absent, that of the start", "positive", default=None
    )

    _angles: Mapping[str, Formula] = PrivateAttr(default_factory=dict)
    """The angle of each body that has a disc which takes the rope along, rad."""
    _lengths: tuple[Formula, ...] = PrivateAttr(default=())
    """The length of each section, m."""
    _directions: tuple[tuple[float, ...], ...] = PrivateAttr(default=())
    """The direction of each span at the start."""

    def stops(self) -> tuple[Stop, ...]:
        """What it runs over, in order."""
        raise NotImplementedError

    @property
    def internal(self) -> bool:
        """True if it is not held by the world."""
        return all(stop.body != WORLD for stop in self.stops())

    def placed(self, ways: Ways, location: str) -> Self:
        """With the angles of its drums."""
        drums = [stop for stop in self.stops() if stop.grips]
        copy = self.replaced()
        copy._angles = {s.body: ways.turn(s.body, WORLD, location) for s in drums}
        return copy

    def begun(self, mechanism: Linkage) -> Self:
        """With the lengths and directions of the start."""
        if self._lengths:
            return self
        copy, stops = self.replaced(), self.stops()
        spans = spans_of(mechanism, stops)
        copy._directions = tuple(tuple(map(float, span.direction)) for span in spans)
        copy._lengths = (ZERO,) * len(self._sections())
        copy._lengths = tuple(Constant(-float(row.residual)) for row in copy.rows(mechanism))  # type: ignore[arg-type]
        if self.length is not None:
            whole = Constant(float(way_of(mechanism, stops, spans)))
            *_, last = copy._lengths
            last = (
                self.length if whole == last else Apply("+", (self.length, difference(last, whole)))
            )
            copy._lengths = (*copy._lengths[:-1], last)
        return copy

    def lengths(self) -> tuple[Formula, ...]:
        """That of a span of each section."""
        parts = zip(self._lengths, self._sections(), strict=False)
        return tuple(times(1 / (last - first), length) for length, (first, last) in parts)

    def elements(self, layout: Layout) -> Iterator[Element]:
        """Its way."""
        yield from drawn(self.name, self.stops(), None, layout)

    def discs(self, layout: Layout) -> Iterator[Disc]:
        """Those of bodies."""
        for stop in self.stops():
            if stop.radius is not None and stop.body != WORLD:
                yield Disc(stop.body, stop.at, stop.radius)

    def _sections(self) -> list[tuple[int, int]]:
        """The first and the last stop of each section: what takes the rope along divides it."""
        count = len(self.stops())
        cuts = [i for i, stop in enumerate(self.stops()) if stop.grips and 0 < i < count - 1]
        return list(zip((0, *cuts), (*cuts, count - 1), strict=True))

    def row_names(self, dimensions: int) -> list[tuple[str, str]]:
        """A row for each section, whose multiplier is its tension."""
        count = len(self._sections())
        if count == 1:
            return [(self.name, "N")]
        return [(f"{self.name}_{i + 1}", "N") for i in range(count)]

    def rows(self, mechanism: Linkage) -> Iterator[Row]:
        """The length of each section less what it takes on its way."""
        stops = self.stops()
        spans = spans_of(mechanism, stops)
        angles = {body: mechanism.value(angle) for body, angle in self._angles.items()}
        lengths = self._lengths or (ZERO,) * len(self._sections())
        directions = self._directions or ((1.0, 0.0),) * len(spans)
        margin = margin_of(mechanism, stops, spans, directions)
        for length, (first, last) in zip(lengths, self._sections(), strict=True):
            part = slice(first, last)
            taken, loads = section_of(
                mechanism,
                stops[first : last + 1],
                spans[part],
                angles,
                directions[part],
            )
            yield Row(mechanism.value(length) - taken, loads, margin=margin)


class Rope(Through, Taut):
    """A massless rope of fixed `length` that is taut along its way `through` points, rings and
    discs: see `points of ropes`. Its spans are straight, and discs are left along tangents, in the
    plane. A load on a rope through a ring, a block and tackle, a string that winds on a drum.

    The length is that of the spans and of the arcs on discs between the ends; if it is absent, it
    is that of the start, and so it is for a rope that ends on a drum. The rope is to touch each
    disc that it goes round, and to leave one that takes it along in a direction within half a turn
    from that at the start.

    The multiplier is the tension, N. It stays taut even if that becomes negative, as a rod would;
    a `tether` is slack then. Where a disc takes it along, each section has
    a tension of its own: rows `<name>_1`, `<name>_2`, ….
    """

    told = "A rope of fixed length is taut along its way. λ is its tension."
    example: ClassVar[str] = """
[[constraints]]
type = "rope"
name = "hoist"
through = [
    { body = "hand" },
    { body = "world", at = [0.4, 1.0] },
    { body = "world", at = [0.9, -0.5] },
]
"""
    type: Literal["rope"]

    def checked(self, dimensions: int, location: str) -> Self:
        """Check its points; one that ends on a drum has no length of its own."""
        checked = super().checked(dimensions, location)
        ends = (0, len(self.through) - 1)
        drums = [i for i in ends if self.through[i].radius is not None]
        if drums and self.length is not None:
            raise SceneError(
                f"{location}.length: a rope that ends on a drum, through[{drums[0]}], has the "
                "length of the start; leave it out"
            )
        through = [p.replaced(grips=p.grips or i in drums) for i, p in enumerate(checked.through)]
        return checked.replaced(through=tuple(through))
