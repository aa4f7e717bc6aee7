"""The C sources of a unit for co-simulation."""

import hashlib
import re
from collections.abc import Iterator, Mapping, Sequence

from eomgen.base.templating import render, templates_folder
from eomgen.codegen.backends import c
from eomgen.codegen.sampling import clock_values
from eomgen.codegen.series import series_functions
from eomgen.engine import contact_runs, contact_times, contacts
from eomgen.engine.crossings import MOST_PARTS
from eomgen.engine.embedded import DOP853
from eomgen.engine.methods import Root
from eomgen.engine.printed import CONTACTS, text
from eomgen.engine.taylor import HIGHEST
from eomgen.exports.fmu_unit import Observed, Unit
from eomgen.exports.steps import Method, contacts_of, step_of
from eomgen.native.functions import restricted
from eomgen.program.ordering import ordered
from eomgen.program.tape import TIME
from eomgen.subset.languages import C

HEADERS = ("fmi3PlatformTypes.h", "fmi3FunctionTypes.h", "fmi3Functions.h")
_VENDORED = templates_folder() / "fmu" / "vendor" / "fmi3"
_NOTHING_TO_DO = (
    *("fmi3EnterConfigurationMode", "fmi3ExitConfigurationMode", "fmi3EvaluateDiscreteStates"),
)
MAIN = "fmi3-unit.c"
"""The source to compile, which includes the others. No scene has a - in its name."""
DRIFT = 1e-9
"""In model exchange a state that is farther off its constraints, in sizes, is moved back."""
RTOL = 1e-10
"""Relative tolerance of steps of co-simulation, if the importer gives none."""


def sources_of(unit: Unit, method: Method) -> tuple[Mapping[str, str], str]:
    """The sources of a unit by name, whose steps a method makes, and its instantiation token, which
    is a digest of them.
    """
    others = {
        **c.files(unit.program, unit.interface),
        **{name: (_VENDORED / name).read_text("utf-8") for name in HEADERS},
    }
    digest = hashlib.sha256("".join((_main(unit, "", method), *others.values())).encode())
    token = f"{{{digest.hexdigest()[:32]}}}"
    return {MAIN: _main(unit, token, method), **others}, token


def _main(unit: Unit, token: str, method: Method) -> str:
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
        "indicators": sum(len(o.picks) for o in unit.indicators),
        "constants": len(held),
        "nominals": [repr(x) for x in unit.nominals],
        "starts": [repr(x) for x in unit.starts],
        "input_starts": [repr(i.default) for i in interface.inputs],
        "rtol": repr(RTOL),
        "span": repr(unit.simulation.t_end),
        "observed": list(_observed(unit.outputs, 0)),
        "switching": [(n, s) for n, s, _, _ in _observed(unit.switches, len(interface.contacts))],
        "angles": [i for i, s in enumerate(interface.states) if s.position and s.unit == "rad"],
        "most_parts": MOST_PARTS,
        **_contacts(unit, method),
        "rows": unit.interface.projected,
        "drift": repr(DRIFT),
        "step": step_of(method, interface, unit.size, C, text(), _more(unit, method), unit.series),
        "series": unit.series,
        "series_functions": series_functions(unit.series, C) if unit.series else "",
        "orders": HIGHEST + 1,
        "by_slopes": method.name == "DOP853" or (unit.series and interface.contacts),
        "adapts": method.adapts,
        "solves": "jacobian" in method.needed,
        "dt": repr(unit.simulation.dt),
        "slopes": len(DOP853.nodes),
        "last": DOP853.last,
        "parts": method.parts(interface, unit.series),
        "timed": _timed(unit),
        "clocks": clock_values(interface.sampling) if interface.sampling else None,
    }
    source = render("fmu", "unit.c.jinja", context)
    return "\n".join((source, *_without(source), ""))


def _without(source: str) -> Iterator[str]:
    """C of the functions of FMI 3.0 that a unit's source lacks: it has nothing of what they do."""
    yield "/* What this unit has nothing of. */"
    header = (_VENDORED / "fmi3FunctionTypes.h").read_text("utf-8")
    for result, name, given in re.findall(r"typedef (\w+) (fmi3\w+)TYPE\s*\(([^)]*)\);", header):
        if f" {name}(" in source:
            continue
        unused = re.findall(r"(\w+)(?:\[\])?\s*(?:,|$)", given)
        value = "nValueReferences ? fmi3Error : fmi3OK"
        if "nValueReferences" not in unused:
            value = "fmi3OK" if name in _NOTHING_TO_DO else "fmi3Error"
        value = "NULL" if result == "fmi3Instance" else value
        arguments = " ".join(given.split())
        ignored = ", ".join(f"(void){each}" for each in unused)
        yield f"\n{result} {name}({arguments}) {{\n    {ignored};\n    return {value};\n}}"


def _more(unit: Unit, method: Method) -> Iterator[Root]:
    """What is called of the engine beside steps: states within them only where events are."""
    contacts = unit.interface.contacts
    yield ("first_length" if method.adapts else "add_compensated"), {}
    if unit.series:
        called = "reach", "order_of", "series_step", "change_after", "convolved"
        yield from [(name, {}) for name in called]
        if contacts:  # while they are held there are no series
            yield "explicit_step", {"method": DOP853}
    if unit.interface.sampling:
        yield from [("sample", {}), ("next_tick", {})]
    if method.adapts and (unit.switches or contacts):
        if "jacobian" in method.needed:
            yield "rodas_within", {}
        else:
            yield "interpolate", {"method": DOP853}
            yield "within", {}
    if method.adapts and unit.switches:
        yield "passed_over", {}
    if contacts:
        yield from [*CONTACTS, ("met", {}), ("ended", {})]
        if "jacobian" in method.needed:
            yield "differences", {}


def _timed(unit: Unit) -> str:
    """C that tells whether the derivative depends on time."""
    program, _ = restricted(unit.program, unit.interface, ("derivative",))
    if any(step.value == TIME for step in ordered(program).steps if step.operation == "input"):
        return "1"
    return "any_held(&f->now)" if unit.interface.contacts else "0"


def _observed(parts: Sequence[Observed], start: int) -> list[tuple[str, int, int, Sequence[int]]]:
    """Each function, the place of its first entry, the number of its results, which are taken."""
    found: list[tuple[str, int, int, Sequence[int]]] = []
    for part in parts:
        found.append((part.function, start, part.size, part.picks))
        start += len(part.picks)
    return found


def _contacts(unit: Unit, method: Method) -> dict[str, object]:
    return {
        **contacts_of(unit.interface, unit.size, unit.simulation.rest_speed),
        "contact_names": [contact.name for contact in unit.interface.contacts],
        "tolerance": repr(contacts.TOLERANCE),
        "share": repr(contact_times.SHARE if method.adapts else 1.0),
        "opened": contact_runs.OPENED,
    }
