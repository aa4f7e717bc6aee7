"""Runs of mechanisms with loops in compiled code, and what they conserve."""

from dataclasses import dataclass, replace

import numpy as np

from eomgen.dynamics.assembly import assembled
from eomgen.model.elaborate import elaborate
from eomgen.native.accelerator import Accelerator
from eomgen.run.integrate import integrate
from eomgen.run.module import as_problem, load_module
from eomgen.scene.reader import parse_scene
from eomgen.store import generated_code

OUTPUTS = ("kinetic_energy", "potential_energy", "mass_matrix", "kinetic_slopes")


@dataclass(frozen=True)
class Conserved:
    """What a run conserved.

    residual  the largest residual of the constraints at the end of any step, m
    band      the width of the band of energies over the whole run, J
    early     that over its first tenth
    trend     the change of energy over the run by a straight line through its rows, J
    """

    residual: float
    band: float
    early: float
    trend: float


def conserved(text: str, integrator: str, dt: float, steps: int, rows: int = 100_000) -> Conserved:
    """The run of a scene, which must have constraints, in compiled code from the first step on."""
    model = assembled(elaborate(parse_scene(text)))
    model = replace(model, outputs=OUTPUTS)
    module = load_module(generated_code(model).module, model.name)
    problem = as_problem(module)
    assert problem.projection is not None, "the state of this scene needs no projection"
    accelerator = Accelerator(model, module, None, None)
    accelerator.compile()
    run = integrate(accelerator.of(problem), integrator, dt * steps, dt=dt, samples=rows)
    assert run.finished and accelerator.used, run.message
    y = run.y.T
    energy = np.asarray(module.kinetic_energy(0.0, y) + module.potential_energy(0.0, y))
    slope = np.polynomial.Polynomial.fit(run.t, energy, 1).convert().coef[1]
    early = energy[: len(energy) // 10]
    return Conserved(
        max(after for _, after in run.violations.values()),
        float(np.ptp(energy)),
        float(np.ptp(early)),
        float(slope * run.t[-1]),
    )
