"""The interface of constraints: scalar equations of the motion, each kept by a multiplier."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Protocol, Self

from eomgen.language.formula import Formula
from eomgen.scene.effects.base import EffectTable, JointLoad, Load, Mechanism, Scalar, Vector
from eomgen.scene.effects.elements import Disc, Element, Layout


@dataclass(frozen=True)
class Row:
    """One scalar constraint g = 0, or its rate alone if it restricts velocities only.

    The constraint's force is its multiplier times `loads`, so the rate of g is the power of these
    loads plus `drift`, which is what time alone changes (virtual work).

    residual  g, m or rad; None if only its rate is constrained
    loads     the loads of a multiplier of 1
    drift     rate of g at rest, m/s or rad/s; None for 0
    margin    how far it is from having no direction, squared, at most 1; None for 1
    """

    residual: Scalar | None
    loads: tuple[Load | JointLoad, ...]
    drift: Scalar | None = None
    margin: Scalar | None = None


@dataclass(frozen=True)
class Partials:
    """A formula of the motion and its derivatives by the coordinates, or the velocities, of joints.

    slopes   joint, index of its coordinate or velocity, and the derivative
    by_time  the derivative by t alone
    at_rest  the value where all velocities are 0
    """

    value: Scalar
    slopes: tuple[tuple[str, int, Scalar], ...]
    by_time: Scalar
    at_rest: Scalar


class Linkage(Mechanism, Protocol):
    """What constraints can read of a mechanism."""

    def partials(self, formula: Formula, by: Literal["positions", "velocities"]) -> Partials:
        """A formula with its derivatives by coordinates or by velocities."""

    def gradient(
        self, formula: Formula, names: Mapping[str, Scalar]
    ) -> tuple[Scalar, Vector, Scalar]:
        """A formula of `names`, t and parameters: its value, and its derivatives by each of the
        names, in order, and by t.
        """


class Ways(Protocol):
    """What constraints can read of the tree of bodies before there is a motion."""

    def turn(self, body: str, other: str, location: str) -> Formula:
        """The angle of a body from another one, rad: the sum of the angles of the joints on the way
        between them. Raises `SceneError` for a joint with another rotation.
        """

    def parent(self, body: str) -> str:
        """The body to which the joint of a body is attached."""


@dataclass(frozen=True)
class Given:
    """A coordinate is a formula."""

    coordinate: str
    equals: Formula


@dataclass(frozen=True)
class Bar:
    """Two points of bodies keep a distance."""

    ends: tuple[tuple[str, tuple[Formula, ...]], tuple[str, tuple[Formula, ...]]]
    length: Formula


@dataclass(frozen=True)
class Pair:
    """A joint that lets its bodies turn about a point, or slide along a line."""

    joint: Any
    slides: bool


LoopPart = Given | Bar | Pair


class Constraint(Protocol):
    """What closes a loop or restricts a motion."""

    @property
    def name(self) -> str:
        """Its name in the scene."""

    def row_names(self, dimensions: int) -> Sequence[tuple[str, str]]:
        """The name and the unit of the multiplier of each of its rows."""

    def velocity_rows(self, dimensions: int) -> Sequence[str]:
        """The names of its rows that restrict velocities alone and have no residual."""

    @property
    def internal(self) -> bool:
        """Whether its forces change neither the momentum nor the moment of momentum of all."""

    def loop_part(self) -> LoopPart | None:
        """What determines the coordinates of a planar loop in closed form; None for nothing."""

    def rows(self, mechanism: Linkage) -> Iterable[Row]:
        """Its scalar constraints, over the mechanism's scalars, in the order of `row_names`."""


class ConstraintTable(EffectTable):
    """The base of the constraints that a scene lists; its names and points are read as those of
    effects.
    """

    def row_names(self, dimensions: int) -> Sequence[tuple[str, str]]:
        """The name and the unit of the multiplier of each row."""
        raise NotImplementedError

    def velocity_rows(self, dimensions: int) -> Sequence[str]:
        """The names of its rows that restrict velocities alone; of most constraints none."""
        return ()

    coordinate_fields: ClassVar[tuple[str, ...]] = ()
    """Fields that name a coordinate."""

    def __repr_args__(self) -> Iterator[tuple[str | None, Any]]:
        """Its fields, and what it took of the tree and of the start: a model's digest has these."""
        yield from super().__repr_args__()
        yield from (self.__pydantic_private__ or {}).items()

    @property
    def internal(self) -> bool:
        """Whether its forces change neither the momentum nor the moment of momentum of all."""
        return False

    def placed(self, ways: Ways, location: str) -> Self:
        """The constraint with what it needs of the tree of bodies."""
        return self

    def begun(self, mechanism: Linkage) -> Self:
        """The constraint with the lengths and angles of the start that it keeps."""
        return self

    def loop_part(self) -> LoopPart | None:
        """What determines the coordinates of a planar loop in closed form; None for nothing."""
        return None

    def elements(self, layout: Layout) -> Iterable[Element]:
        """What pictures show of it; of most constraints nothing."""
        return ()

    def discs(self, layout: Layout) -> Iterable[Disc]:
        """The discs of bodies that it turns, for pictures of bodies without shapes."""
        return ()

    def rows(self, mechanism: Linkage) -> Iterable[Row]:
        """Its scalar constraints."""
        raise NotImplementedError
