"""Does `--accuracy` hold? Scenes, targets, and the cheapest run that would have done.

    python -m tests.campaigns.choosing [--out FILE] [--most S] [SCENE …]

For each scene (all built-in ones) and each target: the true error of the run chosen, its estimate,
and its time beside that of the cheapest run of any method over a ladder of tolerances or steps
whose true error is below the target, found afterwards. Errors are those of the last state. Times
are of the processor, the least of three. What is done is kept in FILE and not done again.
"""

import argparse
import json
import math
from pathlib import Path
from typing import Any

from eomgen.build import build_model
from eomgen.pipeline import generate
from eomgen.run.integrators import INTEGRATORS
from eomgen.run.module import as_problem, load_module
from eomgen.run.problem import Floats
from eomgen.scene.reader import built_in_names, read_scene
from eomgen.study.choosing import Choice, meet
from eomgen.study.measure import error
from eomgen.study.trial import Case, Setting, Tried, method_of

TARGETS = (1e-3, 1e-6, 1e-9)
SLOWER = 1.1
"""Runs of the ladder that take so many times the chosen one's time are of no interest."""


def case_of(scene: str) -> Case:
    """A scene's own run, at its own parameters."""
    model = build_model(read_scene(scene))
    module = load_module(generated_code(model).module, model.name)
    kept = {"rest_speed": model.simulation.rest_speed, "samples": 1001}
    return Case(as_problem(module, model=model), model.simulation.t_end, module.UNITS, kept)
