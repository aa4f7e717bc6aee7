"""The part of the command `accuracy` on rounding errors, which needs no runs."""

from math import isfinite
from typing import TYPE_CHECKING

import numpy as np

from eomgen.api.accuracy import arithmetic_of
from eomgen.api.options import ArithmeticOptions
from eomgen.base.files import check_folder, check_writable
from eomgen.commands.shared import Arguments, assignments, print_wrapped, reporter_of
from eomgen.commands.usage import taken
from eomgen.model.model import Model
from eomgen.scene.schema import Simulation

if TYPE_CHECKING:
    from eomgen.study.cost.arithmetic import Arithmetic, Solver

HEADS = {
    "float64": "float64",
    "float32": "float32, in its own ulp, 2^29 of those above; at states rounded to float32",
}


def check_files(given: Arguments, name: str) -> None:
    """Raise `RunError` for invalid options, or files that cannot be written."""
    from eomgen.show.style import check_figure

    taken(ArithmeticOptions, given, source=given.scene)
    check_folder(given.output)
    check_figure(given.output / f"{name}_arithmetic.png", force=given.force)
    check_writable(given.output / f"{name}_arithmetic.csv", force=given.force)


def print_arithmetic(given: Arguments, model: Model, simulation: Simulation, name: str) -> None:
    """Measure, print and draw the rounding errors of each route."""
    # Imported here: it imports Matplotlib.
    from eomgen.show.arithmetic import save_figure, save_table

    check_files(given, name)
    model = model.with_parameters(assignments(given.parameters, model.defaults, "--set"))
    found = arithmetic_of(
        model,
        simulation,
        taken(ArithmeticOptions, given, source=given.scene),
        name=name,
        reporter=reporter_of(given, given.scene),
    )
    print(
        f"{name}: error of v̇ in units in the last place (ulp), by each route; chosen: {found.taken}"
    )
    for precision in dict.fromkeys(solver.precision for solver in found.solvers):
        _print_solvers(found, precision)
    _print_notes(found, model)
    figure, table = (given.output / f"{name}_arithmetic.{suffix}" for suffix in ("png", "csv"))
    save_table(found, table, force=given.force)
    save_figure(found, figure, force=given.force)
    print(f"    wrote {table}, {figure.name}")


def _print_solvers(found: "Arithmetic", precision: str) -> None:
    kinds = "".join(f"{f'{len(s.y)} {s.kind}':>20}" for s in found.samples)
    print(f"    {HEADS[precision]}")
    print(f"    {'':<14}{'':>10}{'':>10}{'µs each':>12}{kinds}")
    heads = f"{'median':>10}{'worst':>10}" * len(found.samples)
    print(f"    {'':<14}{'operations':>10}{'µs':>10}{'of 1000':>12}{heads}")
    for solver in found.solvers:
        if solver.precision == precision:
            _print_solver(solver)


def _print_solver(solver: "Solver") -> None:
    if solver.operations is None:
        print_wrapped(f"    {solver.name:<14}", solver.words)
        return
    errors = "".join(f"{ulps(e.median):>10}{ulps(e.worst):>10}" for e in solver.errors)
    each, many = _us(solver.seconds, 1), _us(solver.batch_seconds, 3)
    print(f"    {solver.name:<14}{solver.operations:>10}{each:>10}{many:>12}{errors}")
    if solver.words:
        print_wrapped(f"    {'':<14}", solver.words)


def _print_notes(found: "Arithmetic", model: Model) -> None:
    conditions = "; ".join(
        f"{s.kind} median {np.median(s.condition):.2g}, worst {np.max(s.condition):.2g}"
        for s in found.samples
    )
    print_wrapped("    condition of the mass matrix, its diagonal scaled to 1: ", conditions)
    print_wrapped(
        "    ulp: ",
        "the spacing of doubles at the greatest acceleration with the same unit, or at 1/1000 of "
        "its median over the states if that is more; a correctly rounded result has an error of "
        "0.5. linalg.solve: M v̇ = F - V - G solved "
        "by NumPy; its operations are those of the terms and of the elimination",
    )
    parts = [f"60 digits, of which two routes agree in {found.agreed:.0f}; inputs 0"]
    for sample in found.samples:
        if sample.until is not None:
            parts.append(f"{sample.kind} to t = {sample.until:.4g} s")
        if sample.left_out:
            parts.append(f"{sample.left_out} {sample.kind} left out: no finite acceleration")
    if model.form != "velocity":
        parts.append(f"form '{model.form}' is evaluated as 'velocity'")
    if any(getattr(effect, "law", "") == "impact" for effect in model.effects):
        parts.append("all rigid contacts open")
    print_wrapped("    reference: ", "; ".join(parts))


def ulps(value: float) -> str:
    """An error as text: with one decimal if it is small, with an exponent if it is large."""
    if not isfinite(value):
        return "-" if value != value else "inf"
    return f"{value:.1f}" if value < 9.95 else f"{value:.0f}" if value < 9999.5 else f"{value:.1e}"


def _us(seconds: float | None, digits: int) -> str:
    return "-" if seconds is None else f"{1e6 * seconds:.{digits}f}"
