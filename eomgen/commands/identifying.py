"""What `check --identifiable` prints."""

from collections.abc import Sequence

from eomgen.api.reporter import Reporter
from eomgen.commands.shared import print_listed, print_wrapped
from eomgen.model.model import Model


def print_identifiable(
    model: Model, sensors: Sequence[str], t_end: float, reporter: Reporter
) -> None:
    """Print the base parameters of a tree; with sensors, what they tell of its parameters."""
    # Imported here because most checks need neither.
    from eomgen.api.identifying import told_by
    from eomgen.fitting.base_parameters import base_parameters

    found = base_parameters(model)
    how = "exactly" if found.exact else "with 60 digits"
    print_wrapped(
        "base        ",
        f"{found.rank} of {len(found.every)} inertial parameters, known {how}, of bodies about "
        "their joints: mass m, first moment mx, inertia Ixx and so on",
    )
    for name, group in found.groups.items():
        terms = (f"{_factor(x)}{other}" for other, x in group)
        print_wrapped("            ", " ".join((str(name), *terms)))
    print_listed("no effect   ", list(map(str, found.none)))
    if sensors:
        told = told_by(model, sensors, t_end, reporter)
        print(
            f"told        {told.rank} of {len(told.parameters)} parameters by {', '.join(sensors)}"
        )
        for line in told.lines:
            print_wrapped("            ", line)


def _factor(x: float) -> str:
    """A factor before what it multiplies, with its sign."""
    sign = "-" if x < 0 else "+"
    return f"{sign} " if abs(x) == 1.0 else f"{sign} {abs(x):.6g} "
