"""A mechanism linearised, with what control engineers ask of it: `linearise`."""

import math
from collections.abc import Sequence

import numpy as np

from eomgen.api.linearising import linearisable, linearised_about, state_names
from eomgen.commands.shared import (
    Arguments,
    assignments,
    located,
    print_listed,
    print_wrapped,
    read_model,
    reporter_of,
    shortened,
)
from eomgen.errors import RunError
from eomgen.files import check_writable
from eomgen.linear.linearise import Linearisation, rate_unit, save
from eomgen.linear.modes import Mode
from eomgen.model.model import Model
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import FloatArray

WIDEST = 12
"""States up to which A and B are printed."""
STILL = 1e-9
"""Positions, accelerations and inputs found that are below this, in SI units, are rounding."""


def linearise(given: Arguments) -> int:
    """Print A and B about an equilibrium or a state, modes, and what the inputs can do."""
    model, _ = read_model(given.scene, given)
    model = linearisable(model)
    parameters = assignments(given.set, model.defaults, "--set")
    inputs = assignments(given.input, [i.name for i in model.inputs], "--input")
    if given.output is not None:
        check_writable(given.output, force=given.force)
        if given.output.suffix not in (".npz", ".csv"):
            raise RunError(f"{given.output}: give a name that ends in .npz or .csv")
    with located(given.scene):
        state = assignments(given.state, state_names(model), "--state")
    about = linearised_about(
        model,
        at=given.at,
        state=state,
        parameters=parameters,
        inputs=inputs,
        hold=given.hold,
        trim=given.trim,
        reporter=reporter_of(given, given.scene),
    )
    module, whole = about.module, about.whole
    least, found = whole.reduced(), whole.modes
    _print_place(module, whole, given.at, given.trim)
    if given.at != "initial":
        _print_stopped(model, about.start)
    elif about.steady:
        print_wrapped(
            "note        ",
            "a steady motion: no velocity changes, and A and B stay as they are along it",
        )
    _print_matrices(least)
    _print_modes(found)
    verdict = {
        "unstable": "unstable: a small deviation grows",
        "stable": "stable: every small deviation dies out",
        "marginal": "marginal: to first order some small deviation neither dies out nor grows fast",
    }
    print(f"stability   {verdict[whole.stability]}")
    if least.input_names:
        rank, n = whole.controllable_rank, len(least.A)
        print(f"control     rank {rank} of {n}: {'' if rank == n else 'not '}controllable")
    if given.output is not None:
        save(whole, model.name, given.output, force=given.force)
        print(f"wrote {given.output}")
    return 0


def _print_place(
    module: GeneratedModule, whole: Linearisation, at: str, trimmed: Sequence[str]
) -> None:
    nq = len(module.POSITIONS)
    kind = {
        "equilibrium": "an equilibrium",
        "rest": "where it comes to rest",
        "initial": "the state given",
    }
    print(f"{module.NAME}: linearised about {kind[at]}")
    velocities = range(nq, 2 * nq - len(module.QUATERNIONS))
    values = []
    for i, (name, value) in enumerate(zip(whole.state_names, whole.y.tolist(), strict=True)):
        if at != "initial" and i in velocities:
            continue
        value = value if abs(value) > STILL else 0.0
        unit = module.UNITS[name]
        after = f" ({_number(math.degrees(value))} deg)" if unit == "rad" and value else ""
        if i >= velocities.stop and unit:  # of a controller: what it is in, no name tells
            after = f" {unit}"
        values.append(f"{name} = {_number(value)}{after}")
    print_listed("state       ", shortened(values, 80))
    inputs = []
    for name, value in zip(whole.input_names, whole.u.tolist(), strict=True):
        rounding = name in trimmed and abs(value) <= STILL
        inputs.append(f"{name} = {_number(0.0 if rounding else value)}")
    print_listed("inputs      ", inputs)
    changes = whole.rates[nq:]
    if at == "initial" and np.max(np.abs(changes), initial=0.0) > STILL:
        worst = int(np.argmax(np.abs(changes)))
        name = whole.state_names[nq + worst]
        print_wrapped(
            "note        ",
            f"no equilibrium: {name} changes by {_number(changes[worst])} "
            f"{rate_unit(module.UNITS[name])}; A and B are for "
            "deviations from this motion, at this instant",
        )


def _print_stopped(model: Model, start: FloatArray) -> None:
    """Say which velocities of the state given an equilibrium does not have."""
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


def _print_matrices(least: Linearisation) -> None:
    n, names = len(least.A), least.state_names
    if n > WIDEST:
        shape = f"A is {n} x {n}" + (f", B {n} x {least.B.shape[1]}" if least.B.size else "")
        print(f"matrices    {shape}; -o FILE.npz or -o FILE.csv writes them")
        return
    _print_matrix("A", least.A, names, names)
    if least.B.size:
        _print_matrix("B", least.B, names, least.input_names)


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
    """A line for each mode; modes that read the same are counted."""
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
    """An eigenvalue or a pair as a number, and what it means."""
    if mode.angular_frequency:
        value = f"{_number(mode.rate)} ± {_number(mode.angular_frequency)}i"
        return value, f"{mode.frequency:.4g} Hz, damping {_number(mode.damping)}"
    if mode.rate:
        time = math.log(2) / abs(mode.rate)
        return _number(mode.rate), f"{'doubles' if mode.rate > 0 else 'halves'} in {time:.4g} s"
    return "0", "stays, or drifts"


def _number(x: float) -> str:
    return f"{x + 0.0:.6g}"
