"""What `check --assemble` prints: the start that assembly found."""

from pathlib import Path

import numpy as np

from eomgen.commands.shared import print_listed, print_wrapped
from eomgen.dynamics.start.constraint_equations import ConstraintEquations
from eomgen.model.model import Model


def print_assembly(model: Model) -> None:
    """Print the assembled coordinates and velocities, which were given and which found; how far the
    constraints are from being met; which rows follow from others; and the branch.
    """
    if not model.constraints:
        print("assembly    no loops and no constraints: nothing is assembled")
        return
    equations, q = ConstraintEquations.of(model), np.array(model.initial_q)
    for label, known, values in (
        ("start       ", model.coordinates, model.initial_q),
        ("velocities  ", model.velocities, model.initial_v),
    ):
        for held, word in ((True, "given"), (False, "found")):
            found = [
                f"{c.name} = {value:.9g} {c.unit}".rstrip()
                for c, value in zip(known, values, strict=True)
                if (c.name in model.held) == held
            ]
            if found:
                print_listed(f"{label}{word}: ", found)
    off = np.abs(equations.residuals(q))
    worst = int(off.argmax())
    name, unit = model.rows[worst]
    size, length = (equations.size, "m") if unit == "N" else (1.0, "rad")
    print_wrapped("residual    ", f"at most {off[worst] * size:.2g} {length}, of {name}")
    names = [c.name for c in model.velocities]
    dependent = [names[column] for _, column in model.pivots]
    independent = [name for name in names if name not in dependent]
    print_listed("independent ", independent)
    print_listed("dependent   ", dependent)
    print_listed("dropped     ", list(model.dropped))
    rows, columns = (list(part) for part in zip(*sorted(model.pivots), strict=True))
    order = sorted(columns)
    determinant = np.linalg.det(equations.jacobian(q)[np.ix_(sorted(rows), order)])
    sign = "+" if determinant > 0 else "-"
    print_wrapped(
        "branch      ",
        f"{sign}, the sign of the determinant of the dependent velocities in the constraints; "
        "other start values, initial.guess, may lead to another",
    )


def draw_assembly(scene: str, target: Path, *, force: bool) -> None:
    """Draw a scene at its assembled start."""
    from eomgen.api.simulating import simulate
    from eomgen.show.style import check_figure, write_figure

    check_figure(target, force=force)
    run = simulate(scene, t_end=1e-3, samples=2, backend="numpy")
    write_figure(run.plot(strobe=[0.0]), target, force=force)
    print(f"    wrote {target}")
