"""Inputs of a run: constants, formulas, tables in a file, functions of time."""

import csv
import math
from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from eomgen.api.given import check_name, named
from eomgen.api.reporter import SILENT, Reporter
from eomgen.base.errors import RunError, nearest
from eomgen.base.files import read_plain
from eomgen.fitting.logs import Frame
from eomgen.language.base import identifier
from eomgen.language.conditions import value_of
from eomgen.language.formula import (
    ZERO,
    Apply,
    Constant,
    Formula,
    FormulaError,
    Name,
    names_in,
    parse,
)
from eomgen.model.inputs import all_inputs, with_formulas, with_held_inputs
from eomgen.run.inputs import InputsOfTime, Table
from eomgen.run.problem import FloatArray
from eomgen.scene.schema import Scene

Given = float | str | Callable[[float], float]
"""A constant, a formula, or a function of time."""


Inputs = Mapping[str, Given] | str | PathLike[str] | Frame
"""Inputs by name, a table with a column `t`, or the path of one."""
LARGEST_TABLE = 10**8
"""Size of the largest table that is read, bytes."""
MOST_PIECES = 100
"""The most corners of a table that becomes a formula."""


def applied(
    scene: Scene, inputs: Inputs | None, reporter: Reporter = SILENT
) -> tuple[Scene, dict[str, float], InputsOfTime | None]:
    """A scene with the formulas given for some inputs in their place, the constants given for
    others, and all inputs if some of them are tables or functions.

    Raises `RunError` for an unknown name, no formula, or a file that is not a table of inputs.
    """
    argument = reporter.argument("inputs")
    constants, formulas, varying = _by_kind(scene, inputs, reporter)
    scene = with_formulas(scene, formulas, argument)
    if not varying:
        return scene, constants, None
    every: dict[str, float | Table | Callable[[float], float]] = {
        i.name: i.default for i in all_inputs(scene)
    }
    for name, value in constants.items():
        if not (isinstance(value, int | float | np.number) and math.isfinite(value)):
            raise RunError(f"{argument}: {name} is not a finite number")
    return scene, {}, InputsOfTime({**every, **constants, **varying})


def for_members(
    scene: Scene, inputs: Inputs | None, reporter: Reporter = SILENT
) -> tuple[Scene, dict[str, float], InputsOfTime | None]:
    """As `applied`, for runs in several processes and on disk, which take no functions of time.

    Raises `RunError` as `applied` does, and for a function.
    """
    scene, constants, varying = applied(scene, inputs, reporter)
    for name, given in (varying.given if varying else {}).items():
        if callable(given) and not isinstance(given, Table):
            raise _of_functions(name, reporter.argument("inputs"))
    return scene, constants, varying


def in_formulas(
    scene: Scene, inputs: Inputs | None, reporter: Reporter = SILENT
) -> tuple[Scene, dict[str, float]]:
    """A scene with the formulas and tables given for some inputs in their place, and the constants
    given for others. A table becomes a formula, so that all that takes a scene takes it.

    Raises `RunError` as `applied` does, and for a function of time or a table with too many rows.
    """
    argument = reporter.argument("inputs")
    constants, formulas, varying = _by_kind(scene, inputs, reporter)
    for name, given in varying.items():
        if not isinstance(given, Table):
            raise _of_functions(name, argument)
        if len(corners := given.corners) > MOST_PIECES:
            raise RunError(
                f"{argument}: the table of {name} has {len(corners)} corners; here it becomes a "
                f"formula, and may have {MOST_PIECES}; give fewer rows, or take simulate"
            )
        formulas[name] = piecewise(given)
    return with_formulas(scene, formulas, argument), constants


def _of_functions(name: str, argument: str) -> RunError:
    return RunError(
        f"{argument}: {name} is a function of time, which only simulate takes; give a formula of "
        "t or a table"
    )


def all_in_formulas(scene: Scene, inputs: Inputs | None, reporter: Reporter = SILENT) -> Scene:
    """The same with constants in place, too: a scene without these inputs."""
    scene, constants = in_formulas(scene, inputs, reporter)
    argument = reporter.argument("inputs")
    values = named(constants, list(constants), argument, "input")
    return with_formulas(scene, {n: Constant(x) for n, x in values.items()}, argument)


def constant_inputs(inputs: Inputs | None, reporter: Reporter = SILENT) -> dict[str, float]:
    """The constants given for inputs. Raises `RunError` for anything that changes."""
    argument = reporter.argument("inputs")
    found: dict[str, float] = {}
    for name, given in (inputs if isinstance(inputs, Mapping) else {}).items():
        formula = formula_of(name, given, argument) if isinstance(given, str) else ZERO
        if callable(given) or next(names_in(formula), None) is not None:
            raise RunError(
                f"{argument}: {name} changes, and A and B are those of one instant; linearise "
                f"takes constant inputs, {name}=1.5 for example"
            )
        found[name] = value_of(formula, {}) if isinstance(given, str) else given
    if inputs is not None and not isinstance(inputs, Mapping):
        raise RunError(
            f"{argument}: a table changes, and A and B are those of one instant; linearise takes "
            "constant inputs"
        )
    return found


def piecewise(table: Table) -> Formula:
    """A table as a formula of t: a choice by halving between the lines from corner to corner."""
    t = np.array(table.corners)
    if not t.size:
        return Constant(table(0.0))
    values = np.array([table(x) for x in t])
    slopes = np.diff(values) / np.diff(t)
    lines: list[Formula] = [Constant(float(values[0]))]
    for x, y, slope in zip(t.tolist(), values.tolist(), slopes.tolist(), strict=False):
        reach = Apply("-", (Name("t"), Constant(x)))
        lines.append(Apply("+", (Constant(y), Apply("*", (Constant(slope), reach)))))
    lines.append(Constant(float(values[-1])))

    def among(low: int, high: int) -> Formula:
        if high - low == 1:
            return lines[low]
        middle = (low + high) // 2
        after = Apply("-", (Name("t"), Constant(float(t[middle - 1]))))
        return Apply("select", (after, among(middle, high), among(low, middle)))

    return among(0, len(lines))


def _by_kind(
    scene: Scene, inputs: Inputs | None, reporter: Reporter
) -> tuple[dict[str, float], dict[str, Formula], dict[str, Table | Callable[[float], float]]]:
    """The constants, the formulas, and the tables and functions among inputs."""
    argument, known = reporter.argument("inputs"), [i.name for i in all_inputs(scene)]
    constants: dict[str, float] = {}
    formulas: dict[str, Formula] = {}
    varying: dict[str, Table | Callable[[float], float]] = {}
    if inputs is None:
        return constants, formulas, varying
    by_name: Mapping[str, Any]
    if isinstance(inputs, Mapping):
        by_name = inputs
    elif isinstance(inputs, str | PathLike):
        by_name = read_table(Path(inputs), known, reporter)
    elif hasattr(inputs, "columns"):
        by_name = table_of_frame(inputs, known, reporter)
    else:
        raise RunError(
            f"{argument}: {type(inputs).__name__} is none; give values by name, a DataFrame with a "
            "column t, or the path of a table"
        )
    driven = with_held_inputs(scene)[1]
    for name, value in by_name.items():
        name = identifier(name)
        check_name(name, known, argument, "input")
        if name in driven:
            raise RunError(
                f"{argument}: the controller '{driven[name]}' drives '{name}'; give no value to it"
            )
        if callable(value):
            varying[name] = value
        elif isinstance(value, str):
            formula = formula_of(name, value, argument)
            if next(names_in(formula), None) is None:
                constants[name] = value_of(formula, {})
            else:
                formulas[name] = formula
        else:
            constants[name] = value
    return constants, formulas, varying


def formula_of(name: str, text: str, argument: str) -> Formula:
    """The formula that a text gives for an input. Raises `RunError`."""
    try:
        return parse(text)
    except FormulaError as error:
        raise RunError(f"{argument} {name}: '{text}' {error}") from None


def read_table(path: Path, known: Sequence[str], reporter: Reporter = SILENT) -> dict[str, Table]:
    """The inputs in a file of comma-separated values: a line with t and names, then a line for each
    time, in ascending order. Between them the inputs are linear. Columns that are not among the
    `known` inputs may hold anything.

    Raises `RunError`, which names the line, for a file that is not such a table.
    """
    argument = reporter.argument("inputs")
    try:
        text = read_plain(path, LARGEST_TABLE).decode("utf-8-sig")
        rows = list(csv.reader(text.splitlines()))
    except (UnicodeDecodeError, csv.Error) as error:
        raise RunError(f"{argument}: {path}: is not a table of text: {error}") from None
    names = [word.strip() for word in rows[0]] if rows else []
    wanted = _wanted(names, known, f"{argument}: {path}:1")
    numbers = []
    for line, row in enumerate(rows[1:], 2):
        if not any(word.strip() for word in row):
            continue
        try:
            values = [float(row[i]) for i in wanted] if len(row) == len(names) else []
        except ValueError:
            values = []
        if not values or not all(map(math.isfinite, values)):
            raise RunError(
                f"{argument}: {path}:{line}: does not have {len(names)} values, with finite "
                f"numbers for {', '.join(names[i] for i in wanted)}"
            )
        numbers.append(values)
    table = np.array(numbers).reshape(-1, len(wanted)).T
    return _tables([names[i] for i in wanted], table, f"{argument}: {path}")


def table_of_frame(
    frame: Frame, known: Sequence[str], reporter: Reporter = SILENT
) -> dict[str, Table]:
    """The same of a DataFrame with a column t. Raises `RunError`."""
    place = f"{reporter.argument('inputs')}: the table"
    names = [str(name) for name in frame.columns]
    wanted = _wanted(names, known, place)
    columns = []
    for i in wanted:
        try:
            columns.append(np.asarray(frame[frame.columns[i]], dtype=float))
        except (TypeError, ValueError):
            columns.append(np.array([math.nan]))
        if columns[-1].ndim != 1 or not np.isfinite(columns[-1]).all():
            raise RunError(f"{place}: column {names[i]} does not hold finite numbers only")
    return _tables([names[i] for i in wanted], np.array(columns), place)


def _wanted(names: Sequence[str], known: Sequence[str], place: str) -> list[int]:
    """The columns that are used: t, which comes first, and the inputs.

    Raises `RunError`, which begins with `place`, if t or all inputs are missing, if one is there
    twice, or if another column is named almost like an input that is missing.
    """
    found = {name: i for i, name in enumerate(names) if name == "t" or identifier(name) in known}
    if "t" not in names or len(names) < 2:
        raise RunError(f"{place}: needs a first line with t and the names of inputs")
    missing = [name for name in known if name not in map(identifier, found)]
    for name in names:
        if name not in found and (hint := nearest(name, missing)):
            raise RunError(f"{place}: no input '{name}'{hint}")
    if len(found) < 2:
        raise RunError(
            f"{place}: none of its columns is an input; known: {', '.join(known) or 'none'}"
        )
    if any(names.count(name) > 1 for name in found):
        raise RunError(f"{place}: a name is given twice")
    return [found.pop("t"), *found.values()]


def _tables(names: Sequence[str], columns: FloatArray, place: str) -> dict[str, Table]:
    """Inputs of columns (n, rows), the first of which is t. Raises `RunError` unless it ascends."""
    t, *others = columns
    if not len(t) or np.any(np.diff(t) <= 0):
        raise RunError(f"{place}: the times t must ascend; sort them, and give each only once")
    return {name: Table(t, values) for name, values in zip(names[1:], others, strict=True)}
