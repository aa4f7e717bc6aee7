"""Motions computed and shown: `simulate`, `view`."""

import os
import sys
import webbrowser
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eomgen.api import setting_of
from eomgen.commands.choosing import (
    check_choice,
    choose,
    print_choice,
    print_estimate,
    warn_of_energy,
)
from eomgen.commands.shared import (
    Arguments,
    assignments,
    code_of,
    overlap_lines,
    print_listed,
    print_wrapped,
    read_whole,
    shortened,
)
from eomgen.errors import InterruptedRunError, RunError
from eomgen.files import check_folder, check_writable, remove_ours, write_whole
from eomgen.model.elaborate import in_order
from eomgen.model.model import Model, ways_of
from eomgen.run.limits import excursions
from eomgen.run.module import GeneratedModule, as_powers
from eomgen.run.progress import terminal_progress
from eomgen.run.trajectory import Trajectory, is_own_table
from eomgen.scene.appearance import appearance_of
from eomgen.scene.effects import JointStop
from eomgen.scene.joints.base import Geared
from eomgen.scene.schema import SHOWN
from eomgen.store import Code
from eomgen.study.diagnosis import locks, problem_of

if TYPE_CHECKING:
    from eomgen.run.guard import Guard
    from eomgen.show.motion import Motion
    from eomgen.study.accuracy.search import Choice
    from eomgen.study.accuracy.trial import Case, Setting, Tried


def simulate(given: Arguments) -> int:
    """Integrate; write module, trajectory, figure and page; of a run that stops, what it has."""
    # Imported here: `check` and `generate` need neither SciPy nor Matplotlib.
    from eomgen.run.resume import going_on
    from eomgen.run.trajectory import load_npz
    from eomgen.show.observe import observe
    from eomgen.study.accuracy.aimed import made_again
    from eomgen.study.accuracy.moved import moved_problem
    from eomgen.study.accuracy.trial import Case

    check_choice(given)
    scene, model, name = read_whole(given.scene, given)
    asked = (*model.outputs, *SHOWN, *(("effect_powers",) if given.works else ()))
    model = replace(model, outputs=in_order(asked))
    parameters = assignments(given.set, model.defaults, "--set")
    inputs = assignments(given.input, [i.name for i in model.inputs], "--input")
    wanted = scene.simulation
    chosen = given.accuracy is not None or given.budget is not None
    if chosen and given.resume is not None:
        raise RunError(
            "--from: goes on with a method that is named; leave --accuracy, --budget out"
        )
    setting = None
    if not chosen:
        bounds = {name: getattr(given, name) for name in ("dt", "rtol", "atol")}
        setting = setting_of(wanted, given.integrator, **bounds, dashes="--")
    _check_unstable(given, setting)
    paths = _output_paths(given, name)
    if given.resume is not None and given.resume.resolve() == paths["npz"].resolve():
        raise RunError(f"--from: {given.resume} would be overwritten; give another folder with -o")
    code, module = code_of(given.scene, model, given)
    values = (parameters or None, inputs or None)
    kept = {
        "samples": given.samples,
        "max_step": given.max_step,
        "rest_speed": wanted.rest_speed,
        "guard": _guard(given, module, values),
        "unstable": given.unstable,
    }
    problem, start = problem_of(module, *values, model), None
    if given.resume is not None:
        assert setting is not None
        limits = {name: kept[name] for name in ("max_step", "rest_speed")}
        start = going_on(load_npz(given.resume), given.resume, problem, setting, **limits)
        problem = start.problem
        kept |= start.options
    case = Case(
        problem,
        _or(given.t_end, wanted.t_end),
        module.UNITS,
        kept,
        terminal_progress,
        moved_problem(module, *values, model),
    )
    powers = as_powers(module, *values) if given.works else None
    choice = None
    if setting is None:
        choice = choose(case, given)
        tried = made_again(case, choice, powers)
    else:
        tried = case.run(setting, powers=powers)
    trajectory = tried.trajectory
    model = model.with_parameters(parameters)
    motion = observe(model, module, trajectory, appearance_of(scene), inputs)
    drawing = _write(code, trajectory, motion, tuple(model.defaults.values()), paths, given.force)
    words = start.told(trajectory) if start else ""
    missed = _report(given, model, code, case, tried, choice, motion, words)
    for path in paths.values():
        print(f"    wrote {path}")
    warn_of_energy(motion)
    trouble = missed if trajectory.finished else f"{model.name}: {trajectory.message}"
    if trouble or drawing:
        kind = InterruptedRunError if tried.interrupted else RunError
        raise kind(*(line for line in (trouble, drawing) if line))
    if given.view:
        _open(paths["html"])
    return 0


def _write(
    code: Code,
    trajectory: Trajectory,
    motion: "Motion",
    parameters: tuple[float, ...],
    paths: dict[str, Path],
    force: bool,
) -> str:
    """Write everything; return "" or, if pictures cannot be drawn, why not."""
    from eomgen.run.trajectory import save_csv, save_npz

    write_whole(paths["py"], code.module, force=force)
    # The table first: the archive of an earlier run is what tells whose table it overwrites.
    save_csv(trajectory, paths["csv"], force=force)
    save_npz(trajectory, paths["npz"], force=force)
    return _save_pictures(motion, code.poses, parameters, paths, force)


def _report(
    given: Arguments,
    model: Model,
    code: Code,
    case: "Case",
    tried: "Tried",
    choice: "Choice | None",
    motion: "Motion",
    words: str,
) -> str:
    """Say how the run went; return "" or what the choice of a method could not meet.

    words  of what the run goes on from
    """
    trajectory = tried.trajectory
    print(
        f"{model.name}: {trajectory.t[-1]:g} s by {trajectory.integrator}, "
        f"{trajectory.counts['steps']} steps, {trajectory.counts['derivatives']} derivatives "
        f"({'derived now' if code.derived else 'module fresh, not derived again'})"
    )
    if words:
        print(f"    {words}")
    else:
        for line in shortened(overlap_lines(model)):
            print(f"    {line}")
    for line in _bounded(given, trajectory):
        print(f"    {line}")
    missed = print_choice(choice, given) if choice else ""
    if given.estimate and not choice and trajectory.finished:
        print_estimate(case, tried)
    if given.guard and trajectory.finished and trajectory.message:
        print_wrapped("    ", trajectory.message)
    _print_energy(motion)
    _print_events(trajectory)
    if motion.joints:
        print(f"    largest gap in a joint {motion.joint_drift.max(initial=0.0):.2g} m")
    _print_excursions(model, trajectory)
    for line in locks(model, trajectory):
        print(f"    {line}")
    return missed


def _bounded(given: Arguments, trajectory: Trajectory) -> list[str]:
    """What else than their error kept steps short, and how often; that nothing did, if asked."""
    from eomgen.run.checks import LEAST_STEPS

    steps, capped, cut = (trajectory.counts[name] for name in ("steps", "capped", "cut"))
    lines = []
    if given.unstable:
        lines.append("steps were let be too long for stability (--unstable)")
    if cut:
        times = "once" if cut == 1 else f"{cut} times"
        lines.append(
            f"a step was made again, shorter, {times}: it had passed over a contact, a stop, a "
            "pulse or the like"
        )
    if capped and given.max_step is not None:
        lines.append(f"{capped} of {steps} steps as long as --max-step allows")
    elif capped:
        lines.append(
            f"{capped} of {steps} steps held to 1/{LEAST_STEPS} of the run: what longer ones would "
            "pass over cannot be told; --max-step sets another length"
        )
    return lines


def _check_unstable(given: Arguments, setting: "Setting | None") -> None:
    """Raise `RunError` for `--unstable` where no step can be too long."""
    from eomgen.run.integrators import FixedStep, find_integrator

    if not given.unstable:
        return
    if setting is None:
        raise RunError("--unstable: is for a step that is given; leave --accuracy, --budget out")
    method = find_integrator(setting.integrator)
    if not (isinstance(method, FixedStep) and method.explicit):
        raise RunError(
            f"--unstable: steps of {setting.integrator} are stable however long, or its own "
            "choice; leave it out, or take --integrator euler, leapfrog or rk4"
        )


def _guard(
    given: Arguments, module: GeneratedModule, values: tuple[dict[str, float] | None, ...]
) -> "Guard | None":
    """What watches the run, if that is asked for."""
    if given.guard is None:
        return None
    from eomgen.precision.guarding import guard_of

    return guard_of(module, *values, repairs=given.guard == "repair")


def _save_pictures(
    motion: "Motion",
    poses: str,
    parameters: tuple[float, ...],
    paths: dict[str, Path],
    force: bool,
) -> str:
    """Write figure and page; return "" or, if they cannot be drawn, why not."""
    from eomgen.show.figure import save_figure
    from eomgen.show.page import save_page

    try:
        save_figure(motion, paths["png"], force=force)
        save_page(motion, poses, parameters, paths["html"], force=force)
    except (RunError, KeyboardInterrupt) as error:
        # Pictures of an earlier run must not stand beside the numbers of this one.
        for kind in ("png", "html"):
            remove_ours(paths.pop(kind))
        if isinstance(error, KeyboardInterrupt):
            raise
        return str(error)
    return ""


def _print_energy(motion: "Motion") -> None:
    """Say the energy at both ends; if it is known, what each effect has done, and what of the
    change of kinetic energy that leaves, J.
    """
    kinetic, total = motion.kinetic_energy, motion.kinetic_energy + motion.potential_energy
    print(f"    energy {total[0]:.9g} J at the start, {total[-1]:.9g} J at the end")
    if motion.works is None:
        return
    works, change = motion.works[-1], float(kinetic[-1] - kinetic[0])
    each = [f"{name} {work:.6g} J" for name, work in zip(motion.effects, works, strict=True)]
    print_listed("    work: ", shortened(each))
    left = change - works.sum()
    print(f"    kinetic energy changed by {change:.6g} J, {left:.2g} J unaccounted for")


def _print_events(trajectory: Trajectory) -> None:
    """Say how often rigid contacts struck, and which are held at the end, since when."""
    if not trajectory.events:
        return
    held: dict[str, float] = {}
    for event in trajectory.events:
        if event.kind == "rest":
            held[event.contact] = event.t
        elif event.kind == "lift":
            held.pop(event.contact, None)
    impacts = trajectory.counts["impacts"]
    words = [f"{impacts} impact{'' if impacts == 1 else 's'}"]
    words += [f"at rest on {name} from t = {t:.6g} s" for name, t in held.items()]
    print_listed("    ", shortened(words))


def _print_excursions(model: Model, trajectory: Trajectory) -> None:
    """Say which coordinates left the limits of their joints, which nothing but a stop enforces."""
    joints = ways_of(model.bodies, model.dimensions)
    stops = [effect for effect in model.effects if isinstance(effect, JointStop)]
    stopped = {joint for stop in stops for joint in stop.acted_on(joints)}
    limits, units = {}, {}
    for body in model.bodies:
        if body.joint.name in stopped:
            continue
        if isinstance(body.joint, Geared) and body.joint.limits is not None:
            coordinate = body.positions[0]
            limits[coordinate.name], units[coordinate.name] = body.joint.limits, coordinate.unit
    start = float(trajectory.t[0])
    lines = []
    for out in excursions(trajectory, limits):
        unit = units[out.state]
        first = out.since == start
        when = "" if first else f" at t = {out.since:.4g} s"
        lines.append(
            f"{out.state} {'starts outside' if first else 'leaves'} its limits "
            f"{out.low:g} to {out.high:g} {unit}{when}; "
            f"farthest {out.farthest:.4g} {unit} at t = {out.at:.4g} s"
        )
    given = {c.position.name: "locked" if c.locked else "driven" for c in model.prescribed}
    why = f"is no state of the form '{model.form}'"
    lines += [
        f"{name} has limits, but {f'is {given[name]}' if name in given else why}"
        for name in limits
        if name not in trajectory.states
    ]
    for line in shortened(lines):
        print(f"    {line}")
    if lines:
        print("    limits are reported, not enforced")


def _output_paths(given: Arguments, name: str) -> dict[str, Path]:
    """Where a simulation writes, by kind; raises `RunError` now for what could not be written."""
    from eomgen.show.style import check_figure

    kinds = ("py", "npz", "csv", "png", "html")
    paths = {kind: given.output / f"{name}.{kind}" for kind in kinds}
    paths["png"] = _or(given.plot, paths["png"])
    check_figure(paths["png"], force=given.force)
    for kind, path in paths.items():
        check_folder(path.parent)
        own = kind == "csv" and path.is_file() and is_own_table(path)
        check_writable(path, force=given.force or own)
    return paths


def _or(given: Any, default: Any) -> Any:
    """What the command line gave, or the scene's own."""
    return default if given is None else given


def view(given: Arguments) -> int:
    """Simulate, then open the page."""
    given.view = True
    return simulate(given)


def _open(page: Path) -> None:
    """Show a page where there is a display; where there is none, say how."""
    screen = sys.platform in ("win32", "darwin") or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )
    if not (screen and webbrowser.open(page.resolve().as_uri())):
        print(f"    no display here; open {page} in a browser")
