"""The C sources of a unit for co-simulation."""

import hashlib
from collections.abc import Mapping, Sequence

from eomgen.codegen.backends import c
from eomgen.engine import projection
from eomgen.engine.printed import c_source
from eomgen.exports.fmu_unit import Observed, Unit
from eomgen.native.dop853 import constants, written_out
from eomgen.run import complementarity, contacts, events
from eomgen.templating import render, templates_folder

HEADERS = ("fmi3PlatformTypes.h", "fmi3FunctionTypes.h", "fmi3Functions.h")
MAIN = "fmi3-unit.c"
"""The source to compile, which includes the others. No scene has a - in its name."""
DRIFT = 1e-9
"""In model exchange a state that is farther off its constraints, in sizes, is moved back."""
RTOL = 1e-10
"""Relative tolerance of steps of co-simulation, if the importer gives none."""


def sources_of(unit: Unit) -> tuple[Mapping[str, str], str]:
    """The sources of a unit by name, and its instantiation token, which is a digest of them."""
    folder = templates_folder() / "fmu" / "vendor" / "fmi3"
    others = {
        **c.files(unit.program, unit.interface),
        **{name: (folder / name).read_text("utf-8") for name in HEADERS},
    }
    digest = hashlib.sha256("".join((_main(unit, ""), *others.values())).encode())
    token = f"{{{digest.hexdigest()[:32]}}}"
    return {MAIN: _main(unit, token), **others}, token


def _main(unit: Unit, token: str) -> str:
    interface = unit.interface
    held = c.context(unit.program, interface)["held"]
    context = {
        "prefix": interface.name,
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
        **constants(written_out),
    }
    return render("fmu", "unit.c.jinja", context)


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
    slowest = f"sqrt(2 * {contacts.RISE!r} * most)" if rest is None else f"{rest!r} / gap_sizes[c]"
    return {
        "held_size": held.shape[0] if held else 0,
        "contact_names": [contact.name for contact in unit.interface.contacts],
        "gap_sizes": [
            repr(unit.size if contact.unit == "m" else 1.0) for contact in unit.interface.contacts
        ],
        "tolerance": repr(contacts.TOLERANCE),
        "still": repr(contacts.STILL),
        "parting": repr(contacts.PARTING),
        "alpha": repr(contacts.ALPHA),
        "away": repr(contacts.AWAY),
        "strong": repr(contacts.STRONG),
        "rest": slowest,
        "bounces": contacts.BOUNCES,
        "strikes": contacts.STRIKES,
        "rounding": repr(complementarity.ROUNDING),
        "consistent": repr(complementarity.CONSISTENT),
        "most_events": events.MOST_EVENTS,
    }
