"""Inputs of a run: constants, formulas, tables in a file, functions of time."""

import csv
import math
from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path

import numpy as np

from eomgen.api.given import check_name
from eomgen.api.reporter import SILENT, Reporter
from eomgen.errors import RunError
from eomgen.files import read_plain
from eomgen.language.base import identifier
from eomgen.language.conditions import value_of
from eomgen.language.formula import Formula, FormulaError, names_in, parse
from eomgen.model.inputs import all_inputs, with_formulas
from eomgen.run.inputs import InputsOfTime, Table
from eomgen.scene.schema import Scene

Given = float | str | Callable[[float], float]
"""A constant, a formula, or a function of time."""
Inputs = Mapping[str, Given] | str | PathLike[str]
"""Inputs by name, or the path of a table."""
LARGEST_TABLE = 10**8
"""Size of the largest table that is read, bytes."""


def applied(
    scene: Scene, inputs: Inputs | None, reporter: Reporter = SILENT
) -> tuple[Scene, dict[str, float], InputsOfTime | None]:
    """A scene with the formulas given for some inputs in their place, the constants given for
    others, and all inputs if some of them are tables or functions.

    Raises `RunError` for an unknown name, no formula, or a file that is not a table of inputs.
    """
    argument, known = reporter.argument("inputs"), [i.name for i in all_inputs(scene)]
    if inputs is None:
        return scene, {}, None
    if not isinstance(inputs, Mapping):
        inputs = read_table(Path(inputs), reporter)
    constants: dict[str, float] = {}
    formulas: dict[str, Formula] = {}
    varying: dict[str, Table | Callable[[float], float]] = {}
    for name, value in inputs.items():
        name = identifier(name)
        check_name(name, known, argument, "input")
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


def formula_of(name: str, text: str, argument: str) -> Formula:
    """The formula that a text gives for an input. Raises `RunError`."""
    try:
        return parse(text)
    except FormulaError as error:
        raise RunError(f"{argument} {name}: '{text}' {error}") from None


def read_table(path: Path, reporter: Reporter = SILENT) -> dict[str, Table]:
    """The inputs in a file of comma-separated values: a line with t and the names of inputs, then a
    line of numbers for each time, in ascending order. Between them the inputs are linear.

    Raises `RunError`, which names the line, for a file that is not such a table.
    """
    argument = reporter.argument("inputs")
    try:
        text = read_plain(path, LARGEST_TABLE).decode("utf-8-sig")
        rows = list(csv.reader(text.splitlines()))
    except (UnicodeDecodeError, csv.Error) as error:
        raise RunError(f"{argument}: {path}: is not a table of text: {error}") from None
    names = [word.strip() for word in rows[0]] if rows else []
    if "t" not in names or len(names) < 2:
        raise RunError(f"{argument}: {path}:1: needs a first line with t and the names of inputs")
    if len(set(names)) < len(names):
        raise RunError(f"{argument}: {path}:1: a name is given twice")
    numbers = []
    for line, row in enumerate(rows[1:], 2):
        if not any(word.strip() for word in row):
            continue
        try:
            values = [float(word) for word in row]
        except ValueError:
            values = []
        if len(values) != len(names) or not all(map(math.isfinite, values)):
            raise RunError(f"{argument}: {path}:{line}: does not have {len(names)} finite numbers")
        numbers.append(values)
    table = np.array(numbers).reshape(-1, len(names))
    t = table[:, names.index("t")]
    if not len(t) or np.any(np.diff(t) <= 0):
        raise RunError(
            f"{argument}: {path}: the times t must ascend; sort them, and give each only once"
        )
    return {name: Table(t, table[:, i]) for i, name in enumerate(names) if name != "t"}
