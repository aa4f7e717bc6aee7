"""The command `accuracy`."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from eomgen.api.accuracy import Accuracy, measure, plan_measurement
from eomgen.api.inputs import in_formulas
from eomgen.api.options import AccuracyOptions
from eomgen.base.files import check_folder, check_writable
from eomgen.commands.arithmetic import check_files, print_arithmetic
from eomgen.commands.shared import (
    Arguments,
    assignments,
    print_listed,
    read_whole,
    reporter_of,
    scene_with_inputs,
)
from eomgen.commands.usage import taken
from eomgen.model.model import Model
from eomgen.run.progress import terminal_line
from eomgen.scene.schema import Simulation

if TYPE_CHECKING:
    from eomgen.study.accuracy.ladder import Work
    from eomgen.study.accuracy.trial import Setting
    from eomgen.study.accuracy.work_precision import Bench


def accuracy(given: Arguments) -> int:
    """Print, write and draw time and error of runs by each method, and rounding errors of v̇."""
    reporter = reporter_of(given, given.scene)
    tables, inputs = in_formulas(*scene_with_inputs(given), reporter)
    scene, model, name = read_whole(given.scene, given, tables)
    if not given.no_arithmetic:
        check_files(given, name)
    if not given.arithmetic:
        _runs(given, model, inputs, scene.simulation, name)
    if not given.no_arithmetic:
        print_arithmetic(given, model, scene.simulation, name)
    return 0


def _runs(
    given: Arguments,
    model: Model,
    inputs: Mapping[str, float],
    simulation: Simulation,
    name: str,
) -> None:
    """Run each method at its tolerances or steps; print, write and draw the results."""
    from eomgen.commands.accuracy_table import print_table
    from eomgen.show.style import check_figure
    from eomgen.study.accuracy.reference import save as save_reference

    reporter = reporter_of(given, given.scene)
    paths = {kind: given.output / f"{name}_accuracy.{kind}" for kind in ("csv", "png")}
    paths["npz"] = given.output / f"{name}_reference.npz"
    options = taken(
        AccuracyOptions,
        given,
        source=given.scene,
        parameters=assignments(given.parameters, model.defaults, "--set"),
        table=paths["csv"],
    )
    plan = plan_measurement(model, simulation, options, inputs, reporter)
    check_folder(given.output)
    check_figure(paths["png"], force=given.force)
    for kind in ("csv", "npz"):
        check_writable(paths[kind], force=given.force)

    def notice(count: int, spent: float, setting: "Setting") -> None:
        say(
            f"accuracy of {name}: {count} runs, {spent:.0f} s of at most {given.time:g} s; "
            f"now {setting.integrator}, {setting.brief}"
        )

    with terminal_line() as say:
        measurement = measure(
            plan,
            force=given.force,
            name=name,
            notice=notice,
            reporter=reporter,
        )
    found = measurement.found
    print_table(name, measurement)
    _print_origin(found, given.time)
    save_reference(found.reference, paths["npz"])
    _draw(name, model, measurement.bench, found.t_end, found.works, paths["png"], given.force)
    for path in paths.values():
        print(f"    wrote {path}")


def _print_origin(found: Accuracy, seconds: float) -> None:
    """Print how many runs were made now, and which were not made."""
    shown = len(found.works)
    if shown > found.made:
        print(
            f"    {found.made} runs made now, {shown - found.made} taken from the table (--fresh "
            "repeats them)"
        )
    if found.left_out:
        print(f"    {seconds:g} s passed before all runs were made; the same command makes these:")
        print_listed("        ", found.left_out)


def _draw(
    name: str,
    model: Model,
    bench: "Bench",
    t_end: float,
    shown: Sequence["Work"],
    path: Path,
    force: bool,
) -> None:
    from eomgen.show.work_precision import Diagram, save
    from eomgen.study.accuracy.reading import TARGETS, cheapest, cost_of

    truth, cost = bench.reference, cost_of(bench)
    taken = {target: cheapest(shown, target, cost)[:1] for target in TARGETS}
    energy = ""
    if bench.energy is not None:
        energy = "Energy drift, relative to the motion's own"
    elif any(work.energy_drift >= 0 for work in shown):
        energy = "Energy unaccounted for at the end"
    floor, _ = bench.floors
    about = (
        f"{model.title or model.name}, {t_end:g} s, form {model.form}; "
        f"runs in {'compiled C code' if bench.compiled else 'Python'}; "
        "time is the least of repeated runs, outputs off\n"
        f"reference: its own error {truth.error:.1g}, errors are resolved down to {floor:.1g}; "
        f"{truth.origin.partition(';')[0]}"
    )
    diagram = Diagram(name, about, floor, energy, model.form == "redundant", taken)
    save(diagram, shown, path, force=force)
