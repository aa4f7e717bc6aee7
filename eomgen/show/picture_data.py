"""A picture as data for a page, and the formulas that the page evaluates for it."""

from collections.abc import Mapping
from typing import Any

from eomgen.language.formula import Formula, evaluate, names_in
from eomgen.language.rewriting import plain_data
from eomgen.scalars.floats import FloatScalars
from eomgen.scene.effects.elements import Element, Link, Round, without_formula
from eomgen.show.picture import Picture

Geometry = tuple[Formula, ...]
"""Formulas of parameters and the time `t`. A page evaluates them at each change of them."""


def picture_data(picture: Picture) -> tuple[dict[str, Any], Geometry]:
    """Bodies, joints, elements, traces and size as tables and lists for JSON, and its geometry.

    A number is a number, or `{"of": k}`: the k-th formula of the geometry.
    """
    places: dict[Formula, int] = {}

    def place(formula: Formula) -> float | dict[str, int]:
        if next(names_in(formula), None) is None:
            return float(evaluate(formula, {}, FloatScalars()))
        return {"of": places.setdefault(formula, len(places))}

    def data(value: Any) -> Any:
        return plain_data(value, place)

    tables = {
        "bodies": data(picture.bodies),
        "joints": data(picture.joints),
        "elements": [_element(e, data(without_formula(e))) for e in picture.elements],
        "traces": data(picture.traces),
        "size": picture.size,
    }
    return tables, tuple(places)


def _element(element: Element, table: dict[str, Any]) -> dict[str, Any]:
    """An element's table with its kind, and with the keys that the page knows."""
    table = {"kind": element.kind} | table
    if isinstance(element, Link):
        table["from"], table["to"] = table.pop("start"), table.pop("end")
    table.pop("formula", None)
    if isinstance(element, Round) and element.axis == ():
        table["axis"] = None
    return table


def geometry_values(geometry: Geometry, values: Mapping[str, float], t: float = 0.0) -> list[float]:
    """The values of a geometry at values of the parameters, as the page computes them."""
    names = {"t": t, **values}
    return [float(evaluate(formula, names, FloatScalars())) for formula in geometry]
