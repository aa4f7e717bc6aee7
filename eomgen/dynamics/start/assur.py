"""Which coordinates of a mechanism follow from the others in closed form, and in which order.

A loop in the plane with two unknown coordinates is solved first, then those that hang on it (Assur
1914: groups of two bars). Rows of `coupling` and `distance` determine one coordinate. The branch on
which each polygon closes is that of the mechanism's start, and stays the same where the dependent
velocities follow from the others in its whole motion. Angles are counted from where they do not
jump in it.
"""

import math
import pickle
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import combinations, permutations

import numpy as np

from eomgen.base.errors import SceneError
from eomgen.dynamics.dynamics import Dynamics
from eomgen.dynamics.loops.dependent_coordinates import Turn, angle_of, solved
from eomgen.dynamics.start.constraint_equations import Array, ConstraintEquations
from eomgen.dynamics.start.walks import SAFE, reached_positions, relative_pivots, timed
from eomgen.dynamics.tree.mechanism_state import MechanismState
from eomgen.language.formula import names_in
from eomgen.model.groups import Group
from eomgen.model.model import Model
from eomgen.scalars import exact
from eomgen.scalars.protocol import Scalar
from eomgen.scene.constraints import Constraint
from eomgen.scene.constraints.base import Bar, Given, LoopPart, Pair
from eomgen.scene.joints.base import WORLD

SAME = 1e-4
"""The largest difference, in sizes, of coordinates found in closed form from those of a start."""
MOST = 60
"""Rows of constraints from which on closed forms are not tried unless a scene asks for them: to
find them takes a time that grows faster than the mechanism.
"""
MOST_SETS = 100
"""The most sets of dependent coordinates that are tried."""
FROM_JUMP = 0.1
"""How near, rad, an angle may come to where its values jump."""


def with_closed_form(model: Model) -> Model:
    """The model with its `groups` where all dependent coordinates follow in closed form.

    Raises `SceneError` if the model asks for that and they do not.
    """
    if model.loops_kept == "projected" or not model.constraints:
        return replace(model, groups=())
    if len(model.rows) > MOST and model.loops_kept == "auto":
        return replace(model, groups=())
    made, why = _found(_Alike(model))
    if why and model.loops_kept == "closed":
        raise SceneError(f"loops: 'closed' cannot be: {why}; leave it out")
    if why:
        return replace(model, groups=())
    return replace(model, groups=made.groups, pivots=made.pivots, blocks=made.blocks)


class _Alike:
    """A model without what its groups do not depend on, as the key of a cache: models themselves
    may hold mappings.
    """

    def __init__(self, model: Model) -> None:
        self.model = replace(
            model, outputs=(), notices=(), groups=(), route="auto", loops_kept="auto"
        )
        self._key = pickle.dumps(self.model)

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Alike) and self._key == other._key


@lru_cache(maxsize=16)
def _found(alike: _Alike) -> tuple[Model, str]:
    """The model with its groups, and their pivots in their order; why there are none."""
    model = alike.model
    if first := _why_not_tried(model):
        return model, first
    d, places = ConstraintEquations.of(model).dynamics(np.array(model.initial_q)), list[Array]()
    for dependent in _choices(model, d):
        groups, why = _groups(d, set(dependent))
        if not why:
            places = places or [np.array(model.initial_q), *reached_positions(model)]
            groups, why = _measured(model, groups, places)
        if not why:
            made = _with_pivots(model, groups, places)
            if made is not None:
                return made, ""
            why = "dependent coordinates do not follow from the others in every position"
        first = first or why
    return model, first


def _why_not_tried(model: Model) -> str:
    """Why a model has no groups, whatever its loops are; "" if it may have some."""
    if model.form != "velocity":
        return f"the form '{model.form}' is another state"
    if model.driven:
        return "a coordinate is driven"
    if timed(model):
        return "a constraint depends on time"
    return ""


def _choices(model: Model, d: Dynamics) -> Iterator[frozenset[int]]:
    """Sets of coordinates that may be the dependent ones: those of the assembly; the outer ones of
    each loop; and unless they are many all others, those first that leave early ones free.
    """
    of = {j: i for index in model.joint_indices for i, j in index.plain}
    columns = [column for _, column in model.pivots]
    if not all(j in of for j in columns):  # rotations in space
        return
    first = frozenset(of[j] for j in columns)
    tried = [first]
    outer = set[int]()
    seen = set[int]()
    for constraint in model.constraints:
        if (found := _loop(d, constraint.loop_part())) is not None:
            new = [i for i in found[0] if i not in seen]
            outer |= set(new[-found[1] :])
            seen |= set(found[0])
    tried.append(frozenset(outer))
    every = {of[j] for j in range(len(model.velocities)) if j in of}
    free = len(every) - len(columns)
    if math.comb(len(every), free) <= MOST_SETS:
        tried += [frozenset(every.difference(kept)) for kept in combinations(sorted(every), free)]
    for choice in dict.fromkeys(tried):
        if len(choice) == len(columns):
            yield choice


def _with_pivots(model: Model, groups: Sequence[Group], places: Sequence[Array]) -> Model | None:
    """The model with groups and pivots by which the velocities of each are solved for: of those
    that stay large and keep their signs the largest, or, if there are none, of both rows together;
    None if there are none either. The rows of a group depend on no later one.
    """
    equations, names = ConstraintEquations.of(model), [name for name, _ in model.rows]
    column = {i: j for index in model.joint_indices for i, j in index.plain}
    matrices = [equations.jacobian(q) for q in places]
    found, blocks = list[tuple[int, int]](), list[int]()
    for group in groups:
        constraint = next(c for c in model.constraints if c.name == group.constraint)
        rows = [names.index(name) for name, _ in constraint.row_names(model.dimensions)]
        columns = [column[i] for i in group.coordinates]
        best, least = None, SAFE
        for order in permutations(rows):
            for pairing in permutations(columns):
                pairs = tuple(zip(order, pairing, strict=True))
                sizes = np.array([relative_pivots(matrix, pairs) for matrix in matrices])
                same = (np.sign(sizes) == np.sign(sizes[0])).all()
                smallest = float(np.abs(sizes).min())
                if same and smallest > least:
                    best, least = pairs, smallest
        if best is None:
            parts = [matrix[np.ix_(rows, columns)] for matrix in matrices]
            sizes = np.array([_together(part) for part in parts])
            if len(rows) != 2 or np.abs(sizes).min() < SAFE or np.ptp(np.sign(sizes)):
                return None
            best = tuple(zip(rows, columns, strict=True))
            blocks.append(len(found))
        found += best
    return replace(model, groups=tuple(groups), pivots=tuple(found), blocks=tuple(blocks))


def _together(part: Array) -> float:
    """The determinant of two rows relative to the lengths of these."""
    return float(np.linalg.det(part) / (np.linalg.norm(part, axis=1).prod() or 1.0))


def completed(
    at: Callable[[Sequence[Scalar]], MechanismState], groups: Sequence[Group], q: Sequence[Scalar]
) -> list[Scalar]:
    """All coordinates (nq,) by the independent ones among `q`; `at` gives the mechanism there."""
    q = list(q)
    for group in groups:
        found = solved(at(q), group)
        for i, value, cut in zip(group.coordinates, found, group.cuts, strict=True):
            if isinstance(value, Turn):
                assert cut is not None
                value = angle_of(at(q), value, cut)
            q[i] = value
    return q


def _groups(d: Dynamics, unknown: set[int]) -> tuple[tuple[Group, ...], str]:
    """The groups that determine `unknown` coordinates, in the order in which they are solved,
    without branches; why there are none.
    """
    found: list[Group] = []
    left = list(d.model.constraints)
    if d.contacts:
        return (), "a rigid contact strikes"
    while left:
        for constraint in left:
            group = _group(d, constraint, unknown)
            if group is not None:
                break
        else:
            names = ", ".join(c.name for c in left)
            return (), f"no polygons with two unknown sides or angles: {names}"
        found.append(group)
        left.remove(constraint)
        unknown -= set(group.coordinates)
    if unknown:
        return (), "a coordinate is in no loop"
    return tuple(found), ""


def _group(d: Dynamics, constraint: Constraint, unknown: set[int]) -> Group | None:
    """The group that a constraint determines if only `unknown` coordinates are not known; None if
    it determines none.
    """
    rows = [name for name, _ in constraint.row_names(d.dimensions)]
    if any(name in d.model.dropped for name in rows):
        return None
    names = [c.name for c in d.model.coordinates]
    part = constraint.loop_part()
    if isinstance(part, Given):
        own = names.index(part.coordinate) if part.coordinate in names else -1
        used = {names.index(name) for name in names_in(part.equals) if name in names}
        if own in unknown and not used & unknown:
            return Group(constraint.name, (own,), cuts=(None,))
        return None
    loop = _loop(d, part)
    if loop is None:
        return None
    within, count, before = loop
    moving = [i for i in within if i in unknown]
    kinds = [frame.kind for frame in d.linkage.frames if {*frame.q} & {*moving}]
    slider = isinstance(part, Pair) and part.slides
    if before & unknown or len(moving) != count or (slider and "revolute" not in kinds):
        return None
    return Group(constraint.name, tuple(moving), 1, (None,) * count)


def _loop(d: Dynamics, part: LoopPart | None) -> tuple[list[int], int, set[int]] | None:
    """The coordinates in a planar loop, in the order of its frames, how many it determines, and
    those that carry it; None if it is none.
    """
    if d.dimensions == 3 or part is None or isinstance(part, Given):
        return None
    if isinstance(part, Bar):
        bodies, count = [body for body, _ in part.ends], 1
    else:
        bodies, count = [part.joint.parent, part.joint.child], 2
    first, second = (set(_path(d, body)) for body in bodies)
    of = {k: frame.q[0] for k, frame in enumerate(d.linkage.frames) if frame.q}
    within = [of[k] for k in sorted(first ^ second) if k in of]
    return within, count, {of[k] for k in first & second if k in of}


def _path(d: Dynamics, body: str) -> list[int]:
    """The frames between the world and a body."""
    return _to_world(d, -1 if body == WORLD else d.linkage.mounts[d.index[body]].frame)


def _to_world(d: Dynamics, frame: int) -> list[int]:
    found: list[int] = []
    while frame >= 0:
        found.append(frame)
        frame = d.linkage.frames[frame].parent
    return found


def _measured(
    model: Model, groups: Sequence[Group], places: Sequence[Array]
) -> tuple[tuple[Group, ...], str]:
    """The groups with branches and cuts at positions of the motion; why that cannot be."""
    equations = ConstraintEquations.of(model)
    states = [equations.dynamics(q) for q in places]
    sizes = _in_sizes(model, equations)
    found: list[Group] = []
    for n, group in enumerate(groups):
        later = {i for other in groups[n:] for i in other.coordinates}
        for branch in (1, -1):
            tried = replace(group, branch=branch)
            if made := _with_cuts(tried, states, sizes, later):
                found.append(made)
                break
        else:
            return (), f"{group.constraint} does not stay on one branch, or an angle jumps"
    return tuple(found), ""


def _in_sizes(model: Model, equations: ConstraintEquations) -> list[float]:
    """1 for an angle, the mechanism's size for a length."""
    return [equations.size if c.unit == "m" else 1.0 for c in model.coordinates]


def _with_cuts(
    group: Group, states: Sequence[Dynamics], sizes: Sequence[float], later: Collection[int]
) -> Group | None:
    """A group with the cuts of its angles; None if what is found in closed form is not the state
    everywhere, or an angle jumps.
    """
    try:
        values = [solved(d, group) for d in states]
    except (ArithmeticError, ValueError):
        return None
    cuts: list[tuple[int, int] | None] = []
    for n, i in enumerate(group.coordinates):
        first, cut = values[0][n], None
        if isinstance(first, Turn):
            cut = _cut(first.frame, states, later)
            if cut is None:
                return None
        for d, each in zip(states, values, strict=True):
            value = each[n]
            if isinstance(value, Turn):
                assert cut is not None
                value = angle_of(d, value, cut)
            if not abs(value - d.q[i]) <= SAME * sizes[i]:
                return None
        cuts.append(cut)
    return replace(group, cuts=tuple(cuts))


def _cut(frame: int, states: Sequence[Dynamics], later: Collection[int]) -> tuple[int, int] | None:
    """From which frame, and from which quarter turn there, an angle stays within half a turn; the
    world if possible, else a frame before it, else one that does not move with `later` coordinates.
    """
    frames = states[0].linkage.frames
    before = _to_world(states[0], frames[frame].parent)
    others = [
        k
        for k in range(len(frames))
        if k not in before and not any({*frames[n].q} & {*later} for n in _to_world(states[0], k))
    ]
    _, rest = exact.quarters(states[0].in_world.angles[frame].fixed)
    for reference in (-1, *before, *others):
        turns = [_angle(d, frame) - _angle(d, reference) + float(rest) for d in states]
        middle = (min(turns) + max(turns)) / 2
        quarter = round(middle / (math.pi / 2))
        reached = max(abs(turn - quarter * math.pi / 2) for turn in turns)
        if reached <= math.pi - FROM_JUMP:
            return reference, quarter
    return None


def _angle(d: Dynamics, frame: int) -> float:
    return float(d.in_world.angles[frame].moving) if frame >= 0 else 0.0
