"""Sweeps of scenes with contacts, beside the C code that makes the same steps and nothing else.

    python tests/benchmarks/sweeps.py [--members 64] [--rounds 5] [--ant ant.xml]

64 of Gymnasium's ants fall on a soft floor, each from its own height, with its own velocities and
torques: 2 s by DOP853, and by rk4 with 1 ms. Beside `ensemble` in one process, and in two workers,
is

- for DOP853: its compiled function, called once for each member from the start, with the same
  tolerances and without checks of corners;
- for rk4: a loop in C around the derivative of `eomgen generate --backend c`, one member after the
  other, without checks of stability.

All take turns in one process, and ratios are those of a round. The time of `ensemble` includes
reading the scene's code from the store and preparing each member; compilation, before the first
round, is printed by itself.
"""

import argparse
import ctypes
import math
import sys
import time
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from paired import paired, spread

import eomgen
from eomgen.codegen.backends import c
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.native.accelerator import Accelerator
from eomgen.native.compiler import find_compiler
from eomgen.native.module import usual_constants
from eomgen.run.compiled import Stretch
from eomgen.run.module import as_problem, load_module
from eomgen.store import generated_code, interfaced_program_of

T_END, DT, RTOL = 2.0, 1e-3, 1e-9
FEET = {
    "body_4": (0.2, 0.2),
    "body_7": (-0.2, 0.2),
    "body_10": (-0.2, -0.2),
    "body_13": (0.2, -0.2),
}
FLOOR = {"type": "contact", "law": "hunt_crossley", "stiffness": 2e4, "dissipation": 0.3}
GRIP = {"friction": 1.0, "slip_speed": 0.05}
LOOP = """
#include "{main}"
#include <math.h>
void run(const double *p, const double *u, double *y, double h, long steps) {{
    double k[{constants} + 1], f[4][{n}], at[{n}];
    {prefix}_constants(p, k);
    for (long i = 0; i < steps; i++) {{
        const double t = i * h;
        {prefix}_derivative(t, y, k, u, f[0]);
        for (int j = 0; j < {n}; j++) at[j] = y[j] + h / 2 * f[0][j];
        {prefix}_derivative(t + h / 2, at, k, u, f[1]);
        for (int j = 0; j < {n}; j++) at[j] = y[j] + h / 2 * f[1][j];
        {prefix}_derivative(t + h / 2, at, k, u, f[2]);
        for (int j = 0; j < {n}; j++) at[j] = y[j] + h * f[2][j];
        {prefix}_derivative(t + h, at, k, u, f[3]);
        for (int j = 0; j < {n}; j++)
            y[j] += h / 6 * (f[0][j] + 2 * f[1][j] + 2 * f[2][j] + f[3][j]);
        {{
            double *const q = y + {quaternion};
            const double length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
            for (int j = 0; j < 4; j++) q[j] /= length;
        }}
    }}
}}
"""


def ant(path: Path) -> dict[str, Any]:
    """The ant with a soft floor under its feet and its torso."""
    tables: dict[str, Any] = dict(eomgen.import_robot(path).tables)
    feet = [
        {**FLOOR, **GRIP, "name": f"{body}_floor", "body": body, "at": [x, y, 0.0], "radius": 0.08}
        for body, (x, y) in FEET.items()
    ]
    torso = {**FLOOR, **GRIP, "name": "torso_floor", "body": "torso", "radius": 0.25}
    return {**tables, "effects": [*tables["effects"], *feet, torso]}


def design(count: int) -> dict[str, np.ndarray]:
    """Where the members begin, and their constant torques."""
    rng = np.random.default_rng(1)
    bounds = {
        "torso_z": (0.6, 0.9),
        **dict.fromkeys(("torso_x_dot", "torso_y_dot"), (-2.0, 2.0)),
        **dict.fromkeys(("torso_wx", "torso_wz"), (-3.0, 3.0)),
        **{f"ankle_{i}": (0.5, 1.2) if i in (1, 4) else (-1.2, -0.5) for i in range(1, 5)},
        **dict.fromkeys((f"hip_{i}_dot" for i in range(1, 5)), (-2.0, 2.0)),
        **dict.fromkeys((f"actuator_{i}" for i in range(8)), (-0.05, 0.05)),
    }
    return {name: rng.uniform(*each, count) for name, each in bounds.items()}


class Members:
    """The same members for C: their states and inputs."""

    def __init__(self, model: Model, vary: dict[str, np.ndarray]) -> None:
        self.model = model
        self.module = load_module(generated_code(model).module, model.name)
        count = len(next(iter(vary.values())))
        self.starts = np.tile(self.module.initial_state(), (count, 1))
        self.inputs = np.tile([*map(float, self.module.INPUTS.values())], (count, 1))
        for name, values in vary.items():
            if name in self.module.STATES:
                self.starts[:, self.module.STATES.index(name)] = values
            else:
                self.inputs[:, list(self.module.INPUTS).index(name)] = values

    def by_loop(self) -> Any:
        """The loop around the exported derivative."""
        program, interface = interfaced_program_of(self.model)
        values = {
            "main": f"{interface.name}.c",
            "prefix": interface.name,
            "n": len(self.module.STATES),
            "constants": len(usual_constants(self.module, "derivative", None)) + 4000,
            "quaternion": self.module.QUATERNIONS[0][0],
        }
        texts = {**c.files(program, interface), "loop.c": LOOP.format(**values)}
        compiler, path = find_compiler(), Path(f"/tmp/eomgen_loop_{time.time_ns()}.so")
        path.write_bytes(compiler.shared_library(texts, "loop.c", "-O2", *compiler.tuning))
        run = ctypes.CDLL(str(path)).run
        path.unlink()
        run.argtypes = [*[ctypes.c_void_p] * 3, ctypes.c_double, ctypes.c_long]
        p, steps = np.array([*self.module.PARAMETERS.values()], float), round(T_END / DT)

        def call() -> np.ndarray:
            ends = self.starts.copy()
            for y, u in zip(ends, self.inputs, strict=True):
                run(p.ctypes.data, u.ctypes.data, y.ctypes.data, DT, steps)
            return ends

        return call

    def by_dop853(self) -> Any:
        """DOP853's compiled function alone."""
        accelerator = Accelerator(self.model, self.module, None, None)
        accelerator.compile()
        made = []
        for start, u in zip(self.starts, self.inputs, strict=True):
            given = dict(zip(self.module.INPUTS, u.tolist(), strict=True))
            problem = accelerator.at(None, given).of(as_problem(self.module, None, given))
            assert problem.compiled is not None
            steps = problem.compiled.steps("DOP853", ())
            made.append((steps, start, problem.derivative(0.0, start), np.array(problem.sizes)))

        def call() -> np.ndarray:
            ends = []
            for steps, start, slope, sizes in made:
                at = SimpleNamespace(t=0.0, y=start, h_abs=1e-4, f=slope, lost=0.0 * start)
                stretch = Stretch(
                    *(at, T_END, True, RTOL, 1e-12 * sizes, math.inf, 1024),
                    *(False, False, np.empty(0), None, None, False, None),
                )
                while at.t < T_END:
                    stride = steps(stretch)
                    assert stride.usual
                    at.t, at.y = float(stride.ends[-1]), stride.states[-1]
                    vars(at).update({n: values[-1] for n, values in stride.memory.items()})
                ends.append(at.y)
            return np.array(ends)

        return call


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--members", type=int, default=64)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--ant", type=Path, default=None)
    given = parser.parse_args()
    path = given.ant
    if path is None:
        spec = find_spec("gymnasium")
        if spec is None or spec.origin is None:
            sys.exit("install gymnasium, or give --ant ant.xml")
        path = Path(spec.origin).parent / "envs/mujoco/assets/ant.xml"
    scene, vary = eomgen.read(ant(path)), design(given.members)
    members = Members(elaborate(scene), vary)
    for name, options, alone in (
        ("DOP853", {}, members.by_dop853()),
        ("rk4", {"dt": DT}, members.by_loop()),
        ("rk4, unguarded", {"dt": DT, "unstable": True}, members.by_loop()),
    ):

        def sweep(workers: int, name: str = name, options: dict[str, Any] = options) -> np.ndarray:
            run = eomgen.ensemble(
                scene,
                vary,
                t_end=T_END,
                integrator=name.partition(",")[0],
                workers=workers,
                **options,
            )
            assert all(run.finished), run.messages[~run.finished][0]
            return run.final

        began = time.perf_counter()
        ends = sweep(1)
        first = time.perf_counter() - began
        times = paired(given.rounds, alone, lambda: sweep(1), lambda: sweep(2))
        middle = np.median(times, axis=0)
        off = np.median(np.abs(ends - alone()).max(axis=1))
        print(
            f"{given.members} ants, {T_END:g} s by {name}: C alone {middle[0]:.2f} s; sweep "
            f"{middle[1]:.2f} s, {spread(times[:, 1] / times[:, 0])} times; by two workers "
            f"{middle[2]:.2f} s; the first {first:.1f} s; median difference {off:.1g}",
            flush=True,
        )


if __name__ == "__main__":
    main()
