"""Output of `simulate` for `--accuracy`, `--budget`, `--estimate`, and on energy errors."""

import math
import sys
from typing import TYPE_CHECKING

from eomgen.api.runs import Run
from eomgen.commands.shared import Arguments

if TYPE_CHECKING:
    from eomgen.study.accuracy.estimate import Estimate
    from eomgen.study.accuracy.search import Choice

DRIFTED = 2e-3
"""Energy error that is warned of, relative to the greatest kinetic energy.

The relative error of speeds is half of it, which after a few swings is a different motion.
"""
BETTER = "take tighter tolerances or a shorter step, or let --accuracy 1e-3 choose"


def print_choice(choice: "Choice", given: Arguments) -> str:
    """Print what was chosen and its cost; return a message if the accuracy was not reached."""
    run = choice.tried
    if not run.trajectory.finished:
        return ""
    print(f"    chosen: {run.setting.options}")
    print(f"    error estimate {_error(choice.error)} at the end{_most(choice)}")
    print(
        f"    this run took {run.seconds:.2g} s, all {choice.runs} trial runs "
        f"{choice.seconds:.2g} s"
    )
    if not choice.met:
        from eomgen.study.accuracy.aimed import UNKNOWN

        why = choice.reason or UNKNOWN
        return (
            f"--accuracy {given.accuracy:g}: not reached; the best run's error estimate is "
            f"{choice.error:.1g}: {why}; take a shorter --t-end"
        )
    return ""


def print_estimate(found: "Estimate") -> None:
    """Print the estimated error of a run, and the second run that it is estimated from."""
    from eomgen.study.accuracy.measure import WRONG

    second = found.second
    if not math.isfinite(found.last):
        print(f"    no error estimate: {second.setting.options} {second.trajectory.message}")
        return
    print(
        f"    error estimate {_error(found.last)} at the end, at most {found.most:.1e} at "
        f"t = {found.at:.4g} s"
    )
    print(f"    from a second run, {second.setting.options}, which took {second.seconds:.2g} s")
    if found.most >= WRONG:
        _warn(
            f"by its error estimate this run has a relative error of {found.most:.1g} at "
            f"t = {found.at:.4g} s; {BETTER}"
        )


def warn_of_energy(run: Run) -> None:
    """Warn if the energy of a run is neither conserved nor explained by the works of effects."""
    found = run.imbalance
    if found is None or not found.lost > DRIFTED * found.size:
        return
    what = "works and kinetic energy balance in exact motion"
    if found.conserved:
        what = "exact motion conserves its energy"
    _warn(
        f"{what}, but this run is off by {found.lost:.2g} J, {found.lost / found.size:.1%} of the "
        f"greatest kinetic energy; {BETTER}"
    )


def _error(value: float) -> str:
    return f"{value:.1e}, relative," if math.isfinite(value) else "none: a single run"


def _most(choice: "Choice") -> str:
    """The estimated error before the end, if known."""
    if not math.isfinite(choice.most):
        return ""
    return f", at most {choice.most:.1e} before, at t = {choice.at:.4g} s"


def _warn(text: str) -> None:
    print(f"eomgen: warning: {text}", file=sys.stderr)
