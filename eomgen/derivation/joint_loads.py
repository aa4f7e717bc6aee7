"""Loads at joints, over SymPy expressions: springs, friction, motors, controllers without states.

Such a load is a generalised force on the coordinates of its joint, whatever formula it has. A load
that depends on the motion is one symbol to a derivation, with a definition. It is then computed
once, and no term of it is expanded.
"""

from collections.abc import Iterable
from typing import Any

import sympy as sp

from eomgen.derivation.mechanism import SymbolicMechanism
from eomgen.derivation.symbols import Expr, SympyScalars
from eomgen.model.model import Model
from eomgen.scene.effects.base import JointLoad

TIME = sp.Symbol("t", real=True)
"""The time, in loads."""


def mechanism_over(model: Model, symbols: Any, heights: Iterable[Expr] = ()) -> SymbolicMechanism:
    """A model as plain effects see it, over the symbols of either derivation."""
    c, s = (*model.coordinates, *model.velocities), symbols
    moving = zip((x.name for x in c), (*s.q, *s.v), strict=True)
    names = {TIME.name: TIME, **s.inputs, **dict(moving), **s.parameters}
    return SymbolicMechanism(model, names, SympyScalars(), s.formulas, heights)


def joint_loads(
    model: Model, symbols: Any, loads: Iterable[JointLoad]
) -> tuple[dict[int, Expr], dict[Expr, Expr]]:
    """The sums of the loads on each velocity, by its index, and definitions of symbols in them."""
    indices = {index.body.joint.name: index for index in model.joint_indices}
    sums: dict[int, Expr] = {}
    for load in loads:
        i = indices[load.joint].v[load.coordinate]
        sums[i] = sums.get(i, sp.Integer(0)) + load.force
    moving = {*symbols.q, *symbols.v, TIME}
    definitions: dict[Expr, Expr] = {}
    for i, force in sums.items():
        if not moving.isdisjoint(force.free_symbols):
            word = model.velocities[i].name.removesuffix("_dot")
            symbol = sp.Symbol(f"effort__{word}", real=True)
            definitions[symbol], sums[i] = force, symbol
    return sums, definitions
