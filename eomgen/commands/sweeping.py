"""The command `sweep`."""

import os
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from eomgen.api.generating import compiled
from eomgen.api.inputs import for_members
from eomgen.api.options import SweepOptions
from eomgen.api.reporter import Reporter
from eomgen.api.saving import save_statistics, save_sweep
from eomgen.api.sweeping import (
    Design,
    Ensemble,
    Law,
    SweepPlan,
    grid,
    plan_sweep,
    run_sweep,
    sampled,
)
from eomgen.base.errors import InterruptedRunError, RunError, nearest
from eomgen.base.files import check_folder, check_writable
from eomgen.commands.options import Members
from eomgen.commands.shared import (
    Arguments,
    assignments,
    read_whole,
    reporter_of,
    scene_with_inputs,
    shortened,
)
from eomgen.commands.usage import taken
from eomgen.language.base import identifier
from eomgen.results.design import MOST
from eomgen.run.problem import FloatArray
from eomgen.run.progress import terminal_progress
from eomgen.sweep.storage import kept_members

FEW = 5
"""Number of members that did not finish of which the reason is printed."""


def sweep(given: Arguments) -> int:
    """Run the members; write a table and a figure; keep what has run in a folder."""
    outputs, given.outputs = given.outputs, None  # those of the model are the scene's own
    if outputs == "all":
        raise RunError("--outputs: name the functions to compute, kinetic_energy for example")
    reporter = reporter_of(given, given.scene)
    tables, inputs, varying = for_members(*scene_with_inputs(given), reporter)
    scene, model, name = read_whole(given.scene, given, tables)
    folder = given.output / f"{name}_sweep"
    options = taken(
        SweepOptions,
        given,
        source=scene,
        vary=_design(given),
        parameters=assignments(given.parameters, model.defaults, "--set"),
        outputs=outputs,
        workers=os.cpu_count() or 1 if given.workers is None else given.workers,
        folder=folder,
    )
    plan = plan_sweep(scene, model, options, constants=inputs, varying=varying, reporter=reporter)
    of = _shown(given, plan, reporter)
    table, figure = (given.output / f"{name}_sweep.{kind}" for kind in ("csv", "png"))
    check_folder(given.output)
    statistics = given.output / f"{name}_sweep_statistics.csv"
    for path in (table, figure, *([statistics] if given.statistics else [])):
        check_writable(path, force=given.force)
    counting = replace(reporter, progress=partial(terminal_progress, countdown=True))
    try:
        found = run_sweep(plan, reporter=counting)
    except KeyboardInterrupt:
        raise InterruptedRunError(
            f"{model.name}: interrupted; {kept_members(folder)} of {len(plan.design.values)} "
            f"runs are kept in {folder}, and the same command goes on with the others"
        ) from None
    save_sweep(found, of, table, figure, force=given.force)
    written = [folder, table, figure]
    if given.statistics:
        save_statistics(found, statistics, force=given.force)
        written.append(statistics)
    _report(found, of)
    for path in written:
        print(f"    wrote {path}")
    return 0


def _shown(given: Arguments, plan: SweepPlan, reporter: Reporter) -> str:
    """What the figure shows. Raises `RunError` for an unknown name."""
    _, functions = compiled(plan.model, asked=plan.outputs, reporter=reporter)
    known = dict.fromkeys((*functions.STATES, *plan.outputs, *plan.design.names))
    of = identifier(given.of) if given.of else next(iter(known))
    if of not in known:
        raise RunError(f"--of: unknown name '{of}'{nearest(of, known)}; known: {', '.join(known)}")
    return of


def _design(given: Arguments) -> Design:
    """The members that --vary and --sample describe. Raises `RunError`."""
    if not given.vary:
        raise RunError("--vary: name what is varied, --vary NAME=LOW:HIGH:COUNT for example")
    parts = dict(_part(text) for text in given.vary)
    if len(parts) < len(given.vary):
        raise RunError("--vary: a name is given twice")
    if given.sample is None:
        return grid({name: _axis(name, text) for name, text in parts.items()})
    if not 0 < given.sample <= MOST:
        raise RunError(f"--sample: {given.sample} is not a number from 1 to {MOST}")
    taken(Members, given)
    return sampled({n: _law(n, text) for n, text in parts.items()}, given.sample, given.seed)


def _part(text: str) -> tuple[str, str]:
    name, sign, rest = text.partition("=")
    if not (name and sign and rest):
        raise RunError(f"--vary {text}: write NAME=LOW:HIGH:COUNT, m_A=0.5:2:50 for example")
    return name, rest


def _axis(name: str, text: str) -> FloatArray:
    """The values of an axis of a grid. Raises `RunError`."""
    *ends, last = text.split(":")
    if logarithmic := last == "log" and len(ends) == 3:
        *ends, last = ends
    elif not ends:
        return np.array(_numbers(name, text, text.split(",")))
    if len(ends) != 2:
        raise RunError(f"--vary {name}={text}: write LOW:HIGH:COUNT, or A,B,… for single values")
    low, high, count = _numbers(name, text, (*ends, last))
    if not (count == int(count) and 1 <= count <= MOST):
        raise RunError(f"--vary {name}={text}: {last} is not a number of values from 1 to {MOST}")
    if not logarithmic:
        return np.linspace(low, high, int(count))
    if not (low > 0 and high > 0):
        raise RunError(f"--vary {name}={text}: a logarithmic axis needs positive ends")
    return np.geomspace(low, high, int(count))


def _law(name: str, text: str) -> Law:
    """The distribution of a name. Raises `RunError`."""
    parts = text.split(":")
    if len(parts) == 2:
        parts = ["uniform", *parts]
    if len(parts) != 3:
        raise RunError(
            f"--vary {name}={text}: write uniform:LOW:HIGH, loguniform:LOW:HIGH or "
            "normal:MEAN:DEVIATION with --sample"
        )
    try:
        return Law(parts[0], *_numbers(name, text, parts[1:]))
    except RunError as error:
        raise RunError(f"--vary {name}: {error}") from None


def _numbers(name: str, text: str, parts: Sequence[str]) -> list[float]:
    values = []
    for part in parts:
        try:
            value = float(part)
        except ValueError:
            value = np.nan
        if not np.isfinite(value):
            raise RunError(
                f"--vary {name}={text}: '{part}' is not a finite number; write LOW:HIGH:COUNT, or "
                "A,B,… for single values"
            )
        values.append(value)
    return values


def _report(found: Ensemble, of: str) -> None:
    """Print how many members finished, why others did not, and the spread of a quantity."""
    ended = int(found.finished.sum())
    varied = ", ".join(found.design.names)
    print(f"{found.scene}: {len(found)} runs, {varied} varied; {ended} finished")
    lines = [
        f"run {i} {found.status[i]}: {found.messages[i]}"
        for i in np.flatnonzero(~found.finished).tolist()[:FEW]
    ]
    left = len(found) - ended - len(lines)
    for line in shortened([*lines, *([f"{left} more, see the table"] if left else [])]):
        print(f"    {line}")
    values = found.of(of)[found.finished]
    if values.size and values.ndim == 1:
        low, middle, high = np.quantile(values, (0.05, 0.5, 0.95)).tolist()
        print(f"    {of} at the end: median {middle:.6g}, 5 to 95 % {low:.6g} to {high:.6g}")
