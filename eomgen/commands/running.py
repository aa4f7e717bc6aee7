"""The commands `simulate` and `view`."""

import os
import sys
import webbrowser
from pathlib import Path

import numpy as np

from eomgen.api.inputs import applied
from eomgen.api.options import RunOptions
from eomgen.api.planning import plan_run
from eomgen.api.runs import Run
from eomgen.api.saving import output_paths, save_run
from eomgen.api.simulating import run_plan
from eomgen.api.states import state_names
from eomgen.base.errors import InterruptedRunError, RunError
from eomgen.commands.choosing import print_choice, print_estimate, warn_of_energy
from eomgen.commands.shared import (
    Arguments,
    assignments,
    overlap_lines,
    print_listed,
    print_wrapped,
    read_whole,
    reporter_of,
    required,
    scene_with_inputs,
    shortened,
)
from eomgen.commands.usage import taken
from eomgen.run.parquet import check_parquet
from eomgen.run.trajectory import Trajectory

ROUNDING = 1e-12
"""Energies smaller than this, relative to the greatest of the run, are printed as 0."""


def simulate(given: Arguments) -> int:
    """Simulate; write module, trajectory, figure and page, also those of a run that stopped."""
    if given.no_pictures and (given.view or given.plot is not None):
        other = "--view" if given.view else "--plot"
        raise RunError(f"--no-pictures draws nothing, and {other} asks for a picture; drop one")
    if given.no_pictures and given.live:
        raise RunError("--no-pictures writes no page, and --live asks for one; drop one")
    reporter = reporter_of(given, given.scene)
    applied_to = applied(*scene_with_inputs(given), reporter)
    scene, model, name = read_whole(given.scene, given, applied_to[0])
    parameters = assignments(given.parameters, model.defaults, "--set")
    with reporter.located():
        state = assignments(given.state, state_names(model), "--state")
    plan = plan_run(
        scene,
        model,
        taken(RunOptions, given, source=scene, parameters=parameters, state=state),
        constants=applied_to[1],
        varying=applied_to[2],
        outputs=required(given, model),
        reporter=reporter,
    )
    if given.parquet:
        check_parquet("--parquet")
    paths = output_paths(
        given.output, name, figure=given.plot, parquet=given.parquet, force=given.force
    )
    if given.resume is not None and given.resume.resolve() == paths["npz"].resolve():
        raise RunError(f"--from: {given.resume} would be overwritten; give another folder with -o")
    run = run_plan(plan, reporter=reporter)
    with reporter.waiting(f"writing {name} …"):
        drawing = save_run(
            run, paths, pictures=not given.no_pictures, live=given.live, force=given.force
        )
    missed = _report(given, run)
    for path in paths.values():
        print(f"    wrote {path}")
    warn_of_energy(run)
    trouble = missed if run.finished else f"{run.model.name}: {run.message}"
    if trouble or drawing:
        kind = InterruptedRunError if run.outcome.kind == "interrupted" else RunError
        raise kind(*(line for line in (trouble, drawing) if line))
    if given.view:
        _open(paths["html"])
    return 0


def _report(given: Arguments, run: Run) -> str:
    """Print how the run went; return which accuracy could not be reached, or ""."""
    trajectory = run.trajectory
    print(
        f"{run.model.name}: {trajectory.t[-1]:g} s by {trajectory.integrator}, "
        f"{trajectory.counts['steps']} steps, {trajectory.counts['derivatives']} derivatives"
        f"{' in C' if run.compiled else ''} "
        f"({'derived now' if run.module.derived else 'module fresh, not derived again'})"
    )
    if run.begun:
        print(f"    {run.begun}")
    else:
        for line in shortened(overlap_lines(run.model)):
            print(f"    {line}")
    for line in _step_limit_lines(given, trajectory):
        print(f"    {line}")
    missed = print_choice(run.choice, given) if run.choice else ""
    if run.estimate:
        print_estimate(run.estimate)
    if run.finished and run.message:
        print_wrapped("    ", run.message)
    _print_energy(run)
    _print_events(trajectory)
    if run.motion.joints:
        print(f"    largest gap in a joint {run.motion.joint_drift.max(initial=0.0):.2g} m")
    _print_violations(run)
    _print_excursions(run)
    for line in run.locks:
        print(f"    {line}")
    return missed


def _print_violations(run: Run) -> None:
    """Print the largest residuals of constraints, m and rad."""
    units = {name: "m" if unit == "N" else "rad" for name, unit in run.model.rows}
    for unit in dict.fromkeys(units[name] for name in run.trajectory.violations):
        found = [pair for name, pair in run.trajectory.violations.items() if units[name] == unit]
        before, after = (max(part) for part in zip(*found, strict=True))
        print(
            f"    largest residual of a constraint {after:.2g} {unit}, {before:.2g} {unit} before "
            "projection"
        )


def _step_limit_lines(given: Arguments, trajectory: Trajectory) -> list[str]:
    """Lines on steps that were shortened, and how often, for reasons other than their error."""
    from eomgen.run.checks import LEAST_STEPS

    steps, capped, cut = (trajectory.counts[name] for name in ("steps", "capped", "cut"))
    lines = []
    if given.unstable:
        lines.append("steps could be too long for stability (--unstable)")
    if cut:
        times = "once" if cut == 1 else f"{cut} times"
        lines.append(
            f"a step was repeated with a shorter length {times}: it had passed over a contact, a "
            "stop, a pulse or the like"
        )
    if capped and given.max_step is not None:
        lines.append(f"{capped} of {steps} steps were limited by --max-step")
    elif capped:
        lines.append(
            f"{capped} of {steps} steps were limited to 1/{LEAST_STEPS} of the run, since a longer "
            "step may pass over a short event; --max-step sets another length"
        )
    return lines


def _print_energy(run: Run) -> None:
    """Print the energy at start and end; if known, also the work of each effect, and the change
    of kinetic energy that the works do not explain, J.
    """
    motion, total = run.motion, run.energy
    least = ROUNDING * float(np.abs([motion.kinetic_energy, motion.potential_energy]).max())

    def shown(energy: float) -> float:
        return energy if abs(energy) > least else 0.0

    print(f"    energy {shown(total[0]):.9g} J at the start, {shown(total[-1]):.9g} J at the end")
    if motion.works is None:
        return
    works, kinetic = motion.works[-1], motion.kinetic_energy
    each = [f"{name} {shown(work):.6g} J" for name, work in zip(motion.effects, works, strict=True)]
    print_listed("    work: ", shortened(each))
    change = float(kinetic[-1] - kinetic[0])
    left = change - works.sum()
    print(f"    kinetic energy changed by {shown(change):.6g} J, {left:.2g} J unaccounted for")


def _print_events(trajectory: Trajectory) -> None:
    """Print the number of impacts, and the contacts that are closed at the end, since when."""
    if not trajectory.events:
        return
    impacts = trajectory.counts["impacts"]
    words = [f"{impacts} impact{'' if impacts == 1 else 's'}"]
    words += [f"at rest on {name} from t = {t:.6g} s" for name, t in trajectory.held.items()]
    print_listed("    ", shortened(words))


def _print_excursions(run: Run) -> None:
    """Print which coordinates left the limits of their joints; only a stop enforces limits."""
    model, units, lines = run.model, {c.name: c.unit for c in run.model.coordinates}, []
    for out in run.excursions:
        unit = units[out.state]
        first = out.since == float(run.t[0])
        when = "" if first else f" at t = {out.since:.4g} s"
        lines.append(
            f"{out.state} {'starts outside' if first else 'leaves'} its limits "
            f"{out.low:g} to {out.high:g} {unit}{when}; "
            f"farthest {out.farthest:.4g} {unit} at t = {out.at:.4g} s"
        )
    given = {c.position.name: "locked" if c.locked else "driven" for c in model.prescribed}
    why = f"is not a state of the form '{model.form}'"
    lines += [
        f"{name} has limits, but {f'is {given[name]}' if name in given else why}"
        for name in run.limits
        if name not in run.states
    ]
    for line in shortened(lines):
        print(f"    {line}")
    if lines:
        print("    limits are reported, not enforced")


def view(given: Arguments) -> int:
    """Simulate, then open the page."""
    given.view = True
    return simulate(given)


def _open(page: Path) -> None:
    """Open a page in a browser; without a display print how to open it."""
    screen = sys.platform in ("win32", "darwin") or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )
    if not (screen and webbrowser.open(page.resolve().as_uri())):
        print(f"    no display here; open {page} in a browser")
