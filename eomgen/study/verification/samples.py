"""Sample states, and the accelerations there in 60 digits."""

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from eomgen.base.errors import RunError
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import FloatArray
from eomgen.run.progress import Progress
from eomgen.scalars.extended import DIGITS
from eomgen.scene.schema import Simulation
from eomgen.study.verification.sampled import sampled
from eomgen.study.verification.states import random_state
from eomgen.study.verification.truth import Exact, Truth

SEEDED, OWN = "seeded", "scene's run"
CHECKED = 3
"""Number of states of each kind at which a second algorithm checks the 60 digits."""


@dataclass(frozen=True, eq=False)
class Sample:
    """States at which all routes are compared: times t (n,), y (n, ny).

    condition  (n,), of the mass matrix scaled to a diagonal of ones: about how much it amplifies a
               rounding error
    left_out   number of states without a finite acceleration in 60 digits
    until      end time, s, of the run that the states come from; None if they are random
    """

    kind: str
    t: FloatArray
    y: FloatArray
    condition: FloatArray = field(default_factory=lambda: np.empty(0))
    left_out: int = 0
    until: float | None = None


def judging_states(
    truth: Truth,
    wanted: Simulation,
    module: GeneratedModule,
    count: int,
    seed: int,
    progress: Progress,
) -> tuple[list[Sample], list[Exact]]:
    """`count` seeded states, about as many of the scene's run, which is made as `wanted`, and v̇
    in 60 digits at each. States without a finite v̇ are left out.

    Raises `RunError` if the scene cannot start, or if no state of a kind has a finite v̇.
    """
    rng, t_end = np.random.default_rng(seed), wanted.t_end
    y = np.array([random_state(module, rng) for _ in range(count)])
    seeded = Sample(SEEDED, rng.uniform(0.0, t_end, count), y)
    run = sampled(truth.model, wanted, module, count, lambda part: progress(0.3 * part))
    samples, truths = [], []
    for k, sample in enumerate((seeded, Sample(OWN, run.t, run.y, until=run.until))):
        true = truth(sample.t, sample.y)
        progress(0.3 + 0.35 * (k + 1))
        known = np.array([x is not None for x in true[0]])
        if not np.any(known):
            raise RunError(f"no finite acceleration in {DIGITS} digits at any {sample.kind} state")
        there = replace(sample, t=sample.t[known], y=sample.y[known], left_out=int(np.sum(~known)))
        samples.append(there)
        truths.append(true[:, known])
    return samples, truths


def agreement(truth: Truth, sample: Sample, true: Exact) -> float:
    """Digits to which articulated bodies and LᵀDL agree, relative to the greatest acceleration, at
    the first states and the state with the greatest acceleration.
    """
    sizes = np.max(np.abs(true), axis=0)
    worst = 0.0
    for k in {*range(min(CHECKED, len(sizes))), int(np.argmax(sizes))}:
        difference = np.max(np.abs(truth.factored(sample.t[k], sample.y[k]) - true[:, k]))
        if difference:
            worst = max(worst, float(difference / sizes[k]) if sizes[k] else 1.0)
    return -math.log10(worst) if worst else float(DIGITS)


def condition_numbers(module: Any, sample: Sample) -> FloatArray:
    """2-norm condition number (n,) of the mass matrix scaled to a diagonal of ones."""
    found = []
    for t, y in zip(sample.t, sample.y, strict=True):
        matrix = module.mass_matrix(t, y)
        scale = np.sqrt(np.abs(np.diag(matrix)))
        found.append(np.linalg.cond(matrix / np.outer(scale, scale)))
    return np.array(found)
