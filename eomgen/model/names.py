"""Names of a scene: each is given once and known where it is used; bare numbers get one."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

from eomgen.errors import SceneError
from eomgen.language.base import Table
from eomgen.language.conditions import Condition, require
from eomgen.language.quantity import Parameter, name_quantities
from eomgen.scene.joints.base import WORLD

AnyTable = TypeVar("AnyTable", bound=Table)


@dataclass(frozen=True)
class Scope:
    """What the names in a scene's formulas stand for.

    values   of the scene's own parameters, by name
    moving   what changes with the motion: t, coordinates, velocities, inputs and states of effects
    sliding  joints and coordinates that slide, whose quantities have the units of that; none as
             long as there are no joints yet
    """

    values: Mapping[str, float]
    moving: tuple[str, ...]
    sliding: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Bindings:
    """What the quantities of tables bring along: parameters, of which each bare number makes one,
    and the conditions that values keep.
    """

    parameters: tuple[Parameter, ...] = ()
    conditions: tuple[Condition, ...] = ()

    def values(self, scope: Scope) -> dict[str, float]:
        """The values of all parameters that these quantities may name."""
        return {**scope.values, **{p.name: p.default for p in self.parameters}}


def joined(parts: Iterable[Bindings]) -> Bindings:
    """All of them as one, in order."""
    found = list(parts)
    return Bindings(
        tuple(p for part in found for p in part.parameters),
        tuple(c for part in found for c in part.conditions),
    )


def bind(table: AnyTable, prefix: str, location: str, scope: Scope) -> tuple[AnyTable, Bindings]:
    """A table with each bare number as a parameter, named after `prefix`, and what that brings.

    Raises `SceneError`, naming the `location`, for a name that is not in scope, and for a value
    that does not keep its conditions.
    """
    fields, parameters, conditions = name_quantities(
        table, prefix, location, scope.values, scope.moving, scope.sliding
    )
    bindings = Bindings(tuple(parameters), tuple(conditions))
    require(conditions, bindings.values(scope))
    return table.replaced(**fields), bindings


def check_names(tables: Sequence[tuple[str, str]]) -> None:
    """Raise `SceneError` unless names, each with its place, are given once; none is the world's."""
    seen: dict[str, str] = {}
    for name, location in tables:
        if name in seen:
            raise SceneError(
                f"{location}.name: '{name}' is the name of {seen[name]} too; give each its own"
            )
        seen[name] = location
        if name == WORLD and location.startswith("bodies"):
            raise SceneError(f"{location}.name: '{WORLD}' is the ground; choose another name")
