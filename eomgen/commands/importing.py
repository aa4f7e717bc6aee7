"""The command `import`."""

from pathlib import Path

from eomgen.api.importing import import_robot
from eomgen.base.errors import RunError
from eomgen.base.files import write_whole
from eomgen.commands.shared import Arguments, note
from eomgen.scene.reader import LARGEST_FILE, imported_scene, parse_scene

WISHES = ("floating", "stops", "contacts", "self_contacts")


def import_(given: Arguments) -> int:
    """Write a robot file as a scene."""
    source = Path(given.robot)
    wishes = {key: getattr(given, key) for key in WISHES}
    found = import_robot(source, **wishes, allow=given.allow)
    path: Path = given.output or Path(f"{imported_scene(found, source.name).name}.toml")
    if path.exists() and not given.force:
        raise RunError(f"{path}: exists; choose another name with -o, or give --force")
    text = found.toml()
    if len(text) > LARGEST_FILE:
        raise RunError(f"{path}: the scene is larger than {LARGEST_FILE} characters")
    parse_scene(text, path.name)
    for remark in found.remarks:
        note(given, f"{source.name}: {remark}")
    write_whole(path, text, force=given.force)
    print(f"wrote {path}")
    print(f"    eomgen check {path} shows what it is made of")
    return 0
