"""Units for co-simulation of five scenes and more, in FMPy, beside our own runs.

    python tests/campaigns/fmus.py [SCENE:T_END …]

For each: what FMPy's validation finds; the greatest difference of the last state from our own run,
relative to the state where that is above 1, in co-simulation by FMPy, in model exchange by FMPy's
functions with SciPy's DOP853, and in model exchange by FMPy's own CVode (BDF, order 5 at most); and
the greatest difference of directional derivatives along states from the generated Jacobian, at the
start, relative to the largest entry. CVode needs a tolerance of 1e-14 for it: at 1e-12 its error
at the end is up to 1e-7.
"""

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.append(str(Path(__file__).parent.parent))

from fmpy import simulate_fmu
from fmpy.validation import validate_fmu
from importer import begun, exchanged, instance

import eomgen

SCENES = ("two_body:2.5", "double_pendulum:5", "cart_pole:3", "puma560:2", "bouncing_two_body:2")
BOUND = 1e-8


def main() -> None:
    """Export, validate, simulate, compare."""
    worst = 0.0
    print("scene, t_end (s): validation; co-simulation, exchange by DOP853, by CVode; Jacobian")
    for asked in sys.argv[1:] or SCENES:
        scene, _, end = asked.partition(":")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "unit.fmu"
            begin = time.perf_counter()
            eomgen.export(scene, "fmu", path)
            took = time.perf_counter() - begin
            t_end = float(end) if end else eomgen.read(scene).simulation.t_end
            problems = validate_fmu(str(path))
            run = eomgen.simulate(scene, t_end=t_end, rtol=1e-13, atol=1e-15, samples=2)
            stepped = difference(run, by_fmpy(path, run, "CoSimulation"))
            by_order_8 = difference(run, exchanged(path, t_end))
            by_order_5 = difference(run, by_fmpy(path, run, "ModelExchange"))
            slopes = jacobian(path, scene)
        print(
            f"{scene}, {run.t[-1]:g}: {problems or 'valid'}; {stepped:.1e}, {by_order_8:.1e}, "
            f"{by_order_5:.1e}; {slopes:.1e}; {len(run.trajectory.events)} events; "
            f"exported in {took:.1f} s",
            flush=True,
        )
        worst = max(worst, stepped, by_order_8, by_order_5, np.inf if problems else 0.0)
    print(f"greatest difference: {worst:.1e}")
    sys.exit(not worst <= BOUND)


def by_fmpy(path: Path, run: Any, kind: str) -> np.ndarray:
    """The last state of a run by FMPy's own masters."""
    try:
        found = simulate_fmu(
            str(path),
            fmi_type=kind,
            stop_time=run.t[-1],
            output_interval=run.t[-1] / (10 if kind == "CoSimulation" else 1000),
            relative_tolerance=1e-12 if kind == "CoSimulation" else 1e-14,
            output=list(run.states),
        )
    except RuntimeError:
        return np.full(len(run.states), np.nan)
    return np.array([found[name][-1] for name in run.states])


def difference(run: Any, y: np.ndarray) -> float:
    """The greatest difference from the last state of a run."""
    return float((np.abs(y - run.y[-1]) / np.maximum(1.0, np.abs(run.y[-1]))).max())


def jacobian(path: Path, scene: str) -> float:
    """The greatest difference of directional derivatives from the generated Jacobian."""
    module: Any = eomgen.load(eomgen.generate(scene))
    exact = module.jacobian(0.0, module.initial_state())
    with instance(path, "ModelExchange") as (unit, refs):
        begun(unit, 1.0)
        rates = [refs[f"der({name})"] for name in module.STATES]
        found = [unit.getDirectionalDerivative(rates, [refs[n]], [1.0]) for n in module.STATES]
    return float(np.abs(np.transpose(found) - exact).max() / np.abs(exact).max())


if __name__ == "__main__":
    main()
