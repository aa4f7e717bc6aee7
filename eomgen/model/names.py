"""Name resolution: names are unique and known, and each bare number becomes a parameter."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

from eomgen.base.errors import SceneError
from eomgen.language.base import Table
from eomgen.language.conditions import Condition, require
from eomgen.language.quantity import Parameter, name_quantities
from eomgen.scene.joints.base import WORLD

AnyTable = TypeVar("AnyTable", bound=Table)


@dataclass(frozen=True)
class Scope:
    """The names that a scene's formulas may use.

    values   values of the scene's own parameters, by name
    moving   variables: t, coordinates, velocities, inputs and extra states of effects
    sliding  prismatic joints and coordinates, whose quantities have units of force and length;
             empty until the joints are known
    """

    values: Mapping[str, float]
    moving: tuple[str, ...]
    sliding: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Bindings:
    """The parameters that bare numbers in tables became, and conditions on their values."""

    parameters: tuple[Parameter, ...] = ()
    conditions: tuple[Condition, ...] = ()

    def values(self, scope: Scope) -> dict[str, float]:
        """The values of the scope's parameters and of these, by name."""
        return {**scope.values, **{p.name: p.default for p in self.parameters}}


def joined(parts: Iterable[Bindings]) -> Bindings:
    """Several bindings as one, in order."""
    every = list(parts)
    return Bindings(
        tuple(p for part in every for p in part.parameters),
        tuple(c for part in every for c in part.conditions),
    )


def bind(table: AnyTable, prefix: str, location: str, scope: Scope) -> tuple[AnyTable, Bindings]:
    """A table with each bare number replaced by a parameter, whose name starts with `prefix`; and
    its bindings.

    Raises `SceneError`, naming the `location`, for a name that is not in scope, or a value that
    does not meet its conditions.
    """
    fields, parameters, conditions = name_quantities(
        table, prefix, location, scope.values, scope.moving, scope.sliding
    )
    bindings = Bindings(tuple(parameters), tuple(conditions))
    require(conditions, bindings.values(scope))
    return table.replaced(**fields), bindings


def check_names(tables: Sequence[tuple[str, str]]) -> None:
    """Raise `SceneError` for a name given twice or a body named as the world.

    `tables` are pairs of a name and its location.
    """
    seen: dict[str, str] = {}
    for name, location in tables:
        if name in seen:
            raise SceneError(
                f"{location}.name: '{name}' is also the name of {seen[name]}; give each its own"
            )
        seen[name] = location
        if name == WORLD and location.startswith("bodies"):
            raise SceneError(f"{location}.name: '{WORLD}' is the ground; choose another name")
