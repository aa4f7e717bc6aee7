"""Names of a scene: each is given once and known where it is used; bare numbers get one."""

from collections.abc import Collection, Sequence
from typing import TypeVar

from eomgen.errors import SceneError, listed, nearest
from eomgen.language.base import Table
from eomgen.language.conditions import Condition, require
from eomgen.language.quantity import Parameter, name_quantities
from eomgen.scene.joints.base import WORLD

AnyTable = TypeVar("AnyTable", bound=Table)


def check_names(tables: Sequence[tuple[str, str]]) -> None:
    """Raise `SceneError` unless names, each with its place, are given once; none is the world's."""
    seen: dict[str, str] = {}
    for name, place in tables:
        if name in seen:
            raise SceneError(
                f"{place}.name: '{name}' is the name of {seen[name]} too; give each its own"
            )
        seen[name] = place
        if name == WORLD and place.startswith("bodies"):
            raise SceneError(f"{place}.name: '{WORLD}' is the ground; choose another name")


def check_known(name: str, place: str, known: Collection[str], what: str) -> None:
    """Raise `SceneError` unless a name is one of those `known`, of a `what`."""
    if name not in known:
        hint = nearest(name, known) or f"; known: {listed(known) or 'none'}"
        raise SceneError(f"{place}: no {what} is named '{name}'{hint}")


def named(
    table: AnyTable,
    prefix: str,
    place: str,
    known: dict[str, float],
    parameters: list[Parameter],
    conditions: list[Condition],
    motion: Sequence[str],
    sliding: Collection[str] = (),
) -> AnyTable:
    """A table with its bare numbers as parameters, which are added to `parameters`; what its values
    are to keep is added to `conditions`.

    The other arguments are those of `name_quantities`. Raises `SceneError` for what that does, and
    for a value that does not keep its conditions.
    """
    fields, new, kept = name_quantities(table, prefix, place, known, motion, sliding)
    require(kept, {**known, **{p.name: p.default for p in new}})
    parameters += new
    conditions += kept
    return table.replaced(**fields)
