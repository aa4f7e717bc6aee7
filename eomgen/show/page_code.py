"""What the page of a run computes with: the functions of its mechanism, in JavaScript."""

from collections.abc import Mapping, Sequence

from eomgen.codegen.backends.javascript import mechanism
from eomgen.errors import EomgenError
from eomgen.language.formula import Formula
from eomgen.model.model import Model
from eomgen.scene.schema import Simulation
from eomgen.show.live import live_table
from eomgen.show.page import PageCode
from eomgen.store import interfaced_program_of, live_code

LONGEST = 1_500_000
"""A page with longer functions than these characters is live only on request."""


def page_code(
    model: Model,
    geometry: Sequence[Formula],
    simulation: Simulation,
    *,
    inputs: Mapping[str, float] | None = None,
    smooth: bool = True,
    mean_step: float | None = None,
    live: bool | None = None,
) -> PageCode:
    """The mechanism of a model's page; `geometry` are the formulas of its picture.

    A live one has functions for everything that the page can change. Otherwise they are those of
    the generated module. With `live` None it is live unless that fails or would be too large; with
    true the errors of the derivation are raised. `mean_step` is that of the run, s.
    """
    why = ""
    if live is not False:
        try:
            code = live_code(model, geometry)
        except EomgenError as error:
            if live:
                raise
            why = str(error)
        else:
            if live or len(code.source) <= LONGEST:
                table = live_table(model, code, simulation, inputs=inputs, mean_step=mean_step)
                return PageCode(code.source, table, live=True, smooth=smooth)
            why = f"its functions would take {len(code.source) / 1e6:.1f} MB"
    return _recorded(model, inputs or {}, smooth, why)


def _recorded(model: Model, inputs: Mapping[str, float], smooth: bool, why: str) -> PageCode:
    """The functions of the generated module: enough to show a run."""
    program, interface = interfaced_program_of(model)
    table = {
        "states": [{"name": s.name, "unit": s.unit, "kind": "other"} for s in interface.states],
        "quaternions": [],
        "parameters": [
            {"name": p.name, "value": p.default, "unit": p.unit, "about": p.about}
            for p in interface.parameters
        ],
        "inputs": [
            {
                "name": i.name,
                "value": inputs.get(i.name, i.default),
                "unit": i.unit,
                "about": i.about,
            }
            for i in interface.inputs
        ],
        "effects": [],
        "loads": [],
        "operations": 0,
        "joints": [body.joint.name for body in model.holding],
    }
    return PageCode(mechanism(program, interface), table, live=False, smooth=smooth, why=why)
