"""Quantities: numbers of a scene that stay symbolic in the generated module.

A bare number is the default of a parameter, which is named after its location. A text is a formula
over the scene's `[parameters]`. A bare 0 is structure: it is no parameter, and is folded away.
"""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from dataclasses import field as data_field
from typing import Annotated, Any, Literal

from pydantic import Field, PlainValidator, WithJsonSchema
from pydantic_core import PydanticCustomError

from eomgen.errors import SceneError, nearest
from eomgen.language.base import Number, Table
from eomgen.language.conditions import Condition, of_moving, of_quantity
from eomgen.language.formula import (
    CONSTANTS,
    Constant,
    Formula,
    FormulaError,
    Name,
    names_in,
    parse,
)
from eomgen.scalars.functions import FUNCTIONS


def _read_quantity(value: Any) -> Formula:
    if isinstance(value, Formula):
        return value
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise PydanticCustomError("quantity", "is neither a number nor a formula; give one")
    if isinstance(value, str):
        try:
            return parse(value)
        except FormulaError as error:
            raise PydanticCustomError("quantity", "{why}", {"why": str(error)}) from None
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise PydanticCustomError("quantity", "is not a finite number; give one that is")
    return Constant(number)


Quantity = Annotated[
    Formula,
    PlainValidator(_read_quantity),
    WithJsonSchema(
        {"anyOf": [{"type": "number"}, {"type": "string"}], "description": "number or formula"}
    ),
]
Vector = Annotated[tuple[Quantity, ...], Field(min_length=2, max_length=3)]
"""Two components in the plane, three in space; see `with_components`."""
Numbers = Annotated[tuple[Number, ...], Field(min_length=2, max_length=3)]
"""The same of plain numbers, which are structure and never parameters."""
Bound = Literal["any", "positive", "nonnegative"]


def quantity(
    unit: str, about: str, bound: Bound = "any", sees: Sequence[str] = (), **options: Any
) -> Any:
    """A field for a quantity, with its unit, its description and the bound that its value keeps.

    Unit and description of a quantity at a joint may be alternatives: see `of_joint`. `sees` are
    names that its formula may use besides parameters. `motion` stands for `t` and all coordinates,
    velocities, inputs and extra states; any other name stands for itself.
    """
    extra: dict[str, Any] = {"unit": unit, "bound": bound}
    if sees:
        extra["sees"] = list(sees)
    return Field(description=about, json_schema_extra=extra, **options)


def of_joint(text: str, slides: bool) -> str:
    """One of two alternatives, "N m | N": the first for a revolute joint, the second if it
    `slides`.

    A text without " | " is the same for any joint.
    """
    turning, _, sliding = text.partition(" | ")
    return sliding if slides and sliding else turning


def of_any_joint(text: str) -> str:
    """Both alternatives of such a text, for any joint: "N m or N"."""
    return text.replace(" | ", " or ")


def about_slides(table: Table, sliding: Collection[str]) -> bool | None:
    """Whether a table's coordinate, joint, or all joints are prismatic; None if it names no
    joint.
    """
    for key in ("coordinate", "joint", "joints"):
        at = getattr(table, key, None)
        if isinstance(at, str):
            return at in sliding
        if isinstance(at, tuple):
            return all(joint in sliding for joint in at)
    return None


@dataclass(frozen=True)
class Parameter:
    """A named number of the generated module; `location` is where the scene gives it, for
    messages.
    """

    name: str
    default: float
    unit: str
    about: str
    location: str = data_field(default="", repr=False, compare=False)


def with_components(
    value: tuple[Any, ...], zero: Any, dimensions: int, location: str
) -> tuple[Any, ...]:
    """A vector of a scene, or zeros if it is left out (an empty tuple).

    Raises `SceneError` unless it has one component for each dimension.
    """
    if not value:
        return (zero,) * dimensions
    if len(value) != dimensions:
        space = "the plane" if dimensions == 2 else "space"
        raise SceneError(f"{location}: has {len(value)} components; {space} takes {dimensions}")
    return value


def name_quantities(
    table: Table,
    prefix: str,
    location: str,
    known: Mapping[str, float],
    motion: Sequence[str] = (),
    sliding: Collection[str] = (),
) -> tuple[dict[str, Any], list[Parameter], list[Condition]]:
    """Give every bare nonzero number among a table's quantities a name.

    Returns the replaced fields (for `Table.replaced`), the new parameters, and the conditions that
    values are to keep. `known` holds the values of the scene's own parameters, `motion` names what
    else a field may see. `sliding` are joints and coordinates that slide; which one a quantity is
    of says its key in a field that is a table by joints, or else the table. Raises `SceneError` for
    a name that is not there.
    """
    fields: dict[str, Any] = {}
    parameters: list[Parameter] = []
    conditions: list[Condition] = []
    for field, info in type(table).model_fields.items():
        extra, value = info.json_schema_extra, getattr(table, field)
        if isinstance(value, dict) and any(isinstance(x, Table) for x in value.values()):
            tables = {}
            for key, inner in value.items():
                at = f"{location}.{info.alias or field}.{key}"
                inside, new, kept = name_quantities(
                    inner, f"{prefix}_{key}", at, known, motion, sliding
                )
                tables[key] = inner.replaced(**inside)
                parameters += new
                conditions += kept
            fields[field] = tables
        if not isinstance(extra, dict) or "unit" not in extra:
            continue
        sees = [str(word) for word in _listed(extra.get("sees"))]
        named: list[Formula] = []
        for formula, suffix, spot, off_diagonal in _parts(value, field):
            where = f"{location}.{spot}"
            bound = "any" if off_diagonal else str(extra["bound"])
            if bound == "nonnegative" and getattr(table, "allow_active", False):
                bound = "any"
            seen = [
                *(motion if "motion" in sees else ()),
                *(word for word in sees if word != "motion"),
            ]
            keyed = isinstance(value, dict)
            here = suffix[1:] in sliding if keyed else bool(about_slides(table, sliding))
            unit = of_joint(str(extra["unit"]), here)
            for name in names_in(formula):
                if name in motion and name not in seen and name not in known:
                    raise SceneError(
                        f"{where}: '{name}' changes with the motion, which this value must not; "
                        "use parameters"
                    )
            moving = _check_names(formula, where, known, seen)
            if isinstance(formula, Constant) and formula.value != 0.0:
                what = of_joint(str(info.description), here)
                about = f"{what} of {prefix}{suffix.replace('_', ', ', 1)}"
                name = f"{prefix}_{field}{suffix}"
                parameters.append(Parameter(name, formula.value, unit, about, where))
                formula = Name(name)
            named.append(formula)
            conditions += (
                of_moving(where, formula, known)
                if moving
                else of_quantity(where, formula, bound, unit)
            )
        if isinstance(value, tuple):
            fields[field] = tuple(named)
        elif isinstance(value, dict):
            fields[field] = dict(zip(value, named, strict=True))
        elif named:
            fields[field] = named[0]
    return fields, parameters, conditions


INERTIA = ("xx", "yy", "zz", "xy", "xz", "yz")
"""The entries of a symmetric 3 x 3 matrix as scenes list them."""


def _parts(value: Any, field: str) -> Iterator[tuple[Formula, str, str, bool]]:
    """Each quantity of a field with the end of its name, its place, and if it is off a diagonal."""
    if isinstance(value, Formula):
        yield value, "", field, False
    elif isinstance(value, dict):
        for key, part in value.items():
            yield part, f"_{key}", f"{field}.{key}", False
    elif isinstance(value, tuple):
        matrix = field == "inertia_com"
        for i, part in enumerate(value):
            end = INERTIA[i] if matrix and len(value) > 1 else "xyz"[i] if not matrix else ""
            yield part, f"_{end}" if end else "", f"{field}[{i}]", matrix and i >= 3


def _listed(value: Any) -> list[Any]:
    return list(value) if isinstance(value, list | tuple) else []


def _check_names(
    formula: Formula, where: str, known: Mapping[str, float], seen: Sequence[str]
) -> bool:
    """Whether a formula changes with the motion; its names are there, or that is an error."""
    moving = False
    for name in names_in(formula):
        moving = moving or name in seen
        if name in known and name in seen:
            raise SceneError(f"{where}: '{name}' is predefined here; rename the parameter")
        if name not in known and name not in seen:
            words = [*known, *seen, *FUNCTIONS, *CONSTANTS]
            hint = nearest(name, words) or "; give it a value in [parameters]"
            if name in FUNCTIONS:
                hint = f"; the function is written {name}({', '.join('xyz'[: FUNCTIONS[name]])})"
            raise SceneError(f"{where}: unknown parameter '{name}'{hint}")
    return moving
