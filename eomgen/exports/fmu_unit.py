"""What a unit for co-simulation is made of: its program, variables, sizes and start values."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from eomgen.base.errors import SceneError
from eomgen.codegen.interface import Function, Interface, Variable
from eomgen.codegen.series import FIXED, with_series
from eomgen.exports.directions import with_directions
from eomgen.exports.steps import nominals_of, size_of, start_of
from eomgen.exports.units import rate_of
from eomgen.model.model import Model
from eomgen.native.functions import restricted
from eomgen.program.program import Program
from eomgen.program.switching import OF_STATE, OF_TIME
from eomgen.program.taylor_text import SeriesText
from eomgen.scene.schema import Simulation
from eomgen.store import interfaced_program_of
from eomgen.tables.outputs import OUTPUTS

ENERGIES = ("kinetic_energy", "potential_energy")
POSES = "body_poses"
CONTACTS = ("gaps", "gap_rates", "impact", "held")
CONSTRAINTS = ("constraint_residuals", "project_position", "project_velocity")
SWITCHING = (OF_STATE, OF_TIME)
SAMPLING = ("samples", "seeds")
KERNELS = ("derivative", *ENERGIES, POSES, *CONTACTS, *CONSTRAINTS, *SWITCHING, *SAMPLING)
"""The functions of a module that a unit has, as far as there are such."""


@dataclass(frozen=True)
class Observed:
    """Variables of a unit that are entries of a function of the program.

    size   number of the function's results
    picks  indices of the entries
    """

    function: str
    size: int
    picks: tuple[int, ...]
    variables: tuple[Variable, ...]


@dataclass(frozen=True)
class Unit:
    """A unit.

    starts    (ny,) initial state
    nominals  (ny,) sizes of the states
    size      of the mechanism, m
    outputs   what it observes beside the states
    gaps      of rigid contacts, and `switches`, the functions whose signs select a branch of the
              derivative: its event indicators
    series    the text of its Taylor series, if steps are made by them
    """

    program: Program
    interface: Interface
    simulation: Simulation
    starts: tuple[float, ...]
    nominals: tuple[float, ...]
    size: float
    outputs: tuple[Observed, ...]
    gaps: tuple[Observed, ...]
    switches: tuple[Observed, ...]
    series: SeriesText | None

    @property
    def rates(self) -> tuple[Variable, ...]:
        """The derivatives of the states."""
        return tuple(
            Variable(f"der({state.name})", rate_of(state.unit), f"time derivative of {state.name}")
            for state in self.interface.states
        )

    @cached_property
    def groups(self) -> dict[str, tuple[Variable, ...]]:
        """All variables but time, by kind, in the order of their value references, from 1 on."""
        return {
            "state": self.interface.states,
            "rate": self.rates,
            "input": self.interface.inputs,
            "parameter": self.interface.parameters,
            "output": tuple(v for part in self.outputs for v in part.variables),
            "indicator": tuple(v for part in self.indicators for v in part.variables),
        }

    @property
    def indicators(self) -> tuple[Observed, ...]:
        """The event indicators."""
        return (*self.gaps, *self.switches)

    def function(self, name: str) -> Function | None:
        """The function of that name, if the unit has it."""
        return next((f for f in self.interface.functions if f.name == name), None)


def unit_of(model: Model, simulation: Simulation, needed: Sequence[str] = ()) -> Unit:
    """The unit of a model, with functions that are `needed`, too. Raises `SceneError` for another
    state form than [q, v], `RunError` if there is no derivative at the initial state.
    """
    if model.form != "velocity":
        raise SceneError(
            f"form: an FMU has the state [q, v], not the form '{model.form}'; leave it out"
        )
    outputs = (*ENERGIES, POSES, *(name for name in needed if name in OUTPUTS))
    program, interface = interfaced_program_of(replace(model, outputs=outputs))
    starts = start_of(program, interface)
    names = [name for name in (*KERNELS, *needed) if name in program.outputs]
    program, interface = restricted(program, interface, names)
    series = None
    if FIXED in needed:
        program, interface, series = with_series(program, interface)
    size = size_of(interface, starts)
    nominals = nominals_of(program, interface, starts, size)
    observed = (*_energies(), *_positions(interface))
    gaps = _gaps(interface)
    switches = tuple(_switches(program))
    rates = range(len(interface.states))
    entries = [
        ("derivative", rates),
        *((o.function, o.picks) for o in (*observed, *gaps, *switches)),
    ]
    program, interface = with_directions(program, interface, entries)
    sizes = starts, nominals, size
    return Unit(program, interface, simulation, *sizes, observed, gaps, switches, series)


def _energies() -> Iterator[Observed]:
    for name in ENERGIES:
        kind = name.removesuffix("_energy")
        yield Observed(name, 1, (0,), (Variable(f"energy.{kind}", "J", f"{kind} energy"),))


def _positions(interface: Interface) -> Iterator[Observed]:
    """The centre of mass of each body in the world, and in the plane its angle."""
    axes = ("x", "y", "z")
    picks: list[int] = []
    variables: list[Variable] = []
    for k, body in enumerate(interface.bodies):
        for i, axis in enumerate(axes[: interface.dimensions]):
            picks.append(3 * k + i if interface.dimensions == 2 else 12 * k + 4 * i + 3)
            about = f"world {axis} of the centre of mass of {body}"
            variables.append(Variable(f"{body}.{axis}", "m", about))
        if interface.dimensions == 2:
            picks.append(3 * k + 2)
            variables.append(Variable(f"{body}.angle", "rad", f"angle of {body}"))
    size = (3 if interface.dimensions == 2 else 12) * len(interface.bodies)
    yield Observed(POSES, size, tuple(picks), tuple(variables))


def _gaps(interface: Interface) -> tuple[Observed, ...]:
    """The gaps of rigid contacts, in sizes of the mechanism."""
    variables = tuple(
        Variable(f"gap.{contact.name}", "1", f"gap of {contact.name} in sizes of the mechanism")
        for contact in interface.contacts
    )
    count = len(variables)
    return (Observed("gaps", count, tuple(range(count)), variables),) if count else ()


def _switches(program: Program) -> Iterator[Observed]:
    first = 1
    for name in SWITCHING:
        if name in program.outputs:
            count = len(program.outputs[name].nodes)
            variables = tuple(
                Variable(
                    f"switch[{first + i}]", "", "selects a branch of the equations by its sign"
                )
                for i in range(count)
            )
            first += count
            yield Observed(name, count, tuple(range(count)), variables)
