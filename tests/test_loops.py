"""Mechanisms with loops: every route agrees with a solver in maximal coordinates, in the plane and
in space, over all joint types; and four-bars and slider-cranks with their closed formulas.

`campaigns/loops.py` tries 300 random ones.
"""

from itertools import product

import linkages
import numpy as np
import pytest
from campaign import some
from engine import apart, engine
from loop_routes import apart_by_route, model_of, solved
from spatial_loops import Closed, random_loops
from spatial_trees import PLANE, SPACE

from eomgen.outputs import OUTPUTS

CASES = [(PLANE, 5, 0), (PLANE, 7, 1), (PLANE, 8, 3), (SPACE, 5, 1), (SPACE, 6, 2), (SPACE, 6, 3)]
"""Dimensions, most bodies, seed."""
CLOSE, WELL = 1e-10, 1e-12
CONDITION = 30.0
"""Of the rows of the loops, below which a mechanism is well-conditioned."""


def drawn(dimensions: int, most: int, seed: int) -> Closed:
    """A random mechanism with loops; the more bodies, the more loops."""
    return random_loops(seed, dimensions, most, 1 + seed % 6)


def assert_as_solved(case: Closed, seed: int) -> None:
    """Accelerations and the wrenches of all joints by every route."""
    model, (u, motion) = model_of(case), solved(case, seed)
    assert not model.notices
    bar = WELL if case.condition < CONDITION else CLOSE
    for route, off in apart_by_route(case, model, u, motion).items():
        assert max(off) < bar, route


@pytest.mark.parametrize(("dimensions", "most", "seed"), CASES)
def test_every_route_is_the_solver(dimensions: int, most: int, seed: int) -> None:
    assert_as_solved(drawn(dimensions, most, seed), seed)


LEFT = ("jacobian", *(name for name in OUTPUTS if name != "joint_forces"))


@pytest.mark.parametrize(("dimensions", "route"), [(PLANE, "independent"), (SPACE, "aba")])
def test_a_module_is_the_solver(dimensions: int, route: str) -> None:
    """As generated code: accelerations, wrenches, residuals, and projections that change nothing."""
    case = drawn(dimensions, 4, 2)
    module = engine(case.text, route, leave_out=LEFT).module
    u, motion = solved(case, 0)
    y = np.empty(len(module.STATES))
    y[case.tree.places(module.STATES)] = np.concatenate((case.q, case.v))
    expected = np.empty(len(y))
    rates = np.concatenate((motion.rates, motion.accelerations))
    expected[case.tree.places(module.STATES)] = rates
    forces = motion.joint_forces[case.tree.rows(module.JOINTS)]
    assert apart(module.derivative(0.0, y, None, u), expected) < WELL
    assert apart(module.joint_forces(0.0, y, None, u), forces) < WELL
    assert np.abs(module.constraint_residuals(0.0, y)).max() < 1e-14
    assert np.abs(module.constraint_rates(0.0, y)).max() < 1e-13
    nq = len(module.POSITIONS)
    assert apart(module.project_position(0.0, y), y[:nq]) < 1e-13
    assert apart(module.project_velocity(0.0, y), y[nq : nq + len(case.v)]) < 1e-13


REDUNDANT = {
    "four_bar_in_space": (5, 3, "loop0_z, loop0_angle_1, loop0_angle_2"),
    "bennett": (5, 3, ""),
    "bricard": (5, 1, "loop0_angle_2"),
}
"""Rows of each linkage's loop, how many of them follow from the others, and their names."""


@pytest.mark.parametrize("name", REDUNDANT)
def test_redundant_rows_are_dropped_and_named(name: str) -> None:
    """They follow from the others only where the loop is closed; the motion is the solver's."""
    case = getattr(linkages, name)()
    model, (u, motion) = model_of(case), solved(case, 0, redundant=True)
    rows, dropped, names = REDUNDANT[name]
    assert (len(model.rows), len(model.dropped)) == (rows - dropped, dropped)
    (notice,) = model.notices
    assert names in notice
    assert all(name in notice for name in model.dropped)
    assert "not unique" in notice
    for route, (accelerations, _) in apart_by_route(case, model, u, motion).items():
        assert accelerations < WELL, route


def test_the_solver_notices_faults() -> None:
    """It does not agree with a loop joint that is elsewhere by 1e-7, or oriented otherwise."""
    case = drawn(PLANE, 5, 0)
    (loop,) = case.tree.loops
    x, _, _ = loop.joint.r_child
    assert case.text.count(repr(x)) == 1
    other = case.text.replace(repr(x), repr(x + 1e-7))
    u, motion = solved(case, 0)
    model = model_of(Closed(case.tree, other, case.q, case.v, case.condition))
    found = apart_by_route(case, model, u, motion)
    assert min(max(off) for off in found.values()) > 1e-9
