"""Quantities: numbers of a scene that stay symbolic in the generated module.

A number is the default of a parameter that is named after its location. A text is a formula of the
scene's `[parameters]`. The number 0 is not a parameter: it is structural and is folded away.
"""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from dataclasses import field as data_field
from typing import Annotated, Any, Literal

from pydantic import Field, PlainValidator, WithJsonSchema
from pydantic_core import PydanticCustomError

from eomgen.base.errors import SceneError, nearest
from eomgen.language.angles import radians_of
from eomgen.language.base import Number, Table
from eomgen.language.conditions import Condition, of_moving, of_quantity
from eomgen.language.formula import (
    CONSTANTS,
    ZERO,
    Angle,
    Constant,
    Formula,
    FormulaError,
    Name,
    meant,
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
        if isinstance(angle := radians_of(value), float) and math.isfinite(angle):
            return Angle(angle) if angle else ZERO
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
"""A vector of plain numbers, which are structural and never parameters."""
Bound = Literal["any", "positive", "nonnegative"]


def quantity(
    unit: str, about: str, bound: Bound = "any", sees: Sequence[str] = (), **options: Any
) -> Any:
    """A field for a quantity with a unit, a description and a bound of its value.

    Unit and description of a quantity at a joint may have alternatives: see `of_joint`. `sees` are
    the names that its formula may use besides parameters; "motion" stands for `t` and all
    coordinates, velocities, inputs and extra states.
    """
    extra: dict[str, Any] = {"unit": unit, "bound": bound}
    if sees:
        extra["sees"] = list(sees)
    return Field(description=about, json_schema_extra=extra, **options)


def of_joint(text: str, slides: bool) -> str:
    """One of the alternatives in "N m | N": the second for a prismatic joint (`slides`), else the
    first. A text without " | " is for any joint.
    """
    turning, _, sliding = text.partition(" | ")
    return sliding if slides and sliding else turning


def of_any_joint(text: str) -> str:
    """Both alternatives of such a text: "N m or N"."""
    return text.replace(" | ", " or ")


def about_slides(table: Table, sliding: Collection[str]) -> bool | None:
    """Whether the coordinate, joint, or all joints that a table names are prismatic; None if it
    names none.
    """
    for key in ("coordinate", "joint", "joints"):
        named = getattr(table, key, None)
        if isinstance(named, str):
            return named in sliding
        if isinstance(named, tuple):
            return all(joint in sliding for joint in named)
    return None


@dataclass(frozen=True)
class Parameter:
    """A parameter of the generated module. `location` is that of its value in the scene, for
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
    """A vector of a scene, or zeros if it is absent (an empty tuple).

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
    """Make a parameter of each nonzero number among a table's quantities.

    prefix    start of the names of the parameters
    location  of the table in the scene
    known     values of the scene's own parameters
    motion    names that formulas of fields with `sees` "motion" may use
    sliding   prismatic joints and their coordinates, which select the alternative of units and
              descriptions. The joint of a quantity is its key in a table by joints, else that of
              the whole table

    Returns the replaced fields (for `Table.replaced`), the new parameters, and the conditions on
    the values. Raises `SceneError` for an unknown name.
    """
    fields: dict[str, Any] = {}
    parameters: list[Parameter] = []
    conditions: list[Condition] = []
    for field, info in type(table).model_fields.items():
        extra, value = info.json_schema_extra, getattr(table, field)
        inner = dict[str, Table]()
        for at, key, one in _tables_in(value):
            where = f"{location}.{info.alias or field}{at}"
            found = name_quantities(one, f"{prefix}_{key}", where, known, motion, sliding)
            inner[key] = one.replaced(**found[0])
            parameters += found[1]
            conditions += found[2]
        if inner:
            fields[field] = inner if isinstance(value, dict) else tuple(inner.values())
        if not isinstance(extra, dict) or "unit" not in extra:
            continue
        named: list[Formula] = []
        for formula, suffix, key_path, off_diagonal in _parts(value, info.alias or field):
            where = f"{location}.{key_path}"
            bound = _bound(table, str(extra["bound"]), off_diagonal)
            by_joint = isinstance(value, dict)
            slides = suffix[1:] in sliding if by_joint else bool(about_slides(table, sliding))
            unit = of_joint(str(extra["unit"]), slides)
            if isinstance(formula, Angle) and unit != "rad":
                raise SceneError(f"{where}: is an angle; give a number, in {unit or 'no unit'}")
            moving = _sees_motion(formula, where, known, motion, _listed(extra.get("sees")))
            if isinstance(formula, Constant) and formula.value != 0.0:
                what = of_joint(str(info.description), slides) + suffix.replace("_", ", ", 1)
                name = f"{prefix}_{info.alias or field}{suffix}"
                parameters.append(Parameter(name, formula.value, unit, f"{prefix}: {what}", where))
                formula = Name(name)
            named.append(formula)
            conditions += (
                of_moving(where, formula, known)
                if moving
                else of_quantity(where, formula, bound, unit)
            )
        if named or isinstance(value, tuple | dict):
            fields[field] = _like(value, named)
    return fields, parameters, conditions


def _tables_in(value: Any) -> Iterator[tuple[str, str, Table]]:
    """The tables in a table by names, or in a list, where each is, and what names it."""
    if isinstance(value, dict):
        found = [(f".{key}", key, x) for key, x in value.items()]
    else:
        listed = value if isinstance(value, tuple) else ()
        found = [(f"[{i}]", str(i + 1), x) for i, x in enumerate(listed)]
    return (entry for entry in found if isinstance(entry[2], Table))


def _like(value: Any, named: Sequence[Formula]) -> Any:
    """The formulas in the form of a field's value: a tuple, a table, or one."""
    if isinstance(value, tuple):
        return tuple(named)
    return dict(zip(value, named, strict=True)) if isinstance(value, dict) else named[0]


def _bound(table: Table, given: str, off_diagonal: bool) -> str:
    """The bound of a quantity: none off a diagonal, or where a table may drive the motion."""
    active = given == "nonnegative" and getattr(table, "allow_active", False)
    return "any" if off_diagonal or active else given


def _sees_motion(
    formula: Formula,
    where: str,
    known: Mapping[str, float],
    motion: Sequence[str],
    sees: Sequence[str],
) -> bool:
    """Whether a formula depends on more than parameters. Raises `SceneError` for a name that it may
    not use.
    """
    allowed = [
        *(motion if "motion" in sees else ()),
        *(word for word in sees if word != "motion"),
    ]
    for name in names_in(formula):
        if name in motion and name not in allowed and name not in known:
            raise SceneError(
                f"{where}: '{name}' changes with the motion, which this value must not; "
                "use parameters"
            )
    return _check_names(formula, where, known, allowed)


INERTIA = ("xx", "yy", "zz", "xy", "xz", "yz")
"""The entries of a symmetric 3 x 3 matrix as scenes list them."""


def _parts(value: Any, field: str) -> Iterator[tuple[Formula, str, str, bool]]:
    """Each quantity of a field, the suffix of its name, its location in the table, and whether it
    is an off-diagonal entry of a matrix.
    """
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
    formula: Formula, where: str, known: Mapping[str, float], allowed: Sequence[str]
) -> bool:
    """Whether a formula depends on the motion. Raises `SceneError` for an unknown name."""
    moving = False
    for name in names_in(formula):
        moving = moving or name in allowed
        if name in known and name in allowed:
            raise SceneError(f"{where}: '{name}' is predefined here; rename the parameter")
        if name not in known and name not in allowed:
            words = [*known, *allowed, *FUNCTIONS, *CONSTANTS]
            hint = meant(formula, words) or nearest(name, words)
            hint = hint or "; give it a value in [parameters]"
            if name in FUNCTIONS:
                hint = f"; the function is written {name}({', '.join('xyz'[: FUNCTIONS[name]])})"
            raise SceneError(f"{where}: unknown parameter '{name}'{hint}")
    return moving
