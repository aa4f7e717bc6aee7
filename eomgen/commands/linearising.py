"""The command `linearise`."""

import math
from collections.abc import Sequence

import numpy as np

from eomgen.api.linearising import linearisable, linearised_at
from eomgen.api.options import PointOptions
from eomgen.api.states import state_names
from eomgen.base.errors import RunError
from eomgen.base.files import check_writable
from eomgen.commands.shared import (
    Arguments,
    assignments,
    given_inputs,
    located,
    print_listed,
    print_wrapped,
    read_model,
    reporter_of,
    shortened,
)
from eomgen.commands.usage import taken
from eomgen.model.model import Model
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import FloatArray
from eomgen.study.linear.linearise import Linearisation, rate_unit, save
from eomgen.study.linear.modes import Mode

WIDEST = 12
"""A and B are printed for up to this number of states."""
ROUNDING = 1e-9
"""Computed positions, accelerations and inputs below this, in SI units, are printed as 0."""


def linearise(given: Arguments) -> int:
    """Print the linearisation, its modes, stability and controllability; write A and B."""
    model, _ = read_model(given.scene, given)
    model = linearisable(model)
    parameters = assignments(given.parameters, model.defaults, "--set")
    if given.output is not None:
        check_writable(given.output, force=given.force)
        if given.output.suffix not in (".npz", ".csv"):
            raise RunError(f"{given.output}: give a name that ends in .npz or .csv")
    with located(given.scene):
        state = assignments(given.state, state_names(model), "--state")
    inputs = given_inputs(given.inputs, [i.name for i in model.inputs])
    own = {"parameters": parameters, "state": state, "inputs": inputs}
    point = taken(PointOptions, given, source=given.scene, **own)
    found = linearised_at(model, point, reporter_of(given, given.scene))
    linearisation = found.linearisation
    reduced = linearisation.reduced()
    _print_point(found.module, linearisation, given.at, given.trim)
    if given.at != "initial":
        _print_dropped_velocities(model, found.start)
    elif found.steady:
        print_wrapped(
            "note        ",
            "a steady motion: no velocity changes, and A and B stay as they are along it",
        )
    _print_matrices(reduced)
    _print_modes(linearisation.modes)
    verdict = {
        "unstable": "unstable: a small deviation grows",
        "stable": "stable: every small deviation dies out",
        "marginal": "marginal: to first order some small deviation neither dies out nor grows fast",
    }
    print(f"stability   {verdict[linearisation.stability]}")
    if reduced.input_names:
        rank, n = linearisation.controllable_rank, len(reduced.A)
        print(f"control     rank {rank} of {n}: {'' if rank == n else 'not '}controllable")
    if given.output is not None:
        save(linearisation, model.name, given.output, force=given.force)
        print(f"wrote {given.output}")
    return 0


def _print_point(
    module: GeneratedModule, found: Linearisation, at: str, trimmed: Sequence[str]
) -> None:
    nq = len(module.POSITIONS)
    kind = {
        "equilibrium": "an equilibrium",
        "rest": "the state where it comes to rest",
        "initial": "the given state",
    }
    print(f"{module.NAME}: linearised about {kind[at]}")
    velocities = range(nq, 2 * nq - len(module.QUATERNIONS))
    values = []
    for i, (name, value) in enumerate(zip(found.state_names, found.y.tolist(), strict=True)):
        if at != "initial" and i in velocities:
            continue
        value = value if abs(value) > ROUNDING else 0.0
        unit = module.UNITS[name]
        after = f" ({_number(math.degrees(value))} deg)" if unit == "rad" and value else ""
        if (
            i >= velocities.stop and unit
        ):  # a state of a controller: its name does not give its unit
            after = f" {unit}"
        values.append(f"{name} = {_number(value)}{after}")
    print_listed("state       ", shortened(values, 80))
    inputs = []
    for name, value in zip(found.input_names, found.u.tolist(), strict=True):
        rounding = name in trimmed and abs(value) <= ROUNDING
        inputs.append(f"{name} = {_number(0.0 if rounding else value)}")
    print_listed("inputs      ", inputs)
    changes = found.rates[nq:]
    if at == "initial" and np.max(np.abs(changes), initial=0.0) > ROUNDING:
        worst = int(np.argmax(np.abs(changes)))
        name = found.state_names[nq + worst]
        print_wrapped(
            "note        ",
            f"no equilibrium: {name} changes by {_number(changes[worst])} "
            f"{rate_unit(module.UNITS[name])}; A and B are for "
            "deviations from this motion, at this instant",
        )


def _print_dropped_velocities(model: Model, start: FloatArray) -> None:
    """Print the velocities of the given state, which an equilibrium lacks."""
    rates = start[len(model.coordinates) :].tolist()
    moving = [
        f"{c.name} = {_number(v)}" for c, v in zip(model.velocities, rates, strict=False) if v
    ]
    if moving:
        print_wrapped(
            "note        ",
            f"at rest, without the initial {', '.join(shortened(moving, 12))}; "
            "--at initial keeps the motion",
        )


def _print_matrices(reduced: Linearisation) -> None:
    n, names = len(reduced.A), reduced.state_names
    if n > WIDEST:
        shape = f"A is {n} x {n}" + (f", B {n} x {reduced.B.shape[1]}" if reduced.B.size else "")
        print(f"matrices    {shape}; -o FILE.npz or -o FILE.csv writes them")
        return
    _print_matrix("A", reduced.A, names, names)
    if reduced.B.size:
        _print_matrix("B", reduced.B, names, reduced.input_names)


def _print_matrix(
    label: str, matrix: FloatArray, rows: Sequence[str], columns: Sequence[str]
) -> None:
    rounding = 1e-14 * float(np.max(np.abs(matrix), initial=0.0))
    cells = [[_number(x if abs(x) > rounding else 0.0) for x in row] for row in matrix.tolist()]
    widths = [max(map(len, (name, *texts))) for name, *texts in zip(columns, *cells, strict=True)]
    first = max(map(len, (label, *rows)))
    lines = [(label, columns), *zip(rows, cells, strict=True)]
    for name, texts in lines:
        padded = (text.rjust(width) for text, width in zip(texts, widths, strict=True))
        print(f"    {name:<{first}}  {'  '.join(padded)}")


def _print_modes(found: Sequence[Mode]) -> None:
    """Print a line for each mode; equal lines are counted."""
    counts: dict[tuple[str, str], int] = {}
    for mode in found:
        counts[_mode(mode)] = counts.get(_mode(mode), 0) + 1
    width = max((len(value) for value, _ in counts), default=0)
    lines = [
        f"    {value:<{width}}  {text}" + (f", {count} times" if count > 1 else "")
        for (value, text), count in counts.items()
    ]
    print("eigenvalues, 1/s")
    print("\n".join(shortened(lines)))


def _mode(mode: Mode) -> tuple[str, str]:
    """An eigenvalue or a conjugate pair as text, and its frequency and damping, or its time."""
    if mode.angular_frequency:
        value = f"{_number(mode.rate)} ± {_number(mode.angular_frequency)}i"
        return value, f"{mode.frequency:.4g} Hz, damping {_number(mode.damping)}"
    if mode.rate:
        time = math.log(2) / abs(mode.rate)
        return _number(mode.rate), f"{'doubles' if mode.rate > 0 else 'halves'} in {time:.4g} s"
    return "0", "stays or drifts"


def _number(x: float) -> str:
    return f"{x + 0.0:.6g}"
