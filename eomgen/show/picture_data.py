"""A picture as data for a page, and the formulas that the page evaluates for it."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from eomgen.language.formula import Formula, evaluate, names_in
from eomgen.language.rewriting import plain_data
from eomgen.scalars.floats import FloatScalars
from eomgen.scene.effects.elements import Plane, Round, Wind, without_formula
from eomgen.show.marks import marks_of
from eomgen.show.picture import Picture
from eomgen.show.symbols import END, Symbol

Geometry = tuple[Formula, ...]
"""Formulas of parameters and the time `t`. A page evaluates them at each change of them."""


def picture_data(picture: Picture) -> tuple[dict[str, Any], Geometry]:
    """Bodies, joints, marks, symbols and the rest as tables and lists for JSON, and the geometry.

    A number is a number, or `{"of": k}`: the k-th formula of the geometry.
    """
    places: dict[Formula, int] = {}

    def place(formula: Formula) -> float | dict[str, int]:
        if next(names_in(formula), None) is None:
            return float(evaluate(formula, {}, FloatScalars()))
        return {"of": places.setdefault(formula, len(places))}

    def data(value: Any) -> Any:
        return plain_data(value, place)

    winds = tuple(e for e in picture.elements if isinstance(e, Wind))  # a page shows it by motion
    rest = tuple(e for e in picture.elements if not isinstance(e, Wind))
    symbols: dict[Symbol, int] = {}
    marks, ends = [], []
    marked = tuple(e for e in rest if not isinstance(e, Plane))  # a page has their faces
    for mark in marks_of(replace(picture, elements=marked)):
        table = {"kind": mark.frame.kind} | data(mark.frame) | {"layer": mark.layer}
        if mark.symbol is END:
            ends.append(table["at"])
        else:
            marks.append(table | {"symbol": symbols.setdefault(mark.symbol, len(symbols))})
    tables = {
        "bodies": data(picture.bodies),
        "joints": data(picture.joints),
        "marks": marks,
        "symbols": [data(symbol) for symbol in symbols],
        "ends": ends,
        "planes": [data(e) for e in rest if isinstance(e, Plane)],
        "balls": [data(e) for e in rest if isinstance(e, Round) and e.body < 0 and not e.teeth],
        "winds": [data(without_formula(e)) for e in winds],
        "traces": data(picture.traces),
        "size": picture.size,
    }
    return tables, tuple(places)


def geometry_values(geometry: Geometry, values: Mapping[str, float], t: float = 0.0) -> list[float]:
    """The values of a geometry at values of the parameters, as the page computes them."""
    names = {"t": t, **values}
    return [float(evaluate(formula, names, FloatScalars())) for formula in geometry]
