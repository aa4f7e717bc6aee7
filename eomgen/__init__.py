"""Generates equations of motion: from a scene to a NumPy module of straight-line arithmetic.

It exports the functions of `eomgen.api` and the types that they return. Each is imported on first
access, so that unused ones cost no start-up time.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from eomgen.base.version import __version__ as __version__

if TYPE_CHECKING:
    from eomgen.api.accuracy import accuracy, arithmetic
    from eomgen.api.certifying import certify
    from eomgen.api.controllers import Controller
    from eomgen.api.derivation import Derivation
    from eomgen.api.deriving import derive
    from eomgen.api.effects import effects
    from eomgen.api.environments import environment
    from eomgen.api.exhibiting import gallery
    from eomgen.api.exporting import export
    from eomgen.api.fitting import fit
    from eomgen.api.generating import generate, load
    from eomgen.api.given import check, read
    from eomgen.api.importing import import_robot
    from eomgen.api.linearising import linearise
    from eomgen.api.reaching import kinematics
    from eomgen.api.reopening import load_run
    from eomgen.api.runs import Run
    from eomgen.api.simulating import simulate
    from eomgen.api.stepping import Stepper, stepper
    from eomgen.api.sweeping import Ensemble, ensemble, grid, sampled
    from eomgen.api.symbolic import casadi_functions
    from eomgen.api.systems import nonlinear_system, state_space
    from eomgen.api.verifying import horizon, verify
    from eomgen.base.errors import EomgenError, RunError, SceneError
    from eomgen.results.enclosed import Enclosure
    from eomgen.results.fitted import Fit
    from eomgen.results.module import Module
    from eomgen.scene.built_in import built_in_names
    from eomgen.scene.schema import Scene

__all__ = [
    "Controller",
    "Derivation",
    "Enclosure",
    "Ensemble",
    "EomgenError",
    "Fit",
    "Module",
    "Run",
    "RunError",
    "Scene",
    "SceneError",
    "Stepper",
    "accuracy",
    "arithmetic",
    "built_in_names",
    "casadi_functions",
    "certify",
    "check",
    "derive",
    "effects",
    "ensemble",
    "environment",
    "export",
    "fit",
    "gallery",
    "generate",
    "grid",
    "horizon",
    "import_robot",
    "kinematics",
    "linearise",
    "load",
    "load_run",
    "nonlinear_system",
    "read",
    "sampled",
    "simulate",
    "state_space",
    "stepper",
    "verify",
]

_PLACES = {
    **dict.fromkeys(("check", "read"), "api.given"),
    **dict.fromkeys(("generate", "load"), "api.generating"),
    "certify": "api.certifying",
    "Enclosure": "results.enclosed",
    "Derivation": "api.derivation",
    "Controller": "api.controllers",
    "derive": "api.deriving",
    "environment": "api.environments",
    "export": "api.exporting",
    "fit": "api.fitting",
    "Fit": "results.fitted",
    "gallery": "api.exhibiting",
    "import_robot": "api.importing",
    "kinematics": "api.reaching",
    "linearise": "api.linearising",
    "load_run": "api.reopening",
    "simulate": "api.simulating",
    **dict.fromkeys(("Stepper", "stepper"), "api.stepping"),
    **dict.fromkeys(("nonlinear_system", "state_space"), "api.systems"),
    **dict.fromkeys(("Ensemble", "ensemble", "grid", "sampled"), "api.sweeping"),
    "casadi_functions": "api.symbolic",
    **dict.fromkeys(("horizon", "verify"), "api.verifying"),
    **dict.fromkeys(("accuracy", "arithmetic"), "api.accuracy"),
    "effects": "api.effects",
    "Module": "results.module",
    "Run": "api.runs",
    **dict.fromkeys(("EomgenError", "RunError", "SceneError"), "base.errors"),
    "Scene": "api.given",
    "built_in_names": "scene.built_in",
}


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module 'eomgen' has no attribute '{name}'")
    return getattr(import_module(f"eomgen.{_PLACES[name]}"), name)


def __dir__() -> list[str]:
    return __all__
