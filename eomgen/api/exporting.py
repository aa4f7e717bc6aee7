"""Programs for other tools: `export`."""

import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path

from eomgen.api.given import checked, modelled, read
from eomgen.api.options import ExportOptions
from eomgen.api.public import public
from eomgen.api.reporter import SILENT, Reporter
from eomgen.base.errors import RunError
from eomgen.base.files import check_writable, write_whole
from eomgen.base.options import taking
from eomgen.exports import Options, find_format
from eomgen.model.model import Model
from eomgen.scene.schema import Simulation


@public
@taking(ExportOptions)
def export(options: ExportOptions) -> tuple[Path, ...]:
    """Write a scene's equations in the format of another tool; return the paths of the files.

    Raises `SceneError` or `RunError` if the scene has something that the format cannot hold, or a
    file cannot be written; then none of them is written. Warns of what they lack, such as a
    binary that the compiler did not make.
    """
    scene = read(options.source)
    model = modelled(scene, form=options.form, route=options.route, outputs=options.outputs)
    remark = partial(warnings.warn, stacklevel=5)
    return exported(model, scene.simulation, options, remark=remark)


def exported(
    model: Model,
    simulation: Simulation,
    options: ExportOptions,
    *,
    name: str = "",
    reporter: Reporter = SILENT,
    remark: Callable[[str], None] = lambda _: None,
) -> tuple[Path, ...]:
    """As `export`, for a model. `name` replaces the scene's in the default path; `remark` is called
    with what the user should know.
    """
    format, force = options.format, options.force
    wanted = Options(options.number, options.integrator, simulation)
    found, exporter = find_format(format, wanted, reporter.argument)
    target = Path(options.path or f"{name or model.name}{found.suffix or f'_{format}'}")
    if found.suffix:
        check_writable(target, force=force)
    elif target.exists() and not target.is_dir():
        raise RunError(f"{target}: is a file; name a folder")
    checked(model, reporter)
    with reporter.located(), reporter.waiting(f"exporting {model.name} …"):
        written = exporter.files(model, wanted)
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
