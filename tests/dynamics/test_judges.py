"""The judges of spatial mechanisms agree with one another, and notice when they should not."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import judges
import numpy as np
import pytest
from campaign import some
from spatial_newton_euler import SpatialMotion, solve
from spatial_trees import PLANE, SpatialTree, TreeBody, random_spatial_tree, random_state

SEEDS = range(20)
MOST = (3, 6, 12, 30)
CLOSE = 1e-9
JUDGES = {
    "mujoco": judges.mujoco_accelerations,
    "pinocchio": judges.pinocchio_accelerations,
}


def trees() -> list[SpatialTree]:
    """Seeded trees of the plane and of space, of up to 30 bodies."""
    most = [(d, seed, MOST[seed % len(MOST)]) for d in (2, 3) for seed in SEEDS[: some(8, 20)]]
    return [random_spatial_tree(seed, dimensions, n)[0] for dimensions, seed, n in most]


def apart(a: np.ndarray, b: np.ndarray) -> float:
    """Greatest difference, relative to the greatest value or to 1."""
    return float(np.max(np.abs(a - b), initial=0.0) / (1 + np.max(np.abs(b), initial=0.0)))


@pytest.mark.every(6)
@pytest.mark.parametrize("judge", JUDGES)
@pytest.mark.parametrize("tree", trees(), ids=lambda tree: tree.name)
def test_accelerations_and_joint_forces_agree(tree: SpatialTree, judge: str) -> None:
    pytest.importorskip(judge)
    rng = np.random.default_rng(len(tree.bodies))
    kept = [0, 1, 5] if tree.dimensions == PLANE else [0, 1, 2, 3, 4, 5]
    for _ in range(3):
        (q, v), u = random_state(tree, rng), tree.random_inputs(rng)
        motion = solve(tree, q, v, u)
        assert apart(JUDGES[judge](tree, q, v, u), motion.accelerations) < CLOSE
        if judge == "mujoco":
            wrenches = judges.mujoco_wrenches(tree, q, v, u)[:, kept]
            assert apart(wrenches, motion.joint_forces) < CLOSE


@pytest.mark.every(6)
@pytest.mark.parametrize("tree", trees(), ids=lambda tree: tree.name)
def test_energy_and_momentum_change_as_power_and_wrench_say(tree: SpatialTree) -> None:
    """Central differences along the motion; poses change as the velocities say."""
    rng = np.random.default_rng(len(tree.bodies))
    (q, v), u = random_state(tree, rng), tree.random_inputs(rng)
    motion = solve(tree, q, v, u)
    plane = tree.dimensions == PLANE
    h = 1e-5

    def rate(of: Callable[[SpatialMotion], object]) -> np.ndarray:
        ends = [
            np.asarray(of(solve(tree, q + s * motion.rates, v + s * motion.accelerations, u)))
            for s in (h, -h)
        ]
        return (ends[0] - ends[1]) / (2 * h)

    energy = rate(lambda m: m.kinetic_energy + m.potential_energy)
    size = 1 + motion.kinetic_energy + abs(motion.potential_energy)
    size += np.abs(motion.accelerations).max()
    assert abs(energy - motion.external_power) < 1e-6 * size
    wrench = motion.external_wrench[[0, 1, 5]] if plane else motion.external_wrench
    assert apart(rate(lambda m: m.momentum), wrench) < 1e-6
    places = rate(lambda m: m.body_poses[:, :2] if plane else m.body_poses[:, :, 3])
    assert apart(places, motion.body_velocities[:, : tree.dimensions]) < 1e-6
    assert apart(rate(lambda m: m.body_velocities), motion.body_accelerations) < 1e-6
    assert apart(rate(lambda m: m.point_positions), motion.point_velocities) < 1e-6


def changed(tree: SpatialTree, k: int, **fields: object) -> SpatialTree:
    """The tree with other numbers for a body, or for its joint."""
    body = tree.bodies[k]
    own = {name: fields.pop(name) for name in list(fields) if hasattr(body, name)}
    bodies = list(tree.bodies)
    bodies[k] = replace(body, joint=replace(body.joint, **fields), **own)
    return replace(tree, bodies=tuple(bodies))


def faults(tree: SpatialTree) -> Iterator[tuple[str, SpatialTree]]:
    """The tree with one small mistake at a time, wherever it matters."""

    def turning(body: TreeBody) -> bool:
        return any(body.inertia) and body.joint.kind in ("ball", "universal", "free")

    for k, body in enumerate(tree.bodies):
        joint = body.joint
        x, y, z = joint.r_child
        if turning(body):
            xx, yy, zz, xy, xz, yz = body.inertia
            yield "inertia", changed(tree, k, inertia=(xx * (1 + 1e-5), yy, zz, xy, xz, yz))
        if turning(body) and xy:
            yield "product of inertia", changed(tree, k, inertia=(xx, yy, zz, -xy, xz, yz))
        if body.mass and joint.r_child != (0.0, 0.0, 0.0):
            yield "r_child", changed(tree, k, r_child=(-x, -y, -z))
        if joint.kind == "universal":
            yield "axes", changed(tree, k, axes=joint.axes[::-1])
        about_x, about_y, about_z = joint.orientation_deg
        if about_x and about_y:
            yield "orientation", changed(tree, k, orientation_deg=(about_y, about_x, about_z))
        if joint.armature:
            yield "armature", changed(tree, k, armature=joint.armature * (1 + 1e-4))
    for name, body, _ in tree.pushes:
        yield "push", replace(tree, pushes=((name, body, (0.123, -0.2, 0.1)),))
    yield "gravity", replace(tree, gravity=tree.gravity + 1e-5)


@pytest.mark.every(2)
@pytest.mark.parametrize("judge", ["newton_euler", *JUDGES])
def test_each_judge_notices_a_small_mistake(judge: str) -> None:
    """A mistake is in the tree that one judge reads; `solve` reads the right one."""
    if judge in JUDGES:
        pytest.importorskip(judge)
    accelerations = JUDGES.get(judge, lambda *state: solve(*state).accelerations)
    found: dict[str, list[float]] = {}
    for seed in SEEDS:
        tree = random_spatial_tree(seed, 3, 6)[0]
        rng = np.random.default_rng(seed)
        (q, v), u = random_state(tree, rng), tree.random_inputs(rng)
        right = solve(tree, q, v, u).accelerations
        for name, wrong in faults(tree):
            found.setdefault(name, []).append(apart(accelerations(wrong, q, v, u), right))
    assert len(found) == 8, f"some faults were never tried: {sorted(found)}"
    assert {name: max(sizes) for name, sizes in found.items() if max(sizes) < 100 * CLOSE} == {}
