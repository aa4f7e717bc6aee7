"""Steps of 5 ms of robots on the ground, linearly implicit, beside those of MuJoCo.

    python tests/benchmarks/real_time.py HUMANOID.xml… [--lanes ANT.xml]

Of each robot, with contacts with the ground and itself: how many times faster than real time one
core makes steps in C, in which each of 5 s of its fall is looked at, and MuJoCo `mj_step` of 5 ms
with implicitfast. With `--lanes`: 4096 ants by a stepper with a policy in the loop, tanh of a
matrix times the states in NumPy; beside MuJoCo's `rollout` of such steps on one core with given
controls, which has no policy to wait for. A second of the fall onto the ground. Processor time,
least of three.
"""

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
from mujoco import rollout

import eomgen

STEP, SECONDS, LEAST, LANES = 5e-3, 5.0, 3, 4096


def least(once: Callable[[], object]) -> float:
    """Processor time of a call, s."""
    found = []
    for _ in range(LEAST):
        start = time.process_time()
        once()
        found.append(time.process_time() - start)
    return min(found)


def of_mujoco(path: Path) -> mujoco.MjModel:
    """MuJoCo's model with the same steps."""
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.timestep = STEP
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    return model


def fall(path: Path) -> str:
    """One robot's row."""
    given = eomgen.import_robot(path, contacts=True, self_contacts=True, allow=[path.parent])
    step = eomgen.stepper(given.tables, dt=STEP, method="linearly_implicit", lanes=1, backend="c")
    count, first = round(SECONDS / STEP), step.initial()

    def ours() -> None:
        y = first.copy()
        for _ in range(count):
            step(y, out=y)
        assert np.isfinite(y).all()

    model = of_mujoco(path)
    data = mujoco.MjData(model)

    def theirs() -> None:
        mujoco.mj_resetData(model, data)
        for _ in range(count):
            mujoco.mj_step(model, data)

    own, other = (SECONDS / least(call) for call in (ours, theirs))
    return f"| {path.parent.name}/{path.name} | {own:.0f} | {other:.0f} |"


def with_policy(path: Path) -> str:
    """Steps of many ants each second on one core, ours and MuJoCo's."""
    given = eomgen.import_robot(path, contacts=True, allow=[path.parent])
    step = eomgen.stepper(
        given.tables, dt=STEP, method="linearly_implicit", lanes=LANES, backend="c"
    )
    rng = np.random.default_rng(1)
    first = step.initial() + 1e-2 * rng.normal(size=(len(step.states), LANES))
    gains = 0.1 * rng.normal(size=(len(step.inputs), len(step.states)))
    count, many = 200, 16

    def ours() -> None:
        y = first.copy()
        for _ in range(count):
            step(y, np.tanh(gains @ y), out=y)
        assert np.isfinite(y).all()

    model = of_mujoco(path)
    data, kind = mujoco.MjData(model), mujoco.mjtState.mjSTATE_FULLPHYSICS
    state = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, state, kind)
    controls = rng.uniform(-0.5, 0.5, (many, count, model.nu))

    def theirs() -> None:
        rollout.rollout(model, [data], np.repeat(state[None], many, axis=0), controls)

    ahead, other = LANES * count / least(ours), many * count / least(theirs)
    return f"{path.name}: {ahead:.3g} steps a second, MuJoCo {other:.3g}: {ahead / other:.1f} times"


def main() -> None:
    """Print a table, and a line for lanes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--lanes", type=Path)
    given = parser.parse_args()
    if given.lanes:
        print(with_policy(given.lanes), flush=True)
    if given.files:
        print("| robot | ours, times real time | MuJoCo |\n|---|---|---|")
    for path in given.files:
        print(fall(path), flush=True)


if __name__ == "__main__":
    main()
