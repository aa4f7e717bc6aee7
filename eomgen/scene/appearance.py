"""What a picture needs of a scene and no equation does: the shapes of bodies, and the camera."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from eomgen.errors import check_known
from eomgen.scene.chains import written_out
from eomgen.scene.look import Camera, Shape, check_look
from eomgen.scene.schema import Scene


@dataclass(frozen=True)
class Appearance:
    """The shapes of each body, by its name, in body axes; a body may have none."""

    camera: Camera = field(default_factory=Camera)
    shapes: Mapping[str, tuple[Shape, ...]] = field(default_factory=dict)


def appearance_of(scene: Scene) -> Appearance:
    """The looks of a scene, those of its chains among them.

    Raises `SceneError` for shapes and a camera that are not of this space, and for a body that the
    camera is to follow and that is not there.
    """
    bodies, _ = written_out(scene)
    for body, location in bodies:
        check_look(body.shapes, None, scene.dimensions, location)
    shapes = {body.name: body.shapes for body, _ in bodies}
    check_look((), scene.camera, scene.dimensions, "camera")
    if scene.camera.follow is not None:
        check_known(scene.camera.follow, "camera.follow", shapes, "body")
    return Appearance(scene.camera, shapes)
