"""What every route says of a mechanism with loops, beside the solver in maximal coordinates."""

from collections.abc import Mapping, Sequence

import numpy as np
from engine import apart
from spatial_loops import Closed
from spatial_newton_euler import SpatialMotion, solve
from spatial_trees import PLANE

from eomgen.dynamics.dynamics import Dynamics, Values
from eomgen.dynamics.loops.constraints import loads_of
from eomgen.dynamics.reactions import reactions
from eomgen.dynamics.start.assembly import assembled
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.scalars.floats import FloatScalars
from eomgen.scene.reader import parse_scene

ROUTES = ("aba", "ldl", "independent", "orthogonal")
KEPT = {PLANE: [0, 1, 5], 3: [0, 1, 2, 3, 4, 5]}
"""Components of a wrench that the plane has, force first."""


def model_of(case: Closed) -> Model:
    """Its model, assembled."""
    return assembled(elaborate(parse_scene(case.text)))


def apart_by_route(
    case: Closed,
    model: Model,
    u: Mapping[str, float],
    motion: SpatialMotion,
    routes: Sequence[str] = ROUTES,
) -> dict[str, tuple[float, float]]:
    """For each route how far its accelerations, and the wrenches of all joints, are from those of
    the solver, relative to the greatest.
    """
    tree = case.tree
    given = dict(zip((*tree.coordinates, *tree.velocities), (*case.q, *case.v), strict=True))
    q, v = ([given[c.name] for c in part] for part in (model.coordinates, model.velocities))
    place = [tree.velocities.index(c.name) for c in model.velocities]
    found = {}
    for route in routes:
        d = Dynamics(model, Values(model.defaults, u, q, v), FloatScalars(), "own")
        vd = d.forward(route)(None)
        loads = loads_of(d, d.constrained(route).multipliers())
        wrenches = [(*f.force, *f.moment) for f in reactions(d, vd, loads)]
        kept = np.array(wrenches).reshape(-1, 6)[:, KEPT[tree.dimensions]]
        forces = motion.joint_forces[tree.rows(model.force_joints)]
        found[route] = (apart(vd, motion.accelerations[place]), apart(kept, forces))
    return found


def solved(case: Closed, seed: int, *, redundant: bool = False) -> tuple[dict, SpatialMotion]:
    """Random inputs, and what the solver says."""
    u = case.tree.random_inputs(np.random.default_rng(seed))
    return u, solve(case.tree, case.q, case.v, u, redundant=redundant)
