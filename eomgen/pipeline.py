"""The whole way from a scene to a generated module; each line below is one stage."""

from eomgen.backends.python import python_module
from eomgen.derivation.closed import Equations, derive
from eomgen.model import Model, build_model
from eomgen.program.assemble import System, assemble
from eomgen.scene.schema import Scene

__all__ = ["Equations", "Model", "System", "assemble", "build_model", "compile_scene", "derive"]


def compile_scene(scene: Scene) -> str:
    """The source of a scene's module. Raises `SceneError` if the scene makes no mechanism."""
    return compile_model(build_model(scene))


def compile_model(model: Model) -> str:
    """The source of a model's module."""
    equations = derive(model)
    system = assemble(equations)
    return python_module(system)
