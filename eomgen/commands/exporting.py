"""The command `export`."""

from eomgen.api.exporting import exported
from eomgen.commands.shared import Arguments, note, read_model, reporter_of
from eomgen.exports import Options


def export(given: Arguments) -> int:
    """Write a scene's equations in the format of another tool."""
    model, name = read_model(given.scene, given)
    paths = exported(
        model,
        given.format,
        given.output,
        Options(number="float" if given.float else "double"),
        name=name,
        force=given.force,
        reporter=reporter_of(given, given.scene),
        remark=lambda text: note(given, text),
    )
    for path in paths:
        print(f"wrote {path}")
    return 0
