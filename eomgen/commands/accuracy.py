"""What accuracy costs in time: `accuracy`."""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from eomgen.commands.arithmetic import check_arithmetic, print_arithmetic
from eomgen.commands.shared import Arguments, assignments, code_of, located, note, read_whole
from eomgen.entries import Entries
from eomgen.errors import RunError
from eomgen.files import check_folder, check_writable
from eomgen.model.elaborate import in_order
from eomgen.model.model import Model
from eomgen.run.module import GeneratedModule, as_powers
from eomgen.run.progress import terminal_line, terminal_notice, terminal_progress
from eomgen.scene.schema import SHOWN, Simulation
from eomgen.store import folder
from eomgen.study.diagnosis import problem_of

if TYPE_CHECKING:
    from eomgen.run.problem import Floats
    from eomgen.study.accuracy.ladder import Ladder, Rung, Work
    from eomgen.study.accuracy.reference import Reference
    from eomgen.study.accuracy.work_precision import Bench


def accuracy(given: Arguments) -> int:
    """Print, write and draw what runs cost by every method, and how exact the arithmetic is."""
    scene, model, name = read_whole(given.scene, given)
    if not given.no_arithmetic:
        check_arithmetic(given, name)
    if not given.arithmetic:
        _runs(given, model, scene.simulation, name)
    if not given.no_arithmetic:
        print_arithmetic(given, model, scene.simulation, name)
    return 0


def _runs(given: Arguments, model: Model, wanted: Simulation, name: str) -> None:
    """Run every method over its ladder; print the table, write it and draw it."""
    from eomgen import pipeline  # here, so that loading SymPy is not counted as deriving
    from eomgen.commands.accuracy_table import about, print_table
    from eomgen.show.style import check_figure
    from eomgen.study.accuracy import records
    from eomgen.study.accuracy.ladder import methods_named
    from eomgen.study.accuracy.reference import reference
    from eomgen.study.accuracy.reference import save as save_reference
    from eomgen.study.accuracy.work_precision import call_times

    for option, value in (("--run-time", given.run_time), ("--time", given.time)):
        if not 0 < value < math.inf:
            raise RunError(f"{option}: {value:g} is no positive time; give one in s")
    methods = methods_named(given.methods)
    parameters = assignments(given.set, model.defaults, "--set")
    inputs = assignments(given.input, [i.name for i in model.inputs], "--input")
    t_end = wanted.t_end if given.t_end is None else given.t_end
    if not 0 < t_end < math.inf:
        raise RunError(f"--t-end: {t_end:g} is no positive time; give one in s")
    paths = {kind: given.output / f"{name}_accuracy.{kind}" for kind in ("csv", "png")}
    paths["npz"] = given.output / f"{name}_reference.npz"
    check_folder(given.output)
    check_figure(paths["png"], force=given.force)
    for kind in ("csv", "npz"):
        check_writable(paths[kind], force=given.force)

    model = replace(model, outputs=in_order((*SHOWN, "effect_powers")))
    begin = time.perf_counter()
    code, module = code_of(given.scene, model, given)
    generation = time.perf_counter() - begin if code.derived else None
    key = records.key(code.module, parameters, inputs, t_end, wanted.rest_speed)
    done, earlier = ({}, None) if given.fresh else records.load(paths["csv"], key)
    if generation is None:
        generation = earlier
    if generation is None:
        with terminal_notice(f"timing the generation of {name} …"):
            begin = time.perf_counter()
            pipeline.generate(model)
            generation = time.perf_counter() - begin
    with located(given.scene), terminal_progress(f"reference of {name}") as progress:
        truth = reference(
            model,
            module,
            parameters or None,
            inputs or None,
            t_end,
            progress=progress,
            folder=_references(given),
            rest_speed=wanted.rest_speed,
        )
        bench = _bench(model, module, parameters, inputs, truth, wanted.rest_speed)
        _check_reference(bench)
        costs = call_times(bench.problem, truth)
    ladder = _ladder(bench, t_end, given)
    same = about(bench, costs, t_end, parameters, inputs)

    def keep(works: Mapping["Rung", "Work"]) -> None:
        records.save(
            paths["csv"],
            key,
            works.values(),
            generation=generation,
            same=same,
            force=given.force,
        )

    works = dict(done)
    made = _climb(name, bench, ladder, methods, works, keep, given.time)
    keep(works)
    shown = records.ordered(work for work in works.values() if work.rung.method in methods)
    print_table(name, bench, ladder, methods, shown, costs, generation, t_end)
    _print_origin(len(shown), made, given.time, ladder, methods, works)
    save_reference(truth, paths["npz"])
    _draw(name, model, bench, t_end, shown, paths["png"], given.force)
    for path in paths.values():
        print(f"    wrote {path}")


def _references(given: Arguments) -> Path | None:
    """Where references are kept; what is wrong with it is said."""
    kept = folder("references")
    if kept and (trouble := Entries(kept).trouble()):
        note(given, f"the store {kept} is not used: {trouble}")
    return kept


def _bench(
    model: Model,
    module: GeneratedModule,
    parameters: Mapping[str, float],
    inputs: Mapping[str, float],
    truth: "Reference",
    rest_speed: float | None,
) -> "Bench":
    """What runs of a model are measured by."""
    from eomgen.show.balance import keeps_energy
    from eomgen.show.observe import joint_drift
    from eomgen.study.accuracy.work_precision import Bench

    own = model.with_parameters(parameters)
    p = own.defaults
    values = (parameters or None, inputs or None)

    def kinetic(t: "Floats", y: "Floats") -> "Floats":
        return np.asarray(module.kinetic_energy(t, y.T, p))

    def energy(t: "Floats", y: "Floats") -> "Floats":
        return np.asarray(kinetic(t, y) + module.potential_energy(t, y.T, p))

    def gap(t: "Floats", y: "Floats") -> "Floats":
        poses = np.moveaxis(module.body_poses(t, y.T, p), -1, 0)
        return np.asarray(np.max(joint_drift(own, poses), axis=1, initial=0.0))

    t, y = truth.t, truth.y
    potential = energy(t, y) - kinetic(t, y)
    scale = float(np.max(kinetic(t, y)) + np.ptp(potential)) or 1.0
    keeps = keeps_energy(own, inputs)
    return Bench(
        problem=problem_of(module, *values, own),
        reference=truth,
        rest_speed=rest_speed,
        kinetic=kinetic,
        energy=energy if keeps else None,
        energy_scale=scale,
        powers=None if keeps else as_powers(module, *values),
        gap=gap if model.form == "redundant" else None,
    )


def _check_reference(bench: "Bench") -> None:
    """Raise `RunError` where the reference does not even tell right from wrong."""
    from eomgen.study.accuracy.measure import WRONG

    if not bench.floors[0] < WRONG:
        raise RunError(
            f"its motion is known to {bench.reference.error:.1g} of its own scale only, too little "
            "to compare methods by (a chaotic motion, or many impacts); take a shorter --t-end"
        )


def _ladder(bench: "Bench", t_end: float, given: Arguments) -> "Ladder":
    from eomgen.study.accuracy.ladder import Ladder, atol_scale, first_steps

    truth, noise = bench.reference, bench.problem.noise
    return Ladder(
        t_end=t_end,
        first=first_steps(bench.problem, truth.t, truth.y, truth.scale),
        atol_scale=atol_scale(truth.y, truth.scale),
        quick=given.quick,
        run_time=given.run_time,
        noise=float(max(noise(t_end))) if noise else 0.0,
    )


def _climb(
    name: str,
    bench: "Bench",
    ladder: "Ladder",
    methods: Sequence[str],
    works: dict["Rung", "Work"],
    keep: Callable[[Mapping["Rung", "Work"]], None],
    seconds: float,
) -> int:
    """Make the runs that are missing, each kept as soon as it is made; return how many."""
    from eomgen.study.accuracy.work_precision import sweep

    begin, made = time.perf_counter(), 0
    with terminal_line() as say:

        def notice(rung: "Rung") -> None:
            spent = time.perf_counter() - begin
            say(
                f"accuracy of {name}: {len(works)} runs, {spent:.0f} s of {seconds:g} s at most; "
                f"now {rung.method}, {rung.setting}"
            )

        for work in sweep(bench, ladder, methods, works, begin + seconds, notice):
            works[work.rung] = work
            made += 1
            keep(works)
    return made


def _print_origin(
    shown: int,
    made: int,
    seconds: float,
    ladder: "Ladder",
    methods: Sequence[str],
    works: Mapping["Rung", "Work"],
) -> None:
    """Say which runs were made now, and which not at all."""
    from eomgen.commands.shared import print_listed
    from eomgen.study.accuracy.work_precision import left_out

    if shown > made:
        print(f"    {made} runs made now, {shown - made} taken from earlier (--fresh begins anew)")
    missing = left_out(ladder, methods, works)
    if missing:
        print(f"    {seconds:g} s were over before finer runs of these; the same command goes on:")
        print_listed("        ", missing)


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

    truth = bench.reference
    energy = ""
    if bench.energy is not None:
        energy = "Energy drift, in parts of the motion's own"
    elif any(work.energy_drift >= 0 for work in shown):
        energy = "Energy unaccounted for at the end"
    floor, _ = bench.floors
    about = (
        f"{model.title or model.name}, {t_end:g} s, form {model.form}; "
        "time is the least of repeated runs, outputs off\n"
        f"reference: its own error {truth.error:.1g}, errors are told apart from {floor:.1g} on; "
        f"{truth.origin.partition(';')[0]}"
    )
    save(Diagram(name, about, floor, energy, model.form == "redundant"), shown, path, force=force)
