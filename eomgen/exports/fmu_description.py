"""The XML files of a unit for co-simulation: variables, units, structure, how to build it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from eomgen.base.errors import SceneError
from eomgen.base.templating import render
from eomgen.base.text import one_line
from eomgen.codegen.interface import Variable
from eomgen.exports.directions import dependencies
from eomgen.exports.fmu_unit import Unit
from eomgen.exports.units import exponents

ATTRIBUTES: Mapping[str, Mapping[str, str]] = {
    "state": {"causality": "output", "variability": "continuous", "initial": "exact"},
    "rate": {"causality": "local", "variability": "continuous", "initial": "calculated"},
    "input": {"causality": "input", "variability": "continuous"},
    "parameter": {"causality": "parameter", "variability": "tunable", "initial": "exact"},
    "output": {"causality": "output", "variability": "continuous", "initial": "calculated"},
    "indicator": {"causality": "local", "variability": "continuous", "initial": "calculated"},
}
"""What each kind of variable is to an importer."""
Structure = Iterator[tuple[str, int, Sequence[int] | None]]
"""Elements of the model structure: kind, value reference, and what it depends on, if known."""


@dataclass(frozen=True)
class Entry:
    """A variable with its value reference and the attributes of its element."""

    name: str
    reference: int
    attributes: tuple[tuple[str, str], ...]


def description_files(unit: Unit, token: str, main: str) -> Mapping[str, str]:
    """The contents of `modelDescription.xml` and of the file that says how to compile `main`."""
    interface, simulation = unit.interface, unit.simulation
    entries = list(_entries(unit))
    used = {value for e in entries for key, value in e.attributes if key == "unit"}
    taken = {entry.name: entry for entry in entries}
    for entry in entries:
        if taken[entry.name] is not entry:
            raise SceneError(f"an FMU has two variables '{entry.name}'; rename a body or a contact")
    context = {
        "name": interface.name,
        "token": token,
        "title": one_line(interface.title or interface.name),
        "units": [(name, exponents(name)) for name in sorted({"s", *used})],
        "stop": repr(simulation.t_end),
        "tolerance": repr(min(simulation.rtol, 1e-6)),
        "time": "t" if "time" in taken else "time",
        "variables": entries,
        "structure": list(_structure(unit)),
    }
    build = {"name": interface.name, "main": main}
    return {
        "modelDescription.xml": render("fmu", "modelDescription.xml.jinja", context, html=True),
        "sources/buildDescription.xml": render(
            "fmu", "buildDescription.xml.jinja", build, html=True
        ),
    }


def _entries(unit: Unit) -> Iterator[Entry]:
    reference = 1
    count = len(unit.interface.states)
    for kind, variables in unit.groups.items():
        for i, variable in enumerate(variables):
            own: dict[str, str] = dict(ATTRIBUTES[kind])
            if variable.about:
                own["description"] = one_line(variable.about)
            if variable.unit:
                own["unit"] = variable.unit
            if start := _start(unit, kind, i, variable):
                own["start"] = start
            if kind == "rate":
                own["derivative"] = str(reference - count)
            if kind == "state":
                own["nominal"] = repr(unit.nominals[i])
            yield Entry(variable.name, reference, tuple(own.items()))
            reference += 1


def _start(unit: Unit, kind: str, i: int, variable: Variable) -> str:
    """The start value of a variable; "" if it is calculated."""
    if kind == "state":
        return repr(unit.starts[i])
    return repr(variable.default) if kind in ("input", "parameter") else ""


def _structure(unit: Unit) -> Structure:
    """Outputs, derivatives of states, initial unknowns, event indicators, in this order.

    What depends on forces of contacts may depend on everything.
    """
    groups, interface = unit.groups, unit.interface
    first: dict[str, int] = {}
    reference = 1
    for kind, variables in groups.items():
        first[kind] = reference
        reference += len(variables)
    running = ("state", "input")
    starting = ("state", "input", "parameter")
    names = [v.name for kind in starting for v in groups[kind]]
    references = [first[kind] + i for kind in starting for i in range(len(groups[kind]))]
    found = dependencies(unit.program, names)
    many = sum(len(groups[kind]) for kind in running)

    def on(node: int, *, parameters: bool = False) -> list[int]:
        return [references[k] for k in found[node] if parameters or k < many]

    outputs = unit.program.outputs
    observed = [outputs[part.function].nodes[i] for part in unit.outputs for i in part.picks]
    rates = outputs["derivative"].nodes
    touching = bool(interface.contacts)
    for i in range(len(interface.states)):
        yield "Output", first["state"] + i, [first["state"] + i]
    for i, node in enumerate(observed):
        yield "Output", first["output"] + i, on(node)
    for i, node in enumerate(rates):
        yield "ContinuousStateDerivative", first["rate"] + i, None if touching else on(node)
    closed = touching or interface.projected or interface.quaternions
    for i, node in enumerate(observed):
        needed = None if closed else on(node, parameters=True)
        yield "InitialUnknown", first["output"] + i, needed
    for i, node in enumerate(rates):
        needed = None if closed else on(node, parameters=True)
        yield "InitialUnknown", first["rate"] + i, needed
    for i in range(len(groups["indicator"])):
        yield "EventIndicator", first["indicator"] + i, None
