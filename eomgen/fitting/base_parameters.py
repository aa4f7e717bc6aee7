"""The base parameters of a mechanism: what forces and motions of its joints tell of its inertias.

The columns of the regressor Y of inverse dynamics are linearly dependent. A parameter whose column
is that of others, which come before it, times numbers is not told apart from these and is added to
them, as Gautier and Khalil do ("Direct calculation of minimum set of inertial parameters of serial
robots", IEEE Transactions on Robotics and Automation 6, 1990). Rows are those of random states.

Where fixed rotations are rational, as quarter turns are, all is computed in residues modulo a large
prime, and the rank is exact. Others have 60 digits, and relations that hold but for `ZERO` count.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from random import Random
from typing import Any

from eomgen.base.errors import RunError
from eomgen.dynamics.dynamics import Dynamics
from eomgen.dynamics.regressor import (
    InertialParameter,
    inertial_parameters,
    regressor,
    values_at_random,
)
from eomgen.model.model import Model
from eomgen.scalars.extended import Bits, sixty_digits
from eomgen.scalars.protocol import Scalars
from eomgen.scalars.residues import Residue, Residues

SEED = 1
MORE = 2
"""States beyond those that have as many rows as there are columns."""
ZERO = 1e-9
"""Of numbers of 60 digits what is smaller is 0: files of robots give right angles as doubles."""


@dataclass(frozen=True)
class BaseParameters:
    """The base parameters.

    every   all parameters
    groups  for each base parameter the parameter that it is named after, and what is added to it:
            parameters with their factors
    none    parameters that have no effect
    exact   whether they are known without rounding
    """

    every: tuple[InertialParameter, ...]
    groups: Mapping[InertialParameter, tuple[tuple[InertialParameter, float], ...]]
    none: tuple[InertialParameter, ...]
    exact: bool

    @property
    def rank(self) -> int:
        """Their number."""
        return len(self.groups)


def base_parameters(model: Model) -> BaseParameters:
    """The base parameters of a tree of bodies. Raises `RunError` for another mechanism."""
    if model.constraints:
        raise RunError("base parameters are those of trees; this scene has loops or constraints")
    rational = _is_rational(model)
    try:
        if rational:
            return _found(model, Residues(), exact=True)
    except ArithmeticError:  # a formula of parameters that has no residue
        pass
    with sixty_digits():
        return _found(model, Bits(), exact=False)


def _found(model: Model, scalars: Scalars, *, exact: bool) -> BaseParameters:
    numbers = _numbers(exact)
    rows: list[list[Any]] = []
    every: tuple[InertialParameter, ...] = ()
    more = MORE
    while len(rows) < len(every) or more:
        dynamics = Dynamics(model, values_at_random(model, numbers, scalars), scalars, "own")
        every = every or inertial_parameters(model, dynamics)
        more -= len(rows) >= len(every)
        vd = [scalars.number(next(numbers)) for _ in model.velocities]
        columns = regressor(dynamics, vd, every)
        rows += [list(row) for row in zip(*columns, strict=True)]
        if not rows:
            break
    pivots = _reduce(rows, len(every), exact)
    groups = {
        every[column]: tuple(
            (every[j], _number(rows[i][j]))
            for j in range(len(every))
            if j not in pivots and _size(rows[i][j], exact)
        )
        for i, column in enumerate(pivots)
    }
    added = {one for group in groups.values() for one, _ in group}
    none = tuple(one for one in every if one not in groups and one not in added)
    return BaseParameters(every, groups, none, exact)


def _numbers(exact: bool) -> Iterator[float]:
    """Random doubles: large whole numbers for residues, else numbers near 1."""
    random = Random(SEED)
    while True:
        yield float(random.randrange(1, 2**53)) if exact else random.uniform(-2.0, 2.0)


def _reduce(rows: list[list[Any]], columns: int, exact: bool) -> list[int]:
    """The reduced row echelon form, in place; returns the columns of its pivots."""
    pivots: list[int] = []
    for column in range(columns):
        done = len(pivots)
        sizes = [_size(row[column], exact) for row in rows[done:]]
        if not sizes or not max(sizes):
            continue
        best = done + max(range(len(sizes)), key=sizes.__getitem__)
        rows[done], rows[best] = rows[best], rows[done]
        own, pivot = rows[done], rows[done][column]
        own[column:] = [x / pivot for x in own[column:]]
        for i, row in enumerate(rows):
            if i != done and (factor := row[column]):
                row[column:] = [
                    x - factor * y for x, y in zip(row[column:], own[column:], strict=True)
                ]
        pivots.append(column)
    return pivots


def _size(x: Any, exact: bool) -> float:
    """How large a number is; 0 if it counts as 0."""
    if exact:
        return float(bool(x))
    size = float(abs(x))
    return size if size > ZERO else 0.0


def _number(x: Any) -> float:
    if not isinstance(x, Residue):
        return float(x)
    found = x.fraction()
    return float("nan") if found is None else float(found)


def _is_rational(model: Model) -> bool:
    """Whether fixed rotations are rational: rows of length 1, perpendicular to one another."""
    if any(getattr(body.joint, "orientation", None) is not None for body in model.bodies):
        return False
    linkage = Dynamics(
        model, values_at_random(model, _numbers(True), Residues()), Residues()
    ).linkage
    matrices = [*(frame.fixed for frame in linkage.frames), *(m.axes for m in linkage.mounts)]
    return all(_is_orthogonal(rows) for rows in matrices)


def _is_orthogonal(rows: Sequence[Sequence[Any]]) -> bool:
    exact = [[Fraction(*map(int, x.as_integer_ratio())) for x in row] for row in rows]
    return all(
        sum(x * y for x, y in zip(a, b, strict=True)) == (i == j)
        for i, a in enumerate(exact)
        for j, b in enumerate(exact)
    )
