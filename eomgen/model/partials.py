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
