"""Quantities in what is drawn: evaluation, and replacement by places in a list of formulas."""

from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

from eomgen.language.base import Table
from eomgen.language.conditions import value_of
from eomgen.language.formula import ZERO, Apply, Constant, Formula, Name

Value = TypeVar("Value")


def changed(value: Value, change: Callable[[Formula], Any]) -> Value:
    """A table, a dataclass or a tuple of these with each formula in it replaced by `change`."""
    found: Any = value
    if isinstance(value, Constant | Name | Apply):
        found = change(value)
    elif isinstance(value, tuple):
        found = tuple(changed(part, change) for part in value)
    elif isinstance(value, Table):
        found = value.replaced(
            **{name: changed(getattr(value, name), change) for name in type(value).model_fields}
        )
    elif is_dataclass(value) and not isinstance(value, type):
        parts = {f.name: changed(getattr(value, f.name), change) for f in fields(value)}
        found = replace(value, **parts)
    return found  # type: ignore[no-any-return]


def valued(value: Value, known: Mapping[str, float]) -> Value:
    """The same with each formula replaced by its value for these names; nan if it is undefined."""
    return changed(value, lambda formula: Constant(value_of(formula, known)))


def plain_data(value: Any, change: Callable[[Formula], Any]) -> Any:
    """The same as tables, lists, numbers and text for JSON, each formula as `change` gives it."""
    if isinstance(value, Constant | Name | Apply):
        return change(value)
    if isinstance(value, tuple):
        return [plain_data(part, change) for part in value]
    names: list[str] = []
    if isinstance(value, Table):
        names = list(type(value).model_fields)
    elif is_dataclass(value):
        names = [f.name for f in fields(value)]
    if names:
        return {name: plain_data(getattr(value, name), change) for name in names}
    return value


def with_names(formula: Formula, names: Mapping[str, Formula]) -> Formula:
    """A formula with formulas in place of some names."""
    match formula:
        case Name(name):
            return names.get(name, formula)
        case Apply(operation, operands):
            return Apply(operation, tuple(with_names(part, names) for part in operands))
    return formula


def times(factor: float, formula: Formula) -> Formula:
    """A multiple of a formula."""
    if isinstance(formula, Constant):
        return Constant(factor * formula.value)
    if factor in (1.0, -1.0):
        return formula if factor == 1.0 else Apply("neg", (formula,))
    return Apply("*", (Constant(factor), formula))


def scaled(factor: float, vector: tuple[Formula, ...]) -> tuple[Formula, ...]:
    """A multiple of a vector."""
    return tuple(times(factor, part) for part in vector)


def total(a: Formula, b: Formula) -> Formula:
    """The sum of two formulas, without terms that are 0."""
    if isinstance(a, Constant) and isinstance(b, Constant):
        return Constant(a.value + b.value)
    for one, other in ((a, b), (b, a)):
        if isinstance(one, Constant) and one.value == 0.0:
            return other
    return Apply("+", (a, b))


def sum_of(a: tuple[Formula, ...], b: tuple[Formula, ...]) -> tuple[Formula, ...]:
    """The sum of two vectors."""
    return tuple(total(x, y) for x, y in zip(a, b, strict=True))


def constant(*values: float) -> tuple[Formula, ...]:
    """A vector of numbers."""
    return tuple(Constant(float(value)) for value in values)


def difference(a: Formula, b: Formula) -> Formula:
    """a - b, without terms that are 0."""
    if isinstance(a, Constant) and isinstance(b, Constant):
        return Constant(a.value - b.value)
    if b == ZERO:
        return a
    if a == b:
        return ZERO
    return Apply("neg", (b,)) if a == ZERO else Apply("-", (a, b))
