"""The command `export`."""

from eomgen.api.exporting import exported
from eomgen.api.options import ExportOptions
from eomgen.commands.shared import Arguments, note, read_whole, reporter_of
from eomgen.commands.usage import taken


def export(given: Arguments) -> int:
    """Write a scene's equations in the format of another tool."""
    scene, model, name = read_whole(given.scene, given)
    paths = exported(
        model,
        scene.simulation,
        taken(ExportOptions, given, source=scene, format=given.format),
        name=name,
        reporter=reporter_of(given, given.scene),
        remark=lambda text: note(given, text),
    )
    for path in paths:
        print(f"wrote {path}")
    return 0
