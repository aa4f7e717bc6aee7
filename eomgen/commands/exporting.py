"""The command `export`."""

from eomgen.api.exporting import exported
from eomgen.commands.shared import Arguments, note, read_whole, reporter_of
from eomgen.exports import Number, Options


def export(given: Arguments) -> int:
    """Write a scene's equations in the format of another tool."""
    scene, model, name = read_whole(given.scene, given)
    number: Number = "float" if given.float else "double"
    paths = exported(
        model,
        given.format,
        given.output,
        Options(number=number, integrator=given.integrator, simulation=scene.simulation),
        name=name,
        force=given.force,
        reporter=reporter_of(given, given.scene),
        remark=lambda text: note(given, text),
    )
    for path in paths:
        print(f"wrote {path}")
    return 0
