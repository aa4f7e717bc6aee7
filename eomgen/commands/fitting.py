"""The command `fit`."""

import math

from eomgen.api.fitting import fitted
from eomgen.api.options import FitOptions
from eomgen.api.states import state_names
from eomgen.base.errors import RunError
from eomgen.commands.shared import (
    Arguments,
    assignments,
    given_inputs,
    located,
    print_listed,
    print_wrapped,
    read_model,
    reporter_of,
)
from eomgen.commands.usage import taken
from eomgen.model.model import Model
from eomgen.results.fitted import Fit, rounded

MOST = 12
"""Correlations are printed for up to this number of values."""


def fit(given: Arguments) -> int:
    """Print the values, their intervals and correlations, and what the data do not tell."""
    model, _ = read_model(given.scene, given)
    with located(given.scene):
        state = assignments(given.state, state_names(model), "--state")
    own = {
        "parameters": assignments(given.parameters, model.defaults, "--set"),
        "state": state,
        "inputs": given_inputs(given.inputs, [i.name for i in model.inputs]),
        "noise": {name: _number(x, text) for text in given.noise for name, x in [_split(text)]},
        "bounds": dict(map(_pair, given.bounds)),
        "priors": dict(map(_pair, given.priors)),
    }
    options = taken(FitOptions, given, source=given.scene, **own)
    found = fitted(model, options, reporter_of(given, given.scene))
    samples = sum(
        int(x.size - sum(map(math.isnan, x))) for xs in found.residuals.values() for x in xs
    )
    print(f"{found.name}: fitted to {samples} samples, with {found.motions} motions")
    _print_values(found, model)
    _print_correlations(found)
    print_listed(
        "noise       ",
        [f"{name} {deviation:.3g}" for name, deviation in found.noise.items()],
    )
    print(f"rank        {found.rank} of {len(found.values)}")
    for note in found.notes:
        print_wrapped("note        ", note)
    return 0


def _print_values(found: Fit, model: Model) -> None:
    units = {p.name: p.unit for p in model.parameters}
    units |= {c.name: c.unit for c in (*model.coordinates, *model.velocities)}
    width = max(map(len, found.values))
    for name, value in found.values.items():
        text = rounded(value, found.intervals[name][1] - value)
        print(f"    {name:<{width}}  {text} {units.get(name.partition('[')[0], '')}".rstrip())


def _print_correlations(found: Fit) -> None:
    names = list(found.values)
    if not 1 < len(names) <= MOST:
        return
    width = max(6, *map(len, names))
    print("correlations")
    print("    ".join(["", " " * width, *(f"{name:>{width}}" for name in names)]))
    for name, row in zip(names, found.correlation.tolist(), strict=True):
        cells = (f"{x:{width}.3f}" if math.isfinite(x) else "-".rjust(width) for x in row)
        print("    ".join(["", f"{name:<{width}}", *cells]))


def _split(text: str) -> tuple[str, str]:
    name, sign, value = text.partition("=")
    if not sign:
        raise RunError(f"{text}: gives no value; write NAME=X")
    return name.strip(), value


def _number(value: str, text: str) -> float:
    try:
        return float(value)
    except ValueError:
        raise RunError(f"{text}: '{value}' is not a number; write NAME=1.5") from None


def _pair(text: str) -> tuple[str, tuple[float, float]]:
    """The name and the two numbers of NAME=A:B; an end of bounds may be left out."""
    name, value = _split(text)
    first, sign, second = value.partition(":")
    if not sign:
        raise RunError(f"{text}: gives one number; write two, {name}=0.1:2")
    low = _number(first, text) if first.strip() else -math.inf
    return name, (low, _number(second, text) if second.strip() else math.inf)
