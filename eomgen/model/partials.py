"""Derivatives of formulas of the motion by coordinates, velocities and time."""

from collections.abc import Mapping
from typing import Literal

from eomgen.language.formula import Formula, evaluate, names_in
from eomgen.model.model import Model
from eomgen.scalars.duals import Dual, Duals
from eomgen.scalars.protocol import Scalar, Scalars
from eomgen.scene.constraints.base import Partials


def partials_of(
    formula: Formula,
    by: Literal["positions", "velocities"],
    model: Model,
    names: Mapping[str, Scalar],
    scalars: Scalars,
) -> Partials:
    """A formula with its derivatives, by dual numbers along one coordinate at a time."""
    duals, one, zero = Duals(scalars), scalars.number(1.0), scalars.number(0.0)
    still = {name: duals.still(x) for name, x in names.items()}
    used = set(names_in(formula))

    def slope(name: str) -> Scalar:
        along = {**still, name: Dual(names[name], one)}
        return evaluate(formula, along, duals).rate

    slopes = []
    for body in model.bodies:
        own = body.positions if by == "positions" else body.velocities
        slopes += [(body.joint.name, i, slope(c.name)) for i, c in enumerate(own) if c.name in used]
    rates = {c.name: zero for body in model.bodies for c in body.velocities}
    return Partials(
        evaluate(formula, names, scalars),
        tuple(slopes),
        slope("t") if "t" in used else zero,
        evaluate(formula, {**names, **rates}, scalars),
    )


def gradient_of(
    formula: Formula,
    names: Mapping[str, Scalar],
    given: Mapping[str, Scalar],
    scalars: Scalars,
) -> tuple[Scalar, tuple[Scalar, ...], Scalar]:
    """A formula of `names` and of what is `given`, t and parameters, with its derivatives by each
    of the names and by t.
    """
    duals, one = Duals(scalars), scalars.number(1.0)
    values, used = {**given, **names}, set(names_in(formula))
    still = {name: duals.still(values[name]) for name in used}

    def slope(name: str) -> Scalar:
        if name not in used:
            return scalars.number(0.0)
        along = {**still, name: Dual(values[name], one)}
        return evaluate(formula, along, duals).rate

    return evaluate(formula, values, scalars), tuple(map(slope, names)), slope("t")
