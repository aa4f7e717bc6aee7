"""An FMI 3.0 unit of a scene, for model exchange and co-simulation, with sources and a binary.

The specification: "Functional Mock-up Interface Specification", version 3.0, Modelica Association,
2022. What a unit does is in `templates/fmu`: its continuous states are those of the model, steps of
co-simulation are those of the engine, and rigid contacts follow the rules of `run.contacts`.
"""

import io
import platform
import sys
import zipfile
from collections.abc import Mapping

from eomgen.base.errors import RunError
from eomgen.exports import Options, Written
from eomgen.exports.fmu_description import description_files
from eomgen.exports.fmu_source import MAIN, sources_of
from eomgen.exports.fmu_unit import unit_of
from eomgen.exports.steps import method_of, model_for
from eomgen.model.model import Model
from eomgen.native.compiler import find_compiler, suffix
from eomgen.scene.schema import Simulation
from eomgen.store import interfaced_program_of

SYSTEMS = {"linux": "linux", "darwin": "darwin", "win32": "windows"}
PROCESSORS = {"x86_64": "x86_64", "amd64": "x86_64", "aarch64": "aarch64", "arm64": "aarch64"}
FLAGS = ("-O2", "-fvisibility=hidden")
METHOD = "DOP853"
"""The method of steps of co-simulation, if no other one is wanted."""
DATE = (1980, 1, 1, 0, 0, 0)
"""The date of all files in the archive: the same scene gives the same bytes."""


def files(model: Model, options: Options) -> Written:
    """The unit, an archive; without a compiler it has sources alone.

    Raises `SceneError` for another state form than [q, v], `RunError` if there is no derivative at
    the initial state.
    """
    name = options.integrator or METHOD
    model = model_for(name, model)
    method = method_of(name, model, interfaced_program_of(model)[1], adaptive=True)
    unit = unit_of(model, options.simulation or Simulation(), method.needed)
    sources, token = sources_of(unit, method)
    binary, remark = _binary(model.name, sources)
    content: dict[str, str | bytes] = {
        **description_files(unit, token, MAIN),
        **{f"sources/{name}": text for name, text in sources.items()},
        **binary,
    }
    return Written({f"{model.name}.fmu": archive(content)}, (remark,) if remark else ())


def _binary(name: str, sources: Mapping[str, str]) -> tuple[dict[str, bytes], str]:
    """The library for this machine by its path in the unit, and why there is none, or ""."""
    system = SYSTEMS.get(sys.platform)
    processor = PROCESSORS.get(platform.machine().lower())
    if system is None or processor is None:
        return {}, "the unit has sources alone: FMI has no name for this platform"
    try:
        library = find_compiler().shared_library(sources, MAIN, *FLAGS)
    except RunError as error:
        return {}, f"the unit has sources alone: {error}"
    return {f"binaries/{processor}-{system}/{name}{suffix()}": library}, ""


def archive(content: Mapping[str, str | bytes]) -> bytes:
    """A ZIP archive of these files. The first is not compressed, so that its text shows that this
    program wrote it.
    """
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as made:
        for i, (name, data) in enumerate(content.items()):
            entry = zipfile.ZipInfo(name, DATE)
            entry.create_system, entry.external_attr = 3, 0o644 << 16
            entry.compress_type = zipfile.ZIP_DEFLATED if i else zipfile.ZIP_STORED
            made.writestr(entry, data)
    return stream.getvalue()
