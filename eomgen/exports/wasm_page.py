"""A page that computes a motion by WebAssembly: one file, which needs no network."""

from base64 import b64encode
from dataclasses import replace

from eomgen.base.templating import render
from eomgen.codegen.backends import javascript
from eomgen.exports import Options, Written, wasm
from eomgen.model.model import Model
from eomgen.scene.schema import Simulation
from eomgen.store import interfaced_program_of

POSES = "body_poses"


def files(model: Model, options: Options) -> Written:
    """The page. Raises errors as `wasm.files`."""
    model = replace(model, outputs=tuple(dict.fromkeys((*model.outputs, POSES))))
    written = wasm.files(model, options)
    ((_, module),) = written.files.items()
    assert isinstance(module, bytes)
    interface = interfaced_program_of(model)[1]
    data = {
        "name": model.name,
        "module": b64encode(module).decode("ascii"),
        "dt": (options.simulation or Simulation()).dt,
        "dimensions": model.dimensions,
        "parents": [body.parent for body in model.bodies],
        "states": [(s.name, s.unit) for s in interface.states],
        "inputs": [(i.name, i.unit, i.default) for i in interface.inputs],
        "parameters": len(interface.parameters),
    }
    context = {"name": model.name, "data": data}
    page = render(javascript.TEMPLATES, "wasm_page.html", context, html=True)
    return Written({f"{model.name}.html": page}, written.remarks)
