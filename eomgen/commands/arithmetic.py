"""How exact the arithmetic of each route is: the half of `accuracy` that needs no run."""

from math import isfinite
from typing import TYPE_CHECKING

import numpy as np

from eomgen.api.accuracy import arithmetic_of, check_arithmetic
from eomgen.commands.shared import Arguments, assignments, manner_of, print_wrapped
from eomgen.files import check_folder, check_writable
from eomgen.model.model import Model
from eomgen.scene.schema import Simulation

if TYPE_CHECKING:
    from eomgen.study.cost.arithmetic import Arithmetic, Solver

HEADS = {
    "float64": "float64",
    "float32": "float32, ulp of its own, 2^29 of those above; at the states rounded to it",
}


def check_files(given: Arguments, name: str) -> None:
    """Raise `RunError` if this half cannot be done as asked, or not be written."""
    from eomgen.show.style import check_figure

    check_arithmetic(given.states, given.seed, manner_of(given, given.scene))
    check_folder(given.output)
    check_figure(given.output / f"{name}_arithmetic.png", force=given.force)
    check_writable(given.output / f"{name}_arithmetic.csv", force=given.force)


def print_arithmetic(given: Arguments, model: Model, wanted: Simulation, name: str) -> None:
    """Judge, print and draw the arithmetic of every route of a scene's model."""
    # Imported here: nothing else needs Matplotlib, or that many digits.
    from eomgen.show.arithmetic import save_figure, save_table

    check_files(given, name)
    model = model.with_parameters(assignments(given.set, model.defaults, "--set"))
    found = arithmetic_of(
        model,
        wanted,
        states=given.states,
        seed=given.seed,
        single=given.float32,
        name=name,
        manner=manner_of(given, given.scene),
    )
    print(
        f"{name}: error of v̇ in units in the last place (ulp), by every route; taken: {found.taken}"
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
        "of the greatest acceleration of the same unit, but of no less than 1/1000 of what that is "
        "at half of the states; correctly rounded is 0.5. linalg.solve: M v̇ = F - V - G by NumPy "
        "on the scene's own terms, their operations and those of elimination",
    )
    parts = [f"against 60 digits, in which two ways agree to {found.agreed:.0f}; inputs 0"]
    for sample in found.samples:
        if sample.until is not None:
            parts.append(f"{sample.kind} to t = {sample.until:.4g} s")
        if sample.left_out:
            parts.append(f"{sample.left_out} {sample.kind} left out, which have no acceleration")
    if model.form != "velocity":
        parts.append(f"form '{model.form}' is judged as 'velocity'")
    if any(getattr(effect, "law", "") == "impact" for effect in model.effects):
        parts.append("no rigid contact held")
    print_wrapped("    true: ", "; ".join(parts))


def ulps(value: float) -> str:
    """An error for a reader: a decimal if it is small, a power of ten if it is large."""
    if not isfinite(value):
        return "-" if value != value else "inf"
    return f"{value:.1f}" if value < 9.95 else f"{value:.0f}" if value < 9999.5 else f"{value:.1e}"


def _us(seconds: float | None, digits: int) -> str:
    return "-" if seconds is None else f"{1e6 * seconds:.{digits}f}"
