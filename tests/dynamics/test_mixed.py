"""Articulated bodies on well-conditioned subtrees, orthogonal elimination along other joints."""

from dataclasses import replace

import numpy as np
import pytest
from spatial_trees import random_spatial_tree, random_state

from eomgen.base.errors import SceneError
from eomgen.codegen.choice import choose
from eomgen.codegen.derive import derive
from eomgen.dynamics.dynamics import Dynamics, Values
from eomgen.dynamics.orthogonal.elimination import Elimination
from eomgen.dynamics.orthogonal.mixed import well_conditioned
from eomgen.dynamics.tree.solids import ranked
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.program.program import cost
from eomgen.scalars.floats import FloatScalars
from eomgen.scene.reader import parse_scene

LINK = """
[[bodies]]
name = "{0}"
mass = {2}
inertia_com = [{3}, {3}, {4}]
[[joints]]
name = "to_{0}"
type = "revolute"
parent = "{1}"
child = "{0}"
axis = {5}
r_parent = [0.1, 0.05, {6}]
r_child = [0.0, 0.02, -0.2]
"""


def robot(load: float) -> Model:
    """A trunk with an arm that holds a load, kg, and three limbs, all of three links."""
    text = 'name = "robot"\ndimensions = 3\n[[effects]]\ntype = "gravity"\ng = 9.81\n'
    text += '[[bodies]]\nname = "trunk"\nmass = 4.0\ninertia_com = [0.05, 0.04, 0.03]\n'
    text += '[[joints]]\nname = "flight"\ntype = "free"\nchild = "trunk"\n'
    for limb, side in (("arm", 0.3), ("other", -0.3), ("left", 0.1), ("right", -0.1)):
        above = "trunk"
        for n, axis in enumerate(([0, 1, 0], [1, 0, 0], [0, 1, 0])):
            mass = load if (limb, n) == ("arm", 2) else 1.0
            inertia = (0.01 * mass, 0.006 * mass)
            text += LINK.format(f"{limb}_{n}", above, mass, *inertia, axis, side if n == 0 else 0.2)
            above = f"{limb}_{n}"
    return replace(elaborate(parse_scene(text)), outputs=())


def operations(model: Model, route: str) -> int:
    found = derive(model, route)
    assert found.alone is not None
    return cost(found.alone, "derivative")["total"]


@pytest.mark.every(2)
@pytest.mark.parametrize("seed", [*range(12), 47])
def test_any_split_of_a_tree_gives_the_same(seed: int) -> None:
    """Forces, torques, rotors, joints of several axes whose first ones carry no body (47)."""
    tree, text = random_spatial_tree(seed, 3 - seed % 2 if seed != 47 else 3, 6)
    model, rng = elaborate(parse_scene(text)), np.random.default_rng(seed)
    q, v = random_state(tree, rng)
    inputs = {i.name: rng.uniform(-3, 3) for i in model.inputs}
    d = Dynamics(model, Values(model.defaults, inputs, [*q], [*v]), FloatScalars(), "own")
    tau = rng.uniform(-2, 2, len(v)).tolist()
    right, response = d.articulated_forward(tau), d.articulated_response(tau)
    links = d.kinematics.links
    for share in (0.3, 0.7, 1.0):
        plain: list[int] = []
        for k in reversed(range(len(links))):
            carried = (n for n, link in enumerate(links) if link.parent == k)
            if all(n in plain for n in carried) and rng.random() < share:
                plain.append(k)
        part = Elimination(d.kinematics, d._solids, ranked(d._in_numbers), d.scalars, plain)
        found = d._with_gravity(part.respond(*d._applied_about_centres(tau)))
        np.testing.assert_allclose(found, right, rtol=1e-9, atol=1e-9 * np.abs(right).max())
        np.testing.assert_allclose(d._struck(part, tau), response, rtol=1e-9, atol=1e-9)


def test_a_heavy_load_costs_only_the_joints_that_carry_it() -> None:
    """A flying robot of 13 bodies with a load of 1e9 kg in one hand: articulated bodies lose nine
    digits, and orthogonal elimination of the whole takes 29 % more than that of the arm and trunk.
    """
    model = robot(1e9)
    choice = choose(model, closed=False)
    whole = operations(model, "orthogonal")
    assert choice.derived.route == "mixed" and choice.digits is None
    assert operations(model, "mixed") < 0.78 * whole
    assert next(c for c in choice.candidates if c.route == "aba").refused


def test_the_split_follows_the_masses() -> None:
    """Nothing is split where nothing is heavy; with a load in the hand the arm above it is, and the
    trunk.
    """
    for load, count in ((1.0, 0), (1e7, 6)):  # a free joint has four frames
        d = Dynamics(robot(load), Values({}, {}, [], []), FloatScalars(), "own")
        frames = d._in_numbers.frames
        assert len(frames) - len(well_conditioned(d._in_numbers)) == count
    assert operations(robot(1.0), "mixed") == operations(robot(1.0), "aba")


def test_it_is_for_trees() -> None:
    text = (
        'name = "bar"\nroute = "mixed"\n[[bodies]]\nname = "a"\nmass = 1\ninertia_com = 1\n'
        '[[joints]]\nname = "p"\ntype = "free"\nchild = "a"\n'
        '[[joints]]\nname = "l"\ntype = "revolute"\nparent = "world"\nchild = "a"\nloop = true\n'
    )
    with pytest.raises(SceneError, match="'mixed' is for mechanisms without loops"):
        choose(elaborate(parse_scene(text)))
