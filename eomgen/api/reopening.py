"""A run from the file in which it was saved."""

import math
from os import PathLike
from pathlib import Path

from eomgen.api.generating import module_of
from eomgen.api.runs import Run
from eomgen.base.errors import RunError
from eomgen.run.trajectory import load_npz
from eomgen.scene.appearance import appearance_of


def load_run(path: str | PathLike[str]) -> Run:
    """The run that was saved as `path`: the archive .npz, or the table .csv beside which it is.

    Its outputs, figures and films are those of the run: the archive holds the scene, parameters and
    inputs. How the run was made is not kept: `options` is empty, `error` is nan.

    Raises `RunError` if the file is missing, damaged, or holds no scene.
    """
    from eomgen.show.observe import observe
    from eomgen.study.observed import observed

    archive = Path(path)
    if archive.suffix.lower() == ".csv":
        archive = archive.with_suffix(".npz")
        if not archive.exists():
            raise RunError(
                f"{path}: the scene of a run is in its archive, {archive}, which is not there"
            )
    trajectory = load_npz(archive)
    run = observed(trajectory)
    model = run.model.with_parameters(run.setup.parameters)
    pushing = run.setup.inputs
    if run.setup.varying is not None:  # what varies is not 0
        pushing = dict.fromkeys(run.functions.INPUTS, 1.0)
    return Run(
        model,
        module_of(run.code, model),
        trajectory,
        motion=observe(model, run.functions, trajectory, appearance_of(run.scene), pushing),
        options="",
        error=math.nan,
        warnings=tuple(model.notices),
        simulation=run.scene.simulation,
        inputs=run.setup.inputs,
        varying=run.setup.varying is not None,
    )
