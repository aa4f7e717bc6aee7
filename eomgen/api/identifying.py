"""What can be known of a mechanism: base parameters, and the parameters that sensors tell."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eomgen.api.generating import compiled
from eomgen.api.reporter import SILENT, Reporter
from eomgen.base.errors import RunError
from eomgen.fitting.columns import sorted_columns
from eomgen.fitting.estimate import determined, told
from eomgen.fitting.logs import Log
from eomgen.fitting.motion import Motion, Samples
from eomgen.model.clocks import check_no_samples
from eomgen.model.model import Model
from eomgen.study.diagnosis import problem_of

TOGETHER = 8
"""The parameters whose sensitivities are computed together: with more, code is long to compile."""
SAMPLES, LONGEST = 201, 10.0
"""How often sensors are looked at along the motion of a scene, and up to which time, s."""
RTOL = 1e-10


@dataclass(frozen=True)
class Told:
    """What sensors tell of the parameters of a scene along its own motion.

    parameters  their names
    rank        how many of their combinations are told
    lines       a line for each combination that is not
    """

    parameters: tuple[str, ...]
    rank: int
    lines: tuple[str, ...]


def told_by(
    model: Model, sensors: Sequence[str], t_end: float, reporter: Reporter = SILENT
) -> Told:
    """What sensors, which are states and outputs by name, tell of a model's parameters: of all of
    them at once, by their sensitivities along the motion of the scene up to `t_end`, s.

    Raises `RunError` for an unknown sensor, or a motion that has no sensitivities.
    """
    argument = reporter.argument("identifiable")
    if model.constraints:
        raise RunError(f"{argument}: takes trees of bodies; this scene has loops or constraints")
    check_no_samples(model, "sensitivities")
    model = replace(model, form="velocity", outputs=())
    times = np.linspace(0.0, min(t_end, LONGEST), SAMPLES)
    states = (c.name for c in (*model.coordinates, *model.velocities))
    log = Log(argument, times, {name: np.zeros(SAMPLES) for name in (*sensors, *states)})
    columns, model = sorted_columns(model, [log], sensors, argument)
    _, module = compiled(model, reporter=reporter)
    if getattr(module, "CONTACTS", ()):
        raise RunError(f"{argument}: rigid contacts strike, where sensitivities jump")
    problem = problem_of(module, model=model)
    p = np.array([*module.PARAMETERS.values()])
    names, slopes = tuple(module.PARAMETERS), []
    samples = Samples(times, np.array([[*module.INPUTS.values()]], dtype=float))
    scales = np.where(p != 0.0, np.abs(p), 1.0)
    sizes = np.array(problem.sizes)
    with reporter.waiting(f"sensitivities of {model.name} …"):
        for first in range(0, len(names), TOGETHER):
            some = slice(first, first + TOGETHER)
            motion = Motion(model, names[some], columns.entries, (), rtol=RTOL, backend="numpy")
            whole = np.concatenate((sizes, np.outer(1.0 / scales[some], sizes).ravel()))
            rows = motion.rows(p, motion.start(p, {}), whole, samples)
            slopes.append(columns.taken(rows)[1])
    table = np.concatenate(slopes, axis=1).swapaxes(1, 2)
    table = table / np.maximum(np.abs(table).max(axis=(0, 2), initial=0.0), 1e-300)[:, None]
    if not np.isfinite(table).all():
        raise RunError(f"{argument}: the motion of {model.name} does not reach {times[-1]:g} s")
    rank, unknown = determined(table.reshape(-1, len(names)), p)
    return Told(names, rank, tuple(told(direction, names) for direction in unknown))
