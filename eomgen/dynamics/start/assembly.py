"""Assembly: an initial state that meets the constraints, and which rows follow from others.

Coordinates that the scene gives are kept and the others found; if it gives all, which may be
rounded, all are changed a little where they do not fit. Newton's method with least-squares steps
starts from the scene's values and then from seeded states around them; of the positions found the
one nearest to the scene's is taken. Rows that depend on others are found where the constraints are
met, at several positions along the motion: a linkage such as Bennett's moves only because its rows
depend on each other there.
"""

import random
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from eomgen.base.errors import SceneError
from eomgen.dynamics.loops import constraints
from eomgen.dynamics.loops.clusters import jacobian_of
from eomgen.dynamics.start.constraint_equations import (
    CLOSED,
    INDEPENDENT,
    Array,
    ConstraintEquations,
    least,
    newton,
    settled,
)
from eomgen.dynamics.start.walks import timed
from eomgen.model.model import Model
from eomgen.scene.constraints import Constraint, ConstraintTable
from eomgen.scene.joints.base import Coordinate

STARTS = (0.0, *(0.1,) * 6, *(0.5,) * 10, *(2.0,) * 30)
"""How far the starts are from the scene's values, rad, or in sizes."""
ENOUGH = 6
"""So many positions found suffice to take the nearest."""
ALONG = (0.05, -0.05, 0.1, 0.1, 0.2, 0.3)
"""Positions along the motion at which rows are compared, rad, or in sizes."""
SOON = (1e-3, 1e-2, 0.1)
"""Times at which loops that hold everything are to follow their drives, s."""
LEAST_PIVOT = 1e-3
"""A coordinate that the scene gives is solved for where other pivots would be smaller than this."""
MOVED = 1e-9
"""A change of a given value that is not reported."""
ROUNDED = 1e-5
"""A change of a value, relative to it or to its size, that is one of rounding to six digits."""


def assembled(model: Model) -> Model:
    """The model with an initial state that meets its constraints, without rows that follow from
    others, and with a notice of what was changed.

    Raises `SceneError`, naming the loop and by how much it stays open, if the constraints cannot be
    met, or if they leave no freedom.
    """
    if not model.constraints:
        return model
    model = _begun(model)
    mechanism = ConstraintEquations.of(model)
    _check_linear(mechanism, np.array(model.initial_q))
    q, notices = _position(mechanism)
    dropped = _dependent(mechanism, q)
    if dropped and _is_moved(model):
        _check_followed(mechanism, q, dropped)
    model = replace(model, initial_q=tuple(q.tolist()), dropped=dropped)
    if not model.rows:
        raise SceneError(
            f"joints: {', '.join(c.name for c in model.constraints)} "
            f"restrict{'s' * (len(model.constraints) == 1)} nothing that the other joints do not "
            "restrict already; leave it out"
        )
    if len(model.rows) >= len(model.velocities) and not _is_moved(model):
        raise SceneError(
            f"joints: the loops hold everything: {len(model.rows)} independent constraints on "
            f"{len(model.velocities)} velocities; leave one out"
        )
    if dropped:
        follow = "follows from the others and is" if len(dropped) == 1 else ""
        notices.append(
            f"constraints: {', '.join(dropped)} {follow or 'follow from the others and are'} left "
            "out; the forces of these loops are then not unique"
        )
    mechanism = replace(mechanism, model=model)
    v, more = _speeds(mechanism, q)
    pivots = _pivots(mechanism.jacobian(q), _free(model))
    return replace(model, initial_v=v, pivots=pivots, notices=(*model.notices, *notices, *more))


def _begun(model: Model) -> Model:
    """The model with constraints that know what of its start they keep.

    Raises `SceneError` if one has no value there.
    """
    d = ConstraintEquations.of(model).dynamics(np.array(model.initial_q))
    found = list[Constraint]()
    for constraint in model.constraints:
        try:
            if isinstance(constraint, ConstraintTable):
                constraint = constraint.begun(d)
            list(constraint.rows(d))
        except (ArithmeticError, ValueError):
            raise SceneError(
                f"initial.q: constraint '{constraint.name}' has no direction at this start, as "
                "where a disc lies flat, or a rope has no way; give another, or initial.guess"
            ) from None
        found.append(constraint)
    return replace(model, constraints=tuple(found))


def _check_linear(mechanism: ConstraintEquations, q: Array) -> None:
    """Raise `SceneError` for a row that is not linear in the velocities."""
    rng, model = random.Random(5), mechanism.model
    slopes = []
    for _ in range(2):
        d = mechanism.dynamics(q, [rng.uniform(0.5, 2.0) for _ in model.velocities])
        slopes.append(jacobian_of(d))
    for (name, _), row, other in zip(model.rows, *slopes, strict=True):
        if not np.allclose(row, other, rtol=1e-9, atol=0.0, equal_nan=True):
            raise SceneError(f"constraints: {name} is not linear in the velocities; write it so")


def closed_start(
    model: Model,
    q: Sequence[float],
    v: Sequence[float],
    given: Collection[str] = (),
    argument: str = "initial",
) -> tuple[tuple[float, ...], tuple[float, ...], tuple[str, ...]]:
    """The start q, v of an assembled model at its parameters, as near as it can be, and notices.

    Coordinates and velocities that are `given` are kept; if all are, they are moved by no more
    than rounding. Without given coordinates those that the scene gives are kept, or all of them
    moved with a notice, and without given velocities likewise. Raises `SceneError`, which calls
    what is given `argument`, if that cannot be.
    """
    positions, velocities = (
        [c.name for c in each] for each in (model.coordinates, model.velocities)
    )
    held = [
        name
        for names in (positions, velocities)
        for name in names
        if name in (given if set(given) & set(names) else model.held)
    ]
    model = replace(model, initial_q=tuple(q), initial_v=tuple(v), held=tuple(held))
    mechanism = ConstraintEquations.of(model)
    if mechanism.met(np.array(q), v):
        return model.initial_q, model.initial_v, ()
    in_q, in_v = (
        argument if set(given) & set(names) else f"initial.{letter}"
        for letter, names in (("q", positions), ("v", velocities))
    )
    found, notices = _position(mechanism, in_q)
    _check_kept(mechanism, model.coordinates, (q, found.tolist()), given, in_q)
    speeds, more = _speeds(mechanism, found, in_v)
    _check_kept(mechanism, model.velocities, (v, speeds), given, in_v)
    return tuple(found.tolist()), speeds, (*notices, *more)


def _check_kept(
    mechanism: ConstraintEquations,
    columns: Sequence[Coordinate],
    values: tuple[Sequence[float], Sequence[float]],
    given: Collection[str],
    argument: str,
) -> None:
    """Raise `SceneError` if of coordinates or velocities, before and after they meet the
    constraints, those `given` differ by more than rounding. They may if all are given.
    """
    changes = {
        c: abs(after - before) / max(mechanism.size_of(c), abs(before))
        for c, before, after in zip(columns, *values, strict=True)
        if c.name in given
    }
    if max(changes.values(), default=0.0) <= ROUNDED:
        return
    worst = max(changes, key=changes.__getitem__)
    before, after = (dict(zip(columns, each, strict=True))[worst] for each in values)
    raise SceneError(
        f"{argument}: {', '.join(c.name for c in changes)} do not meet the constraints together: "
        f"{worst.name} would be moved by {abs(after - before):.2g} {worst.unit}; give fewer of them"
    )


@np.errstate(over="ignore", invalid="ignore")  # residuals may be of any size
def _position(
    mechanism: ConstraintEquations, argument: str = "initial.q"
) -> tuple[Array, list[str]]:
    """The closed position nearest to a model's initial one, with notices; what it holds is kept,
    unless it holds all. Raises `SceneError`, which begins with `argument`, if there is none.
    """
    model = mechanism.model
    start, free = np.array(model.initial_q), _free(model)
    q = _closed(mechanism, start, free)
    if q is None and not free.any():  # they may be rounded
        q = _closed(mechanism, start, ~free)
        if q is not None:
            return q, _changes(model, start, q)
    if q is None:
        raise SceneError(f"{argument}: {_open(mechanism, start, free)}")
    return q, []


def _free(model: Model) -> NDArray[np.bool_]:
    """Which velocities' coordinates may change in assembly: those that the scene does not give."""
    held = set(model.held)
    found = np.ones(len(model.velocities), dtype=bool)
    for index in model.joint_indices:
        names = [c.name for c in index.body.positions]
        for i, j in index.plain:
            if j < len(found) and names[index.q.index(i)] in held:
                found[j] = False
        if held & set(names[index.body.plain :]):
            found[list(index.spin)] = False
    return found


def _closed(mechanism: ConstraintEquations, start: Array, free: NDArray[np.bool_]) -> Array | None:
    """The closed position nearest to a start; None if none is found."""
    if not free.any():
        return start if np.abs(mechanism.residuals(start)).max() <= CLOSED else None
    rng, found = random.Random(11), list[Array]()
    for spread in STARTS:
        step = np.array([rng.uniform(-spread, spread) if may else 0.0 for may in free])
        q = newton(mechanism, mechanism.moved(start, step), free)
        if q is not None and mechanism.upright(q):
            found.append(q)
            if spread == 0.0 or len(found) >= ENOUGH:
                break
    if not found:
        return None
    return settled(mechanism, min(found, key=lambda q: float(np.abs(q - start).max())), free)


def _open(mechanism: ConstraintEquations, start: Array, free: NDArray[np.bool_]) -> str:
    """What cannot close, and by how much at least."""
    q, g = start, mechanism.residuals(start)
    if not np.isfinite(g).all():
        name, _ = mechanism.model.rows[int(np.argmin(np.isfinite(g)))]
        return f"a formula of the constraints, of {name} perhaps, has no value there; give another"
    for _ in range(200):
        matrix = np.where(free, mechanism.holding(q), 0.0)
        step = -matrix.T @ np.linalg.solve(matrix @ matrix.T + 1e-3 * np.eye(len(g)), g)
        there = mechanism.moved(q, step * min(1.0, 0.3 / max(float(np.abs(step).max()), 1e-300)))
        after = mechanism.residuals(there)
        if not float(after @ after) < float(g @ g):
            break
        q, g = there, after
    model = mechanism.model
    worst = int(np.abs(g).argmax())
    name, unit = model.rows[worst]
    gap = abs(float(g[worst])) * (mechanism.size if unit == "N" else 1.0)
    held = ", ".join(c.name for c in model.coordinates if c.name in model.held)
    given = f" with {held} as given" if held else ""
    remedy = f"change lengths, or {'give fewer coordinates' if held else 'change the start'}"
    nc, nv = len(model.rows), len(model.velocities)
    if nc >= nv and not _is_moved(model):
        remedy = f"{nc} constraints on {nv} velocities leave nothing that could move: leave one out"
    return (
        f"the constraints cannot be met{given}: {name} stays open by "
        f"{gap:.3g} {'m' if unit == 'N' else 'rad'}; {remedy}"
    )


def _changes(model: Model, start: Array, q: Array) -> list[str]:
    """A notice of the greatest change of a given coordinate."""
    k = int(np.abs(q - start).argmax())
    change = abs(float(q[k] - start[k]))
    if change <= MOVED:
        return []
    c = model.coordinates[k]
    return [
        f"initial.q: moved to meet the constraints, by at most {change:.2g} {c.unit} "
        f"({c.name}): give fewer coordinates to keep these"
    ]


def _dependent(mechanism: ConstraintEquations, q: Array) -> tuple[str, ...]:
    """The names of rows that follow from those before them wherever the constraints are met."""
    if _independent(mechanism.jacobian(q)):
        return ()
    places, rng = [q], random.Random(13)
    for step in ALONG:
        matrix = mechanism.jacobian(q)
        free = np.linalg.svd(matrix)[2][np.linalg.matrix_rank(matrix, tol=INDEPENDENT) :]
        direction = sum((rng.uniform(-1.0, 1.0) * x for x in free), np.zeros(matrix.shape[1]))
        there = newton(
            mechanism, mechanism.moved(q, step * direction), np.ones(len(direction), dtype=bool)
        )
        if there is not None:
            places.append(there)
    matrices = [mechanism.jacobian(place) for place in places]
    if any(map(_independent, matrices)):
        return ()
    kept: list[int] = []
    for i in range(len(mechanism.model.rows)):
        if any(_adds(matrix, kept, i) for matrix in matrices):
            kept.append(i)
    return tuple(name for i, (name, _) in enumerate(mechanism.model.rows) if i not in kept)


def _is_moved(model: Model) -> bool:
    """Whether a drive, or a constraint with the time in it, moves what has no freedom."""
    return bool(model.driven) or timed(model)


def _check_followed(mechanism: ConstraintEquations, q: Array, dropped: tuple[str, ...]) -> None:
    """Raise `SceneError` if rows that follow from the others at rest do not while drives move."""
    names = [name for name, _ in mechanism.model.rows]
    moving = [c.position.name for c in mechanism.model.driven]
    kept = replace(mechanism, model=replace(mechanism.model, dropped=dropped))
    for time in SOON:
        found = newton(replace(kept, time=time), q, np.ones(len(mechanism.lengths), dtype=bool))
        if found is None:
            return  # a run that gets there says so
        left = np.abs(replace(mechanism, time=time).residuals(found))
        if left.max() > MOVED:
            raise SceneError(
                f"joints: {names[int(left.argmax())]} cannot be met while "
                f"{', '.join(moving) or 'time'} moves on: the loops hold everything; leave one out"
            )
        q = found


def _independent(matrix: Array) -> bool:
    """Whether no row of a matrix follows from the others."""
    lengths = np.linalg.norm(matrix, axis=1)
    if not lengths.min(initial=1.0) > INDEPENDENT:
        return False
    least = np.linalg.svd(matrix / lengths[:, np.newaxis], compute_uv=False)[-1]
    return len(matrix) <= matrix.shape[1] and bool(least > INDEPENDENT)


def _adds(matrix: Array, kept: Sequence[int], i: int) -> bool:
    """Whether a row is independent of those kept."""
    row = matrix[i]
    if not kept:
        return bool(np.linalg.norm(row) > INDEPENDENT)
    basis = matrix[list(kept)]
    rest = row - np.linalg.lstsq(basis.T, row, rcond=INDEPENDENT)[0] @ basis
    return bool(np.linalg.norm(rest) > INDEPENDENT * max(float(np.linalg.norm(row)), 1e-3))


def _pivots(matrix: Array, free: NDArray[np.bool_]) -> tuple[tuple[int, int], ...]:
    """Rows and columns in the order of elimination. Of the entries that are not small, in columns
    of `free` velocities if there are such, the one is taken whose row has the fewest others, and
    of these the one whose column has.
    """
    work, found = matrix.copy(), list[tuple[int, int]]()
    rows, columns = list(range(len(matrix))), list(range(matrix.shape[1]))
    while rows:
        there = np.abs(work[np.ix_(rows, columns)])
        for allowed in (np.array([free[j] for j in columns]), np.ones(len(columns), dtype=bool)):
            entries = np.where(allowed, there, 0.0)
            if entries.max() > LEAST_PIVOT * there.max():
                break
        large = entries >= 0.1 * entries.max()
        others, below = ((there > INDEPENDENT).sum(axis=axis) for axis in (1, 0))
        a, b = min(
            zip(*np.nonzero(large), strict=True),
            key=lambda at: (others[at[0]], below[at[1]], *at),
        )
        i, j = rows.pop(int(a)), columns.pop(int(b))
        found.append((i, j))
        for k in rows:
            work[k] -= work[k, j] / work[i, j] * work[i]
    return tuple(found)


def _speeds(
    mechanism: ConstraintEquations, q: Array, argument: str = "initial.v"
) -> tuple[tuple[float, ...], list[str]]:
    """Velocities that meet the constraints: those given are kept, the others found, the least.

    Raises `SceneError`, which begins with `argument`, if those given contradict them.
    """
    model = mechanism.model
    given = np.array(model.initial_v)
    held = np.array([c.name in set(model.held) for c in model.velocities])
    d = mechanism.dynamics(q, given.tolist())
    rate = np.array(constraints.rates(d))
    matrix = mechanism.jacobian(q) / mechanism.lengths
    rate = rate / np.array([mechanism.size if unit == "N" else 1.0 for _, unit in model.rows])
    for free in (~held, np.ones(len(held), dtype=bool)):
        change = -least(np.where(free, matrix, 0.0), rate)
        left = float(np.abs(matrix @ change + rate).max())
        if left <= 1e-9 * max(1.0, float(np.abs(rate).max())):
            moved = float(np.abs(change[held]).max(initial=0.0))
            if free.all() and held.any() and not held.all() and moved > MOVED:
                break
            notices = []
            if moved > MOVED:
                k = int((np.abs(change) * held).argmax())
                c = model.velocities[k]
                notices = [
                    f"initial.v: changed to meet the constraints, by at most {moved:.2g} {c.unit} "
                    f"({c.name})"
                ]
            return tuple((given + change).tolist()), notices
    raise SceneError(
        f"{argument}: the velocities given contradict the constraints; give fewer of them"
    )
