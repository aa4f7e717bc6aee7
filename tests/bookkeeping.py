"""What effects do to the energy of a scene, and its Jacobian by differences, for tests."""

from dataclasses import replace
from functools import cache

import numpy as np
from engine import MP, STEP, Engine, along, exact, read

from eomgen.dynamics.dynamics import Dynamics, Values
from eomgen.model.elaborate import elaborate
from eomgen.pipeline import compile_program, python_module
from eomgen.run.module import load_module
from eomgen.scalars.floats import FloatScalars
from eomgen.scene.schema import Scene

ENERGIES = ("kinetic_energy", "potential_energy", "effect_powers")


@cache
def light(scene: str) -> Engine:
    """A scene by its name or text, compiled with `ENERGIES` alone: without the Jacobian that takes
    longest.
    """
    return compiled_light(read(scene))


def compiled_light(scene: Scene) -> Engine:
    """The same of a scene that has been read."""
    model = elaborate(scene.replaced(outputs=ENERGIES))
    plain = model.route == "auto" and model.form == "velocity"
    route = "aba" if plain else model.route  # without judging the others
    system = compile_program(replace(model, route=route), jacobian=False).system
    source = python_module(system)
    return Engine(model, system, source, load_module(source, model.name))


def growth(made: Engine, output: str, y: np.ndarray, t: float, **given: dict) -> np.ndarray:
    """How fast an output grows along the motion, in 60 digits; as time goes on, too."""
    rate = made.exactly("derivative", exact(y), t=t, **given)
    ends = (
        made.exactly(output, exact(y) + h * rate, t=MP.mpf(t) + h, **given) for h in (STEP, -STEP)
    )
    ahead, behind = ends
    return (ahead - behind) / (2 * STEP)


def powers(made: Engine, y: np.ndarray, t: float = 0.0) -> list[float]:
    """What each effect does to the motion, W."""
    nq = len(made.model.coordinates)
    values = Values(made.module.PARAMETERS, {}, [*y[:nq]], [*y[nq:]], {}, t)
    dynamics = Dynamics(made.model, values, FloatScalars())
    return [float(dynamics.power(effect)) for effect in made.model.effects]


def gained(made: Engine, output: str, y: np.ndarray, t: float = 0.0) -> float:
    """How fast an energy grows, W, in 60 digits along the motion that the module computes."""
    rate = made.module.derivative(t, y)
    return float(along(lambda at: made.exactly(output, at), exact(y), exact(rate)))


def differences(made: Engine, y: np.ndarray, t: float, h: float = 1e-6) -> np.ndarray:
    """The Jacobian by central differences of the module."""
    steps = h * np.eye(len(y))
    f = made.module.derivative
    return np.array([(f(t, y + e) - f(t, y - e)) / (2 * h) for e in steps]).T
