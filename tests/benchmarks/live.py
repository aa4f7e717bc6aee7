"""The page's mechanism in node beside the same in C: derivatives and live steps in a second.

    python tests/benchmarks/live.py [SCENE …]

prints for each scene the size of the generated source, kB; the time of a derivative in node and in
C, µs, least of many short runs, and their ratio; steps a second of rk4 in node, and by `simulate`
in C with its bookkeeping, nan where they overflow; and steps a second in node of the method and
step that the page chooses, with how many times faster than real time that is. The derivative in
node is that of the interactive model, with switches and pulls; in C it is that of the scene,
compiled with -O2 -march=native.
"""

import math
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))
from live import run_in_node

import eomgen
from eomgen.api.given import model_of, read
from eomgen.native.compiler import FLAGS, find_compiler
from eomgen.scene.built_in import built_in_names
from eomgen.show.live import live_table
from eomgen.store import live_code

SCRIPT = """
const { data } = given;
const values = (table) => Float64Array.from(table, (x) => x.value);
const [p, u] = [values(data.parameters), values(data.inputs)];
const y = Float64Array.from(data.initial);
let least = Infinity;
for (const end = performance.now() + 6000; performance.now() < end; ) {
  const from = performance.now();
  for (let i = 0; i < 50; i += 1) mechanism.derivative(0, y, p, u);
  least = Math.min(least, (performance.now() - from) / 50);
}
// Steps a second after a warm start, over some seconds of motion or of the clock.
const speed = (engine) => {
  engine.advance(0.3, 3000);
  let [made, most] = [0, 0];
  for (const end = performance.now() + 3000; performance.now() < end && !engine.error; ) {
    const from = performance.now();
    made = engine.advance(engine.dt * 40);
    most = Math.max(most, made / (performance.now() - from) * 1000);
    if (engine.t > 5) engine.reset();
  }
  return most;
};
const chosen = makeEngine(mechanism, data);
const { method, dt } = chosen;
const own = speed(chosen);
const rk4 = { liveMethod: "rk4", liveStep: Math.min(dt, 1e-3) };
const explicit = makeEngine(mechanism, { ...data, ...rk4 });
return { derivative: least * 1000, rk4: speed(explicit), own, method, dt, step: explicit.dt };
"""
MAIN = """
#include <stdio.h>
#include <time.h>
#include "NAME.c"
static double p[UPPER_PARAMETERS + 1], k[UPPER_CONSTANTS + 1], y[UPPER_STATES], out[UPPER_STATES];
static double u[UPPER_INPUTS + 1];
/* Not known to the compiler, so that it makes every call. */
typedef void function(double, const double *, const double *, const double *, double *);
static function *volatile call = NAME_derivative;
static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}
int main(void) {
    NAME_defaults(p);
    if (NAME_constants(p, k)) return 1;
    NAME_initial_state(0, y, k, u, y);
    double least = 1, end = now() + 1.0;
    while (now() < end) {
        double from = now();
        for (int i = 0; i < 50; i++) call(0, y, k, u, out);
        double took = (now() - from) / 50;
        if (took < least) least = took;
    }
    printf("%.9e %g\\n", least, out[0]);
}
"""


def in_c(name: str) -> float:
    """The time of a derivative in C, s."""
    module = eomgen.generate(name, backend="c")
    main = MAIN.replace("UPPER", name.upper()).replace("NAME", name)
    compiler = find_compiler()
    flags = [f for f in (*FLAGS, *compiler.ordering) if f not in ("-shared", "-fPIC")]
    with tempfile.TemporaryDirectory() as folder:
        for file, text in {f"{name}.c": module.source, **module.others, "main.c": main}.items():
            (Path(folder) / file).write_text(text, "utf-8")
        command = [*compiler.command, *flags, *compiler.tuning, "-O2", "-D_POSIX_C_SOURCE=199309L"]
        subprocess.run([*command, "main.c", "-o", "main", "-lm"], cwd=folder, check=True)
        done = subprocess.run(["./main"], cwd=folder, check=True, capture_output=True, text=True)
    return float(done.stdout.split()[0])


def steps_in_c(name: str, dt: float) -> float:
    """Steps of rk4 a second in C; nan if there are none, or if the motion overflows."""

    def took(steps: int) -> tuple[float, bool]:
        from_ = time.process_time()
        run = eomgen.simulate(
            name,
            integrator="rk4",
            dt=dt,
            t_end=steps * dt,
            backend="c",
            samples=2,
            unstable=True,
        )
        return time.process_time() - from_, run.compiled and run.trajectory.finished

    took(100)
    few, many = ([took(steps) for _ in range(3)] for steps in (2000, 12000))
    if model_of(read(name), name).form != "velocity" or not all(ok for _, ok in many):
        return math.nan
    return 10000 / (min(many)[0] - min(few)[0])


def measured(name: str) -> str:
    """A line of the table."""
    scene = read(name)
    model = model_of(scene, name)
    trajectory = eomgen.simulate(scene).trajectory
    mean = float(trajectory.t[-1]) / max(1, trajectory.counts["steps"])
    code = live_code(model)
    table = live_table(model, code, scene.simulation, mean_step=mean)
    found = run_in_node(code.source, SCRIPT, {"data": table})
    compiled = in_c(name) * 1e6
    rk4, own = steps_in_c(name, found["step"]), found["own"]
    return (
        f"{name:<20}{len(code.source.encode()) / 1e3:>8.0f}{code.operations:>8}"
        f"{found['derivative']:>9.2f}{compiled:>8.2f}{found['derivative'] / compiled:>7.1f}"
        f"{found['rk4']:>12.0f}{rk4:>10.0f}  {found['method']:<18}{found['dt']:<8g}"
        f"{own:>9.0f}{own * found['dt']:>8.0f}"
    )


if __name__ == "__main__":
    widths = {"scene": -20, "kB": 8, "op.s": 8, "node µs": 9, "C µs": 8, "ratio": 7}
    widths |= {
        "rk4 steps/s": 12,
        "in C": 10,
        "  method": -20,
        "step": -8,
        "steps/s": 9,
        "x time": 8,
    }
    print("".join(f"{head:{'<' if n < 0 else '>'}{abs(n)}}" for head, n in widths.items()))
    for name in sys.argv[1:] or built_in_names():
        print(measured(name), flush=True)
