"""The C sources of a unit for co-simulation."""

import hashlib
from collections.abc import Mapping, Sequence

from eomgen.codegen.backends import c
from eomgen.engine import contacts, projection
from eomgen.engine.embedded import DOP853
from eomgen.engine.printed import CONTACTS, Roots, c_source
from eomgen.exports.fmu_unit import Observed, Unit
from eomgen.run import events
from eomgen.subset.languages import C
from eomgen.templating import render, templates_folder

HEADERS = ("fmi3PlatformTypes.h", "fmi3FunctionTypes.h", "fmi3Functions.h")
MAIN = "fmi3-unit.c"
"""The source to compile, which includes the others. No scene has a - in its name."""
DRIFT = 1e-9
"""In model exchange a state that is farther off its constraints, in sizes, is moved back."""
RTOL = 1e-10
"""Relative tolerance of steps of co-simulation, if the importer gives none."""


def sources_of(
    unit: Unit, method: Mapping[str, object] | None = None
) -> tuple[Mapping[str, str], str]:
    """The sources of a unit by name, and its instantiation token, which is a digest of them. A
    `method` of `explicit_steps.context` makes steps of equal length.
    """
    folder = templates_folder() / "fmu" / "vendor" / "fmi3"
    others = {
        **c.files(unit.program, unit.interface),
        **{name: (folder / name).read_text("utf-8") for name in HEADERS},
    }
    digest = hashlib.sha256("".join((_main(unit, "", method or {}), *others.values())).encode())
    token = f"{{{digest.hexdigest()[:32]}}}"
    return {MAIN: _main(unit, token, method or {}), **others}, token


def _main(unit: Unit, token: str, method: Mapping[str, object]) -> str:
    interface = unit.interface
    held = c.context(unit.program, interface)["held"]
    context = {
        "prefix": interface.name,
        "prelude": C.prelude.strip(),
        "token": token,
        "states": len(interface.states),
        "inputs": len(interface.inputs),
        "parameters": len(interface.parameters),
        "outputs": sum(len(o.picks) for o in unit.outputs),
        "contacts": len(interface.contacts),
        "indicators": sum(len(o.picks) for o in unit.indicators),
        "constants": len(held),
        "nominals": [repr(x) for x in unit.nominals],
        "starts": [repr(x) for x in unit.starts],
        "input_starts": [repr(i.default) for i in interface.inputs],
        "rtol": repr(RTOL),
        "span": repr(unit.simulation.t_end),
        "quaternions": interface.quaternions,
        "observed": list(_observed(unit.outputs, 0)),
        "switching": [(n, s) for n, s, _, _ in _observed(unit.switches, len(interface.contacts))],
        **_closure(unit),
        **_contacts(unit),
        "dt": repr(unit.simulation.dt),
        "steps": c_source(_steps(unit)),
        "explicit_step": "",
        "positions": 0,
        **method,
        "slopes": len(DOP853.nodes),
    }
    return render("fmu", "unit.c.jinja", context)


def _steps(unit: Unit) -> Roots:
    """What of the engine's text steps are made with: states within steps only where events are."""
    method = {"method": DOP853}
    roots: Roots = (("first_length", {}), ("made", method))
    if unit.switches or unit.interface.contacts:
        roots = (*roots, ("interpolate", method), ("within", {}))
    return roots


def _observed(parts: Sequence[Observed], start: int) -> list[tuple[str, int, int, Sequence[int]]]:
    """Each function, the place of its first entry, the number of its results, which are taken."""
    found: list[tuple[str, int, int, Sequence[int]]] = []
    for part in parts:
        found.append((part.function, start, part.size, part.picks))
        start += len(part.picks)
    return found


def _closure(unit: Unit) -> dict[str, object]:
    interface = unit.interface
    rows = interface.constraints if interface.projected else ()
    return {
        "rows": len(rows),
        "row_sizes": [repr(unit.size if force == "N" else 1.0) for _, force in rows],
        "coordinates": interface.coordinates,
        "velocities": interface.velocities,
        "projection": c_source([("moved_onto", {})]),
        "on_constraints": projection.PROJECTED,
        "far": projection.FAR,
        "drift": repr(DRIFT),
    }


def _contacts(unit: Unit) -> dict[str, object]:
    held, rest = unit.function("held"), unit.simulation.rest_speed
    sizes = [unit.size if contact.unit == "m" else 1.0 for contact in unit.interface.contacts]
    return {
        "held_size": held.shape[0] if held else 0,
        "contact_names": [contact.name for contact in unit.interface.contacts],
        "gap_sizes": list(map(repr, sizes)),
        "rest": ["-1.0" if rest is None else repr(rest / size) for size in sizes],
        "tolerance": repr(contacts.TOLERANCE),
        "struck": contacts.STRUCK,
        "endless": contacts.ENDLESS,
        "no_forces": contacts.NO_FORCES,
        "share": repr(events.GAP_CHECKS[1]),
        "engine": c_source(CONTACTS),
        "most_events": events.MOST_EVENTS,
    }
