"""What each command does; what is heavy is imported by the command that needs it."""

import argparse
import importlib.metadata
import math
import os
import sys
import webbrowser
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from eomgen.errors import EomgenError, RunError, SceneError, nearest
from eomgen.files import check_folder, check_writable, remove_ours, write_whole
from eomgen.joints.base import WORLD
from eomgen.model import Model, build_model
from eomgen.run.module import GeneratedModule, as_problem, load_module
from eomgen.run.progress import terminal_notice, terminal_progress
from eomgen.scene.reader import built_in_names, find_scene, read_scene
from eomgen.scene.schema import Form
from eomgen.store import generated_code

Arguments = argparse.Namespace


def version() -> str:
    """This program's version."""
    return importlib.metadata.version("eomgen")


def list_scenes(given: Arguments) -> int:
    """Names and titles of the built-in scenes."""
    names = built_in_names()
    for name in names:
        print(f"{name:<{max(map(len, names))}}  {read_scene(name).title}")
    return 0


def print_schema(given: Arguments) -> int:
    """The JSON Schema of the scene language."""
    from eomgen.scene.json_schema import json_schema

    print(json_schema(), end="")
    return 0


def check(given: Arguments) -> int:
    """Validate; bodies, joints, degrees of freedom, effects in force."""
    model = _model(given.scene, given.form)
    print(f"{model.name}: {model.title}")
    print(f"bodies      {', '.join(body.name for body in model.bodies)}")
    for body in model.bodies:
        joint = body.joint
        parent = WORLD if body.parent < 0 else model.bodies[body.parent].name
        names = ", ".join(c.name for c in body.coordinates)
        print(f"joint       {joint.name}: {joint.type}, {parent} to {body.name}; {names}")
    print(f"freedom     {len(model.coordinates)} degrees of freedom")
    print(f"effects     {', '.join(effect.type for effect in model.effects) or 'none'}")
    print(f"inputs      {', '.join(i.name for i in model.inputs) or 'none'}")
    values = ", ".join(f"{p.name} = {p.default:g}" for p in model.parameters)
    print(f"parameters  {values or 'none'}")
    return 0


def derive(given: Arguments) -> int:
    """The derivation as text, LaTeX or a page."""
    model = _model(given.scene, given.form)
    if given.output is not None:
        check_writable(given.output, force=given.force)
    from eomgen.derivation.closed import derive as derive_equations
    from eomgen.derivation.steps import tell
    from eomgen.show.derivation import as_html, as_latex, as_text

    with _located(given.scene), terminal_notice(f"deriving {model.name} …"):
        steps = tell(derive_equations(model))
    write = {"text": as_text, "latex": as_latex, "html": as_html}[given.format]
    text = write(model.name, model.title, steps)
    if given.output is None:
        print(text)
    else:
        write_whole(given.output, text, force=given.force)
        print(f"wrote {given.output}")
    return 0


def generate(given: Arguments) -> int:
    """Write modules, or with --check say which are stale."""
    scenes = list(dict.fromkeys([*given.scenes, *(built_in_names() if given.all else ())]))
    paths: dict[Path, str] = {}
    stale = []
    for scene in scenes:
        model = _model(scene, given.form)
        path = given.output / f"{_file_name(model, given.form)}.py"
        if path in paths:
            raise RunError(
                f"{path}: would be written for {paths[path]} and for {scene}; rename one"
            )
        paths[path] = scene
        if not given.check:
            check_folder(given.output)
            check_writable(path, force=given.force)
        source, _, derived, _ = _code(scene, model)
        current = _text(path)
        if given.check:
            state = "fresh" if current == source else "missing" if current is None else "stale"
            stale += [scene] if state != "fresh" else []
            print(f"{path}: {state}")
        elif current == source:
            print(f"{path}: fresh")
        else:
            write_whole(path, source, force=given.force)
            print(f"{path}: written{'' if derived else ', not derived again'}")
        if given.report:
            _print_report(model)
    if stale:
        form = f" --form {given.form}" if given.form else ""
        raise RunError(
            f"{len(stale)} stale; run: eomgen generate {' '.join(stale)} -o {given.output}{form}"
        )
    return 0


def _file_name(model: Model, form: Form | None) -> str:
    """The scene's name, with the state form if it is not the scene's own."""
    return model.name if form is None else f"{model.name}_{form}"


def _code(scene: str, model: Model) -> tuple[str, str, bool, GeneratedModule]:
    """A model's module and page source, whether derived now, and the module, loaded and tried.

    Raises `SceneError` if it cannot be evaluated as the scene is.
    """
    with _located(scene):
        with terminal_notice(f"deriving {model.name} …"):
            source, poses, derived = generated_code(model)
        module = load_module(source, model.name)
        as_problem(module)
    return source, poses, derived, module


@contextmanager
def _located(scene: str) -> Iterator[None]:
    """Name the scene's file in front of what is said of the scene."""
    try:
        yield
    except EomgenError as error:
        raise SceneError(f"{find_scene(scene).name}: {error}") from None


def _text(path: Path) -> str | None:
    try:
        return path.read_text("utf-8")
    except (OSError, UnicodeDecodeError):
        return None


def _print_report(model: Model) -> None:
    from eomgen.pipeline import generate as generate_code

    print(f"    {'pass':<20}{'steps':>8}{'derivative':>12}{'jacobian':>10}  (operations)")
    for line in generate_code(model).reports:
        print(f"    {line.name:<20}{line.steps:>8}{line.derivative:>12}{line.jacobian:>10}")


def simulate(given: Arguments) -> int:
    """Integrate; write module, trajectory, figure and page; of a run that stops, what it has."""
    # Imported here: `check` and `generate` need neither SciPy nor Matplotlib.
    from eomgen.run.integrate import integrate
    from eomgen.run.integrators import FixedStep, find_integrator
    from eomgen.run.trajectory import save_csv, save_npz
    from eomgen.show.figure import save_figure
    from eomgen.show.observe import observe
    from eomgen.show.page import save_page

    model = _model(given.scene, given.form)
    parameters = _assignments(given.set, model.defaults, "parameter")
    inputs = _assignments(given.input, [i.name for i in model.inputs], "input")
    wanted = model.simulation
    integrator = _or(given.integrator, wanted.integrator)
    fixed = isinstance(find_integrator(integrator), FixedStep)
    paths = _output_paths(given, model)
    source, poses, derived, module = _code(given.scene, model)
    with terminal_progress(f"simulating {model.name}") as progress:
        trajectory = integrate(
            as_problem(module, parameters or None, inputs or None),
            integrator,
            _or(given.t_end, wanted.t_end),
            dt=_or(given.dt, wanted.dt) if fixed else given.dt,
            rtol=_or(given.rtol, wanted.rtol),
            atol=_or(given.atol, wanted.atol),
            samples=given.samples,
            progress=progress,
        )
    model = model.with_parameters(parameters)
    motion = observe(model, module, trajectory)
    values = tuple(model.defaults.values())
    write_whole(paths["py"], source, force=given.force)
    save_npz(trajectory, paths["npz"], force=given.force)
    save_csv(trajectory, paths["csv"], force=given.force)
    try:
        save_figure(motion, paths["png"], force=given.force)
        save_page(motion, poses, values, paths["html"], force=given.force)
    except RunError as error:
        # Pictures of an earlier run must not stand beside the numbers of this one.
        for kind in ("png", "html"):
            remove_ours(paths.pop(kind))
        drawing = str(error)
    else:
        drawing = ""

    energy = motion.kinetic_energy + motion.potential_energy
    print(
        f"{model.name}: {trajectory.t[-1]:g} s by {integrator}, "
        f"{trajectory.counts['steps']} steps, {trajectory.counts['derivatives']} derivatives "
        f"({'derived now' if derived else 'module fresh, not derived again'})"
    )
    print(f"    energy {energy[0]:.9g} J at the start, {energy[-1]:.9g} J at the end")
    print(f"    largest gap in a joint {motion.joint_drift.max(initial=0.0):.2g} m")
    for path in paths.values():
        print(f"    wrote {path}")
    trouble = "" if trajectory.finished else f"{model.name}: {trajectory.message}"
    if trouble or drawing:
        raise RunError("\n".join(line for line in (trouble, drawing) if line))
    if given.view:
        _open(paths["html"])
    return 0


def _output_paths(given: Arguments, model: Model) -> dict[str, Path]:
    """Where a simulation writes, by kind; raises `RunError` now for what could not be written."""
    from eomgen.show.style import check_figure

    kinds = ("py", "npz", "csv", "png", "html")
    name = _file_name(model, given.form)
    paths = {kind: given.output / f"{name}.{kind}" for kind in kinds}
    paths["png"] = _or(given.plot, paths["png"])
    check_figure(paths["png"], force=given.force)
    for path in paths.values():
        check_folder(path.parent)
        check_writable(path, force=given.force)
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


def _model(scene: str, form: Form | None) -> Model:
    tables = read_scene(scene)
    with _located(scene):
        model = build_model(tables)
    return model if form is None else replace(model, form=form)


def _assignments(texts: list[str], known: Collection[str], what: str) -> dict[str, float]:
    option = "--set" if what == "parameter" else "--input"
    values = {}
    for text in texts:
        name, sign, number = text.partition("=")
        if name not in known:
            hint = nearest(name, known) or f"; known: {', '.join(known) or 'none'}"
            raise RunError(f"{option}: no {what} '{name}'{hint}")
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not (sign and math.isfinite(value)):
            raise RunError(f"{option} {text}: gives no finite number; write {option} {name}=1.5")
        values[name] = value
    return values
