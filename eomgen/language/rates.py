"""First and second time derivatives of formulas, over any scalars, by dual numbers."""

from collections.abc import Mapping
from typing import Any

from eomgen.language.formula import Formula, evaluate
from eomgen.scalars.duals import Dual, Duals
from eomgen.scalars.protocol import Scalars


def with_rates(
    formula: Formula, names: Mapping[str, Any], time: Any, scalars: Scalars
) -> tuple[Any, Any, Any]:
    """Value, first and second time derivative of a formula of `t` and `names`, which are constant.

    For step, select, abs, min and max the derivatives are those of the branch taken.
    """
    once = Duals(scalars)
    twice = Duals(once)
    t = Dual(Dual(time, scalars.number(1.0)), once.number(1.0))
    constants = {name: twice.still(once.still(value)) for name, value in names.items()}
    found = evaluate(formula, {**constants, "t": t}, twice)
    return found.value.value, found.value.rate, found.rate.rate
