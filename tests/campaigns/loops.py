"""Mechanisms with loops: 300 random ones by every route, and other engines; see the parts.

    python tests/campaigns/loops.py [PART] [--count N] [--method NAME]

random       accelerations and wrenches of all joints by every route against the solver in maximal
             coordinates; 1 to 6 loops, all joint types, in the plane and in space by turns
pinocchio    accelerations against Pinocchio's constraint dynamics, of mechanisms in space that
             balls and welds close
mujoco       the same, of mechanisms that balls and welds close, against its own M, bias and rows of
             equality constraints, with the constraints met exactly
masses       accelerations by the route that `auto` takes where masses are spread over 12 decades:
             right, as far off as is said, or refused
energy       of a four-bar whose crank goes round, over 1e5 steps of each method of order 4 or more
             that claims to keep it; --method NAME for one
peaucellier  how straight the line of Peaucellier's cell is over 1e5 steps
symplectic   constraints and energy of a four-bar that swings, over 1e6 steps of RATTLE
"""

import argparse
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path += [str(Path(__file__).parent.parent / room) for room in ("", "run", "dynamics")]

import judges
import planar_linkages
import uneven_loops as uneven
from engine import apart, engine
from loop_routes import ROUTES, apart_by_route, model_of, solved
from spatial_loops import random_loops
from test_loop_runs import four_bar
from test_loops import CLOSE, CONDITION, WELL, left_out

import eomgen
from eomgen.dynamics.start.assembly import assembled
from eomgen.model.elaborate import elaborate
from eomgen.native.accelerator import Accelerator
from eomgen.run.integrate import integrate
from eomgen.run.module import as_problem, load_module
from eomgen.scene.reader import parse_scene
from eomgen.store import generated_code


def random(count: int) -> int:
    """How many of the mechanisms are off by more than the bars."""
    failed, worst = 0, {route: [0.0] * 4 for route in ROUTES}
    kinds: Counter[str] = Counter()
    conditions = []
    start = time.process_time()
    for seed in range(count):
        dimensions, loops = 2 + seed % 2, 1 + seed // 2 % 6
        case = random_loops(seed, dimensions, 4 + loops + seed % 3, loops)
        model, (u, motion) = model_of(case), solved(case, seed)
        well = case.condition < CONDITION
        kinds.update(f"{loop.joint.kind}_{dimensions}" for loop in case.tree.loops)
        conditions.append(case.condition)
        for route, off in apart_by_route(case, model, u, motion).items():
            at = 2 * (not well)
            worst[route][at : at + 2] = np.maximum(worst[route][at : at + 2], off)
            if max(off) > (WELL if well else CLOSE) or model.notices:
                failed += 1
                notices = "; ".join(model.notices)
                print(f"{seed}: {route} off by {off[0]:.1e}, wrenches {off[1]:.1e}; condition "
                      f"{case.condition:.0f} {notices}", flush=True)  # fmt: skip
        if (seed + 1) % 50 == 0:
            print(f"to {seed + 1}: {time.process_time() - start:.0f} s", flush=True)
    well = sum(condition < CONDITION for condition in conditions)
    print(f"{count} mechanisms, {well} well-conditioned, largest condition {max(conditions):.1e}")
    print(f"loop joints: {dict(sorted(kinds.items()))}")
    for route, off in worst.items():
        numbers = " ".join(f"{x:.1e}" for x in off)
        print(f"{route:<12} v̇, wrenches; of the others v̇, wrenches: {numbers}")
    return failed


def pinocchio(count: int) -> int:
    """How many mechanisms in space that balls and welds close are not as Pinocchio has them."""
    failed, tried, worst = 0, 0, 0.0
    for seed in range(count):
        loops = 1 + seed % 3
        case = random_loops(seed, 3, 4 + loops + seed % 3, loops, ("ball", "weld"))
        model, (u, motion) = model_of(case), solved(case, seed)
        try:
            other = judges.pinocchio_accelerations(case.tree, case.q, case.v, u)
        except judges.Unsuitable:
            continue
        tried += 1
        off = apart(other, motion.accelerations)
        ours = apart_by_route(case, model, u, replace(motion, accelerations=other))
        off = max(off, *(accelerations for accelerations, _ in ours.values()))
        worst = max(worst, off)
        if off > CLOSE:
            failed += 1
            print(f"{seed}: off by {off:.1e}; condition {case.condition:.0f}", flush=True)
    print(f"{tried} mechanisms; the worst is off by {worst:.1e}")
    return failed


def mujoco(count: int) -> int:
    """How many mechanisms that hinges, balls and welds close are not as MuJoCo has them."""
    failed, worst = 0, 0.0
    for seed in range(count):
        dimensions, loops = 2 + seed % 2, 1 + seed // 2 % 4
        kinds = ("revolute", "weld") if dimensions == 2 else ("ball", "weld", "revolute")
        case = random_loops(seed, dimensions, 4 + loops + seed % 3, loops, kinds)
        model, (u, motion) = model_of(case), solved(case, seed)
        other = judges.mujoco_constrained(case.tree, case.q, case.v, u)
        ours = apart_by_route(case, model, u, replace(motion, accelerations=other))
        off = max(accelerations for accelerations, _ in ours.values())
        worst = max(worst, off)
        if off > CLOSE:
            failed += 1
            print(f"{seed}: off by {off:.1e}; condition {case.condition:.0f}", flush=True)
    print(f"{count} mechanisms; the worst is off by {worst:.1e}")
    return failed


def masses(count: int) -> int:
    """How many mechanisms of uneven masses are more off than is said, at any of some states."""
    counts: Counter[str] = Counter()
    routes: Counter[str] = Counter()
    errors: dict[str, list[float]] = {}
    for seed in range(count):
        outcome = uneven.tried(seed)
        counts[outcome.words if outcome.words in uneven.WELL else "silent"] += 1
        routes[outcome.route] += 1
        for route, off in outcome.errors.items():
            errors.setdefault(route, []).append(off)
        if outcome.words not in uneven.WELL:
            print(f"{seed}: {outcome.route} {outcome.words}", flush=True)
        if (seed + 1) % 10 == 0:
            print(f"to {seed + 1}: {dict(counts)}", flush=True)
    print(f"{count} mechanisms: {dict(counts)}; routes taken: {dict(routes)}")
    print("error beyond what the data's last places decide: median, worst, more than 1e-10")
    for route, off in errors.items():
        print(f"{route:<12} {np.median(off):.1e} {max(off):.1e} {sum(x > 1e-10 for x in off)}")
    return counts["silent"]


def energy(steps: int, methods: Sequence[str] = ("leapfrog_4", "leapfrog_6")) -> int:
    """How many methods have a trend of energy, or let the constraints go."""
    failed = 0
    for method in methods:
        text = planar_linkages.four_bar_scene(1.0, 6.0)
        scene = eomgen.read(text).replaced(loops="projected")
        run = eomgen.simulate(scene, t_end=0.01 * steps, integrator=method, dt=0.01,
                              samples=min(steps, 20_000) + 1)  # fmt: skip
        off = run.energy - run.energy[0]
        means = np.array([block.mean() for block in np.array_split(off, 20)])
        fit, spread = np.polyfit(np.arange(20), means, 1, cov=True)
        slope, error = 20 * fit[0], 20 * float(np.sqrt(spread[0, 0]))
        module = eomgen.load(eomgen.generate(scene))
        gaps = np.abs(module.constraint_residuals(0.0, run.y.T)).max()
        band = np.abs(off).max()
        print(f"{method}: {steps} steps, energy {run.energy[0]:.3g} J within {band:.1e}; trend "
              f"over the run {slope:.1e} ± {error:.1e}; constraints {gaps:.1e} m",
              flush=True)  # fmt: skip
        failed += (abs(slope) > 4 * error and abs(slope) > 0.02 * band) or gaps > 1e-12
    return int(failed)


def peaucellier(steps: int) -> int:
    """Whether the line is not straight to 1e-12 of its length."""
    text = planar_linkages.peaucellier_scene()
    module = engine(text, "aba", leave_out=left_out("point_positions")).module
    run = integrate(as_problem(module), "rk4", 1e-3 * steps, dt=1e-3)
    x, y = module.point_positions(0.0, run.y.T)[0]
    off = float(np.abs(x - planar_linkages.LINE).max() / np.ptp(y))
    print(f"{len(run.t) - 1} steps: off by {off:.1e} of its length, {np.ptp(y):.3f} m")
    return int(off > WELL or not run.finished)


OUTPUTS = ("kinetic_energy", "potential_energy", "mass_matrix", "kinetic_slopes")


@dataclass(frozen=True)
class Conserved:
    """What a run conserved.

    residual  the largest residual of the constraints at the end of any step, m
    band      the width of the band of energies over the whole run, J
    early     that over its first tenth
    trend     the change of energy over the run by a straight line through its rows, J
    """

    residual: float
    band: float
    early: float
    trend: float


def conserved(text: str, integrator: str, dt: float, steps: int, rows: int = 100_000) -> Conserved:
    """The run of a scene, whose state needs projection, in compiled code from the first step on."""
    model = assembled(elaborate(parse_scene(text)))
    model = replace(model, outputs=OUTPUTS)
    module = load_module(generated_code(model).module, model.name)
    problem = as_problem(module)
    assert problem.projection is not None, "the state of this scene needs no projection"
    accelerator = Accelerator(model, module, None, None)
    accelerator.compile()
    run = integrate(accelerator.of(problem), integrator, dt * steps, dt=dt, samples=rows)
    assert run.finished and accelerator.used, run.message
    y = run.y.T
    energy = np.asarray(module.kinetic_energy(0.0, y) + module.potential_energy(0.0, y))
    slope = np.polynomial.Polynomial.fit(run.t, energy, 1).convert().coef[1]
    early = energy[: len(energy) // 10]
    return Conserved(
        max(after for _, after in run.violations.values()),
        float(np.ptp(energy)),
        float(np.ptp(early)),
        float(slope * run.t[-1]),
    )


def symplectic(steps: int) -> int:
    """Whether constraints open by more than 1e-12 m, or energy leaves its band or has a trend."""
    text = four_bar(initial="q = { theta = 0.3 }", route="embedded")
    start = time.perf_counter()
    found = conserved(text, "leapfrog", 2e-3, steps)
    print(f"{steps} steps in {time.perf_counter() - start:.1f} s: residual {found.residual:.1e} m, "
          f"band of energy {found.band:.3e} J, that of the first tenth {found.early:.3e} J, "
          f"trend {found.trend:.1e} J")  # fmt: skip
    kept = found.band < 1.01 * found.early and abs(found.trend) < 0.01 * found.band
    return int(found.residual > WELL or not kept)


PARTS = {
    "random": (random, 300),
    "pinocchio": (pinocchio, 60),
    "mujoco": (mujoco, 100),
    "masses": (masses, 300),
    "energy": (energy, 100_000),
    "peaucellier": (peaucellier, 100_000),
    "symplectic": (symplectic, 1_000_000),
}


def main() -> None:
    """One of the parts, or all."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("part", nargs="?", choices=PARTS)
    parser.add_argument("--count", type=int, help="mechanisms, or steps")
    parser.add_argument("--method", help="integrator, of energy")
    given = parser.parse_args()
    failed = 0
    for name, (part, usual) in PARTS.items():
        if given.part in (None, name):
            print(f"{name}:")
            more = ([given.method],) if name == "energy" and given.method else ()
            failed += part(given.count or usual, *more)
    sys.exit(failed > 0)


if __name__ == "__main__":
    main()
