"""The whole way from a scene to generated code; each line of `generate` is one stage."""

from dataclasses import dataclass

from eomgen.backends.javascript import javascript_poses
from eomgen.backends.python import python_module
from eomgen.derivation.closed import derive
from eomgen.model import Model, build_model
from eomgen.program.assemble import assemble
from eomgen.program.passes import PassReport
from eomgen.scene.schema import Scene


@dataclass(frozen=True)
class Generated:
    """What a model is compiled to: a Python module, the page's `bodyPoses`, what passes saved."""

    module: str
    poses: str
    reports: tuple[PassReport, ...]


def generate(model: Model) -> Generated:
    """Derive a model's equations and write them as code. Same model, same bytes."""
    equations = derive(model)
    system = assemble(equations)
    return Generated(python_module(system), javascript_poses(system), system.reports)


def compile_model(model: Model) -> str:
    """The source of a model's module."""
    return generate(model).module


def compile_scene(scene: Scene) -> str:
    """The source of a scene's module. Raises `SceneError` if the scene makes no mechanism."""
    return compile_model(build_model(scene))
