"""The whole way from a scene to generated code; each line of `generate` is one stage."""

from dataclasses import dataclass

from eomgen.codegen.backends.javascript import javascript_poses
from eomgen.codegen.backends.python import python_module
from eomgen.codegen.route import routed
from eomgen.dynamics.regular import check_regular
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.program.passes import PassReport
from eomgen.scene.schema import Scene


@dataclass(frozen=True)
class Generated:
    """What a model is compiled to: a Python module, the page's `bodyPoses`, what passes saved, why
    its route was taken, and what a user must be told of it.
    """

    module: str
    poses: str
    reports: tuple[PassReport, ...]
    explanation: tuple[str, ...]
    notices: tuple[str, ...]


def generate(model: Model, *, jacobian: bool = True) -> Generated:
    """Derive a model's equations and write them as code. Same model, same bytes.

    Without its `jacobian`, which takes longer than all else, a module is no whole one, but enough
    to count and to run by explicit methods.

    Raises `SceneError` if the mass matrix is singular or the route is not for the model.
    """
    check_regular(model)
    choice = routed(model, jacobian=jacobian)
    return Generated(
        python_module(choice.system),
        javascript_poses(choice.system) if "body_poses" in model.outputs else "",
        choice.system.reports,
        tuple(choice.explanation()),
        tuple(choice.notices()),
    )


def compile_model(model: Model) -> str:
    """The source of a model's module."""
    return generate(model).module


def compile_scene(scene: Scene) -> str:
    """The source of a scene's module. Raises `SceneError` if the scene makes no mechanism."""
    return compile_model(elaborate(scene))
