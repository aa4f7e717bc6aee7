"""What pictures need of a scene: the shapes of bodies and the camera. No equation uses it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from eomgen.base.errors import SceneError, check_known
from eomgen.scene.chains import written_out
from eomgen.scene.look import Camera, Shape, check_look
from eomgen.scene.schema import Scene

MOST_SHAPES = 2000
"""Greatest number of shapes, with which figure and page take 0.6 GB."""


@dataclass(frozen=True)
class Appearance:
    """The camera, and the shapes of each body by its name, in body axes."""

    camera: Camera = field(default_factory=Camera)
    shapes: Mapping[str, tuple[Shape, ...]] = field(default_factory=dict)


def appearance_of(scene: Scene) -> Appearance:
    """The appearance of a scene, including its chains; its definitions have been expanded.

    Raises `SceneError` for shapes or a camera of the wrong number of dimensions, for a formula with
    an unknown name or with a value that a shape cannot have at the scene's parameters, and if the
    camera follows an unknown body.
    """
    bodies, _ = written_out(scene)
    count = sum(len(body.shapes) for body, _ in bodies)
    if count > MOST_SHAPES:
        raise SceneError(f"shapes: the bodies have {count} in all; pictures draw {MOST_SHAPES}")
    known = {
        name: float(entry if isinstance(entry, float | int) else entry.value)
        for name, entry in scene.parameters.items()
    }
    for body, location in bodies:
        check_look(body.shapes, None, scene.dimensions, location, known)
    shapes = {body.name: body.shapes for body, _ in bodies}
    check_look((), scene.camera, scene.dimensions, "camera")
    if scene.camera.follow is not None:
        check_known(scene.camera.follow, "camera.follow", shapes, "body")
    return Appearance(scene.camera, shapes)
