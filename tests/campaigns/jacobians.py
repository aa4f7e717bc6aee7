"""Rounding errors of generated Jacobians: doubles against the same program in 60 digits.

    python tests/campaigns/jacobians.py [SCENE …]

At states at rest, in motion and at random; of those that are computed along directions, three
columns. Shown are the largest error relative to the largest entry, and the operations.
"""

import sys
from dataclasses import replace
from typing import Any

import numpy as np

from eomgen.dynamics.start.assembly import assembled
from eomgen.model.elaborate import elaborate
from eomgen.pipeline import compile_program, python_module
from eomgen.program.extended import evaluator
from eomgen.program.program import cost
from eomgen.program.tape import TIME
from eomgen.run.module import load_module
from eomgen.scene.reader import built_in_names, read_scene
from eomgen.study.verification.hard_states import hard_states

KINDS = ("zero", "still", "fast", "random")


def worst(scene: str) -> tuple[float, str, int]:
    """The largest error of a Jacobian, the route and way it is computed by, and its cost."""
    model = replace(assembled(elaborate(read_scene(scene))), outputs=(), form="velocity")
    system = compile_program(model).system
    module: Any = load_module(python_module(system), scene)
    exact, names = evaluator(system.program, "jacobian"), module.STATES
    directions, found = system.extra.get("jacobian", ()), 0.0
    for state in hard_states(module, len(model.velocities), 2, 0, 1.0):
        if state.kind not in KINDS:
            continue
        given = {**dict(zip(names, state.y.tolist(), strict=True)), **model.defaults}
        given |= {i.name: state.u.get(i.name, 0.0) for i in model.inputs} | {TIME: state.t}
        try:
            matrix = np.asarray(module.jacobian(state.t, state.y, None, state.u or None))
        except (ArithmeticError, ValueError):  # a closed loop that does not close there
            continue
        if directions:
            columns = np.random.default_rng(0).choice(len(names), 3, replace=False)
            unit = np.eye(len(names))
            ways = (dict(zip(directions, unit[k].tolist(), strict=True)) for k in columns)
            true = np.array([exact({**given, **way}) for way in ways]).T
            matrix = matrix[:, columns]
        else:
            true = np.array(exact(given)).reshape(matrix.shape)
        error = np.abs((matrix - true).astype(float)).max()
        size = np.abs(true.astype(float)).max()
        found = max(found, float(error / size) if size else 0.0)
    way = "along directions" if directions else "by entries"
    return found, f"{system.route} {way}", cost(system.program, "jacobian")["total"]


def main() -> None:
    """Each scene on a line."""
    for scene in sys.argv[1:] or built_in_names():
        error, way, operations = worst(scene)
        print(f"{scene}: {error:.1e}, {way}, {operations} operations", flush=True)


if __name__ == "__main__":
    main()
