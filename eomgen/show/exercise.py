"""An exercise as a page: answers are typed as formulas and checked over many random states."""

import json
from collections.abc import Iterator, Sequence
from typing import Any

import sympy as sp
from markupsafe import Markup

from eomgen.base.templating import render
from eomgen.derivation.exercise import Exercise
from eomgen.derivation.reading import read, reading_names
from eomgen.show.derivation import sections
from eomgen.show.mathml import written


def as_page(exercise: Exercise) -> str:
    """The page: what is given, questions with fields, and hints that open one after another."""
    model, names = exercise.model, reading_names(exercise.model)
    effects = exercise.exposition.effects
    given = [s for s in exercise.steps(solved=False) if s.kind != "equations"]
    asked = [
        {
            "label": Markup(f"<math>{written(read(q.left, names))}</math>"),
            "numbers": Markup(", ".join(_number(name, x, names) for name, x in q.at.items())),
        }
        for q in exercise.questions
    ]
    data = {
        "positive": sorted(model.defaults),
        "known": exercise.known,
        "questions": [
            {"program": [*_program(q.right, exercise.known)], "at": dict(q.at)}
            for q in exercise.questions
        ],
    }
    context = {
        "name": model.name,
        "title": model.title,
        "given": sections(model, given, effects),
        "hints": sections(model, exercise.hints, effects),
        "questions": asked,
        "known": _typed(exercise.known, names),
        "data": Markup(json.dumps(data, sort_keys=True).replace("<", "\\u003c")),
    }
    return render("derivation", "exercise.html.jinja", context, html=True)


def _program(e: Any, known: Sequence[str]) -> Iterator[list[Any]]:
    """A formula for the page, as operations on a stack: [0, number], [1, place of a name in
    `known`], [2, terms], [3, factors], [4] power, [5, function].
    """
    if e.is_Symbol:
        yield [1, known.index(e.name)]
    elif e.is_number and not e.args:
        yield [0, float(e)]
    else:
        for x in e.args:
            yield from _program(x, known)
        if e.is_Add or e.is_Mul:
            yield [2 if e.is_Add else 3, len(e.args)]
        else:
            yield [4] if e.is_Pow else [5, e.func.__name__]


def _number(name: str, x: float, names: dict[str, str]) -> str:
    symbol = written(read(sp.Symbol(name), names))
    return f"<math>{symbol}<mo>=</mo><mn>{x:.4g}</mn></math>"


def _typed(known: Sequence[str], names: dict[str, str]) -> list[dict[str, str]]:
    """How each symbol is typed."""
    return [
        {"name": name, "math": Markup(f"<math>{written(read(sp.Symbol(name), names))}</math>")}
        for name in known
    ]
