"""Live runs of all built-in scenes beside `simulate`, by the method and step that the page chooses.

    python tests/campaigns/live_runs.py [SCENE …]

For each scene: the greatest difference of a state after 10 s, relative to its size or 1, and the
time at which it exceeds 1e-9. Chaotic motions amplify the last digit, in which `Math.sin` of V8 and
`math.sin` may differ. "a last digit" is the same for two runs in Python, of which one starts with
its states changed in the last digit: no arithmetic but the same could do better.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))
from live import run_in_node

import eomgen
from eomgen.api.given import model_of, read
from eomgen.scene.built_in import built_in_names
from eomgen.show.live import live_table
from eomgen.store import live_code

SECONDS = 10.0
ROWS = 201
SCRIPT = """
const engine = makeEngine(mechanism, given.data);
const { method, dt } = engine;
const rows = [Array.from(engine.y)];
const every = Math.max(1, Math.floor(given.seconds / dt / (given.rows - 1)));
let count = 0;
engine.onSample = (t, y) => {
  count += 1;
  if (count % every === 0) rows.push(Array.from(y));
};
engine.advance(given.seconds);
return { method, dt, every, rows, t: engine.t, error: engine.error };
"""


def compare(name: str) -> str:
    """A line of the table."""
    scene = read(name)
    model = model_of(scene, name)
    first = eomgen.simulate(scene, t_end=min(scene.simulation.t_end, SECONDS)).trajectory
    mean = float(first.t[-1]) / max(1, first.counts["steps"])
    code = live_code(model)
    table = live_table(model, code, scene.simulation, mean_step=mean) | {"span": SECONDS}
    found = run_in_node(
        code.source, SCRIPT, {"data": table, "seconds": SECONDS, "rows": ROWS}, seconds=900
    )
    method, dt = found["method"], found["dt"]
    options: dict[str, Any] = {"integrator": method, "dt": dt, "t_end": SECONDS}
    options |= {"unstable": method in ("rk4", "leapfrog"), "form": "velocity", "samples": 10**6}
    # Python keeps each step, and these rows are those that node keeps.
    own = eomgen.simulate(scene, **options).trajectory
    signs = np.random.default_rng(1).choice([-np.inf, np.inf], len(own.states))
    moved = np.where(own.y[0] == 0, 1e-16, np.nextafter(own.y[0], signs))
    other = eomgen.simulate(
        scene, state=dict(zip(own.states, moved.tolist(), strict=True)), **options
    ).trajectory
    times = np.arange(0, int(SECONDS / dt / found["every"]) + 1) * found["every"] * dt
    mine = np.array(found["rows"], dtype=float)
    end, since = difference(times, mine, own)
    _, limit = difference(times, at(times, other), own)
    stopped = f"  stopped at {found['t']:.3g} s: {found['error']}" if found["error"] else ""
    return (
        f"{name:<20}{method:<20}{dt:<8g}{end:>10.1e}{since:>8}{limit:>14}"
        f"{len(own.events):>8}{stopped}"
    )


def at(times: np.ndarray, trajectory: Any) -> np.ndarray:
    """The rows of a trajectory at the times, the last row of those that have one time."""
    places = np.searchsorted(trajectory.t, times + 1e-9 * SECONDS, side="right") - 1
    return np.asarray(trajectory.y[places])


def difference(times: np.ndarray, rows: np.ndarray, own: Any) -> tuple[float, str]:
    """The difference at the end, and the time at which it exceeds 1e-9; "never" if it does not."""
    times = times[: len(rows)]
    times = times[times <= own.t[-1] * (1 + 1e-12)]
    expected = at(times, own)
    scale = np.maximum(1.0, np.abs(expected))
    apart = np.max(np.abs(rows[: len(times)] - expected) / scale, axis=1)
    late = np.flatnonzero(~(apart <= 1e-9))
    return float(apart[-1]), f"{times[late[0]]:.2f}" if late.size else "never"


if __name__ == "__main__":
    head = f"{'scene':<20}{'method':<20}{'step':<8}{'at 10 s':>10}{'beyond':>8}"
    print(f"{head}{'a last digit':>14}{'events':>8}")
    for name in sys.argv[1:] or built_in_names():
        print(compare(name), flush=True)
