"""Programs for other tools: `export`."""

import warnings
from collections.abc import Callable
from functools import partial
from os import PathLike
from pathlib import Path

from eomgen.api.given import Outputs, Source, checked, modelled, read
from eomgen.api.public import public
from eomgen.api.reporter import SILENT, Reporter
from eomgen.base.errors import RunError
from eomgen.base.files import check_writable, write_whole
from eomgen.exports import Number, Options, find_format
from eomgen.model.model import Model
from eomgen.scene.schema import Form, Route


@public
def export(
    source: Source,
    format: str,
    path: str | PathLike[str] | None = None,
    *,
    form: Form | None = None,
    route: Route | None = None,
    outputs: Outputs | None = None,
    number: Number = "double",
    integrator: str = "",
    force: bool = False,
) -> tuple[Path, ...]:
    """Write a scene's equations in the format of another tool; return the paths of the files.

    format   a name in `exports.FORMATS`
    path     the file, or the folder of a format of several files; None: the scene's name, in the
             current folder
    form     state form; None: the scene's own
    route    to the equations; None: the scene's own
    outputs  functions beside those that the format needs; None: the scene's own
    number   type of numbers in C, "double" or "float", where the format has a choice
    integrator  method of steps, of those that compiled code has; "" for the format's own
    force    also overwrite files that this program did not write

    Raises `SceneError` or `RunError` if the scene has something that the format cannot hold, or a
    file cannot be written; then none of them is written. Warns of what they lack, such as a
    binary that the compiler did not make.
    """
    scene = read(source)
    model = modelled(scene, form=form, route=route, outputs=outputs)
    target = None if path is None else Path(path)
    options = Options(number=number, integrator=integrator, simulation=scene.simulation)
    remark = partial(warnings.warn, stacklevel=3)
    return exported(model, format, target, options, force=force, remark=remark)


def exported(
    model: Model,
    format: str,
    path: Path | None,
    options: Options,
    *,
    name: str = "",
    force: bool = False,
    reporter: Reporter = SILENT,
    remark: Callable[[str], None] = lambda _: None,
) -> tuple[Path, ...]:
    """As `export`, for a model. `name` replaces the scene's in the default path; `remark` is called
    with what the user should know.
    """
    found, exporter = find_format(format, options, reporter.argument)
    target = path or Path(f"{name or model.name}{found.suffix or f'_{format}'}")
    if found.suffix:
        check_writable(target, force=force)
    elif target.exists() and not target.is_dir():
        raise RunError(f"{target}: is a file; name a folder")
    checked(model, reporter)
    with reporter.located(), reporter.waiting(f"exporting {model.name} …"):
        written = exporter.files(model, options)
    for text in written.remarks:
        remark(text)
    contents = {
        target if found.suffix else target / file: data for file, data in written.files.items()
    }
    for place in contents:
        check_writable(place, force=force)
    for place, data in contents.items():
        write_whole(place, data, force=force)
    return tuple(contents)
